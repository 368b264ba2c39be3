"""Biomomentum's Mach-1: tab-separated text, one "<DATA> ... <END DATA>" a step, units in the names ("Fz, gf").

Above each block stand the test's name and settings in lines of their own ("<Stress Relaxation>").
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from tissuejax.recordings.delimited import text_lines
from tissuejax.recordings.exports import text
from tissuejax.recordings.exports.export import Exported, TableExport, stacked


class Mach1(TableExport):
    """Text file of a Mach-1 tester."""

    name: ClassVar[str] = "biomomentum-mach-1"
    machine: ClassVar[str] = "Biomomentum Mach-1"
    basis: ClassVar[str] = "its public description"
    meanings: ClassVar[Mapping[str, str]] = {
        "position (z)": "displacement",
        "position z": "displacement",
        "position x": "",
        "position y": "",
    }

    def recognises(self, path: Path, head: str) -> bool:
        """By its tags."""
        return "<Mach-1" in head or ("<DATA>" in head and "Time, s" in head)

    def read(self, path: Path) -> Exported:
        """Each data block under the name of its test, with a count where one comes again."""
        lines = text_lines(path)
        whole = text.understood(lines, "\t", ".")
        tables = [(t, t.names_at) for t in whole.tables if t.names_at is not None]
        names: list[str] = []
        for table, names_at in tables:
            tags = [m[1] for i in range(table.above, names_at) if (m := re.match(r"<(?!DATA|END|INFO)(.+)>", lines[i]))]
            name = tags[-1] if tags else "data"
            names.append(f"{len(names) + 1} {name}")
        top = tables[0][1] if tables else len(lines)
        return stacked(path, [t for t, _ in tables], text.header(lines[:top], "\t"), names)

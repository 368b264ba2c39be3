"""FischerScope hardness testers: tab-separated text, decimal commas, one block a measurement, no units in the names.

F is in mN, h in um and t in s (the line "F = ESP n 300.000mN/120s/37s" says so of force and time). Above the blocks
stand statistics of the results, which are no curve.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

from tissuejax.recordings.delimited import text_lines
from tissuejax.recordings.exports import text
from tissuejax.recordings.exports.export import Exported, TableExport, stacked

UNITS = {"F": "mN", "h": "um", "t": "s"}


class FischerScope(TableExport):
    """Text export of a series of indentations (.hap)."""

    name: ClassVar[str] = "fischerscope"
    machine: ClassVar[str] = "FischerScope hardness tester"
    basis: ClassVar[str] = "a real file"
    experiment: ClassVar[str] = "probing"
    meanings: ClassVar[Mapping[str, str]] = {"f": "force", "h": "displacement", "t": "time"}

    def recognises(self, path: Path, head: str) -> bool:
        """By its application file and its statistics."""
        return ".hap" in head[:200] and "Statistics of block" in head

    def read(self, path: Path) -> Exported:
        """Each measurement as a block, by its number."""
        lines = text_lines(path)
        whole = text.understood(lines, "\t", ",")
        tables = [
            replace(t, units=tuple(UNITS[n] for n in t.names)) for t in whole.tables if set(t.names) == set(UNITS)
        ]
        numbers = [re.search(r"Value\s*:\s*(\d+)", line) for line in lines]
        names = []
        for k, table in enumerate(tables):
            numbered = [m[1] for m in numbers[table.above : table.first] if m]
            names.append(numbered[-1] if numbered else str(k + 1))
        assumed = ["force is in mN, depth in um and time in s, which the names of the columns don't say"]
        key_lines = [line for line in lines[:12] if re.match(r"[A-Za-z]", line)]
        return stacked(path, tables, text.header(key_lines, "\t"), names, assumed, ",")

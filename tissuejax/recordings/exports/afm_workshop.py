"""AFM Workshop's force-distance curves: comma-separated, extend and retract side by side, units in the names.

No time is recorded, the offset of the force is left in, and Z is the piezo's: the bending of the lever is still in it.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from tissuejax.recordings.delimited import text_lines
from tissuejax.recordings.exports import text
from tissuejax.recordings.exports.export import Exported, TableExport, stacked

_NAMES = ("Z-Sense(nm)", "Force(nN)")


class AfmWorkshop(TableExport):
    """Text export of one force-distance curve."""

    name: ClassVar[str] = "afm-workshop"
    machine: ClassVar[str] = "AFM Workshop"
    basis: ClassVar[str] = "a real file"
    experiment: ClassVar[str] = "probing"
    meanings: ClassVar[Mapping[str, str]] = {"z sense": "displacement", "force": "force"}

    def recognises(self, path: Path, head: str) -> bool:
        """By its first line and its columns."""
        return "Force-Distance Curve" in head and "Extend Z-Sense" in head

    def read(self, path: Path) -> Exported:
        """Extend and retract as two blocks with the same columns."""
        lines = text_lines(path)
        whole = text.understood(lines, ",", ".")
        found, names = [], []
        for table in whole.tables:
            for way in ("Extend", "Retract"):
                places = [k for n in _NAMES for k, name in enumerate(table.names) if name == f"{way} {n}"]
                if len(places) == len(_NAMES):
                    rows = [[row[k] for k in places] for row in table.rows if all(row[k] for k in places)]
                    found.append(text.TextTable(_NAMES, ("nm", "nN"), rows, table.first, table.names_at, False, 0))
                    names.append(way.lower())
        top = whole.tables[0].names_at or 0 if whole.tables else len(lines)
        assumed = [
            "the depth is the piezo's travel: the bending of the lever is still in it, and so is an offset of the "
            "force; no time is recorded"
        ]
        return stacked(path, found, text.header(lines[:top], ","), names, assumed)

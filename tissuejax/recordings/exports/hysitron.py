"""Hysitron (Bruker) nanoindenters: text export, tab-separated, depth and load in units and again in volts."""

from pathlib import Path
from typing import ClassVar

from tissuejax.errors import InputError
from tissuejax.recordings.exports.export import Exported, TableExport, from_text


class Hysitron(TableExport):
    """Text export of a load-displacement curve; the declared number of points is checked."""

    name: ClassVar[str] = "hysitron"
    machine: ClassVar[str] = "Hysitron nanoindenter"
    basis: ClassVar[str] = "a real file (TriboScan)"
    experiment: ClassVar[str] = "probing"

    def recognises(self, path: Path, head: str) -> bool:
        """By its count of points and its columns."""
        return "Number of Points" in head and "Depth (nm)" in head and "Load (" in head

    def read(self, path: Path) -> Exported:
        """Its table.

        Raises:
            InputError: fewer or more rows than the file declares.
        """
        found = from_text(path, separator="\t", decimal=".")
        declared = found.header.get("Number of Points", "")
        rows = len(found.columns.lines)
        if declared.isdigit() and int(declared) != rows:
            raise InputError(
                f"{path}: found {rows} rows, expected {declared} as its key line says: it may be cut short"
            )
        return found

"""CellScale's UniVert: one axis, comma-separated, units in the names (Time_S, Size_mm, Displacement_mm, Force_N)."""

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from tissuejax.recordings.exports.export import Exported, TableExport, from_text


class UniVert(TableExport):
    """Data file of the UniVert; columns can be chosen in its program, and those that are there are read."""

    name: ClassVar[str] = "cellscale-univert"
    machine: ClassVar[str] = "CellScale UniVert"
    basis: ClassVar[str] = "its public description"
    experiment: ClassVar[str] = "uniaxial"
    meanings: ClassVar[Mapping[str, str]] = {"size": "length", "temperature": ""}

    def recognises(self, path: Path, head: str) -> bool:
        """By its columns of set and cycle, with one axis."""
        return "SetName" in head and "Time_S" in head and "XForce" not in head and "XDisp" not in head

    def read(self, path: Path) -> Exported:
        """Its table."""
        return from_text(path)

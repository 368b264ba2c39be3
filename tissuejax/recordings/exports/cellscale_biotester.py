"""CellScale's BioTester: two axes, comma-separated, units in the names (XSize_um, YSize_um, XForce_mN, YForce_mN)."""

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from tissuejax.recordings.exports.export import Exported, TableExport, from_text


class BioTester(TableExport):
    """Data file of the BioTester; stretch is size over first size of each axis."""

    name: ClassVar[str] = "cellscale-biotester"
    machine: ClassVar[str] = "CellScale BioTester"
    basis: ClassVar[str] = "its public description"
    experiment: ClassVar[str] = "biaxial"
    meanings: ClassVar[Mapping[str, str]] = {
        "xsize": "length",
        "ysize": "length",
        "xforce": "force",
        "yforce": "force",
        "xdisplacement": "",
        "ydisplacement": "",
        "temperature": "",
    }

    def recognises(self, path: Path, head: str) -> bool:
        """By its columns of two axes."""
        return "Time_S" in head and "XForce" in head and "YForce" in head

    def read(self, path: Path) -> Exported:
        """Its table."""
        assumed = ["the first row's sizes are the undeformed ones; one area serves both axes"]
        return from_text(path, assumed=assumed)

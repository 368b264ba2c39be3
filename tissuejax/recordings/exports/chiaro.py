"""Optics11's Chiaro (and Piuma): nanoindentation by a ball on a cantilever, tab-separated, units in the names.

Load is the lever's stiffness times its bending; the column of indentation is zero until the program saw contact. Line
ends are mixed in these files, and the micro sign is latin-1.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from tissuejax.recordings.exports.export import Exported, TableExport, from_text


class Chiaro(TableExport):
    """Text file of the Chiaro, software version 3."""

    name: ClassVar[str] = "optics11-chiaro"
    machine: ClassVar[str] = "Optics11 Chiaro"
    basis: ClassVar[str] = "a real file (software V3.5.0)"
    experiment: ClassVar[str] = "probing"
    meanings: ClassVar[Mapping[str, str]] = {
        "indentation": "displacement",
        "load": "force",
        "cantilever": "",
        "piezo": "",
        "auxiliary": "",
    }

    def recognises(self, path: Path, head: str) -> bool:
        """By its device line or its columns."""
        return "Device:\tChiaro" in head or ("Tip radius (um)" in head and "Cantilever (nm)" in head)

    def read(self, path: Path) -> Exported:
        """Its table; lever stiffness and tip radius are among the key lines."""
        assumed = [
            "the depth is the column of indentation, which the program counts from where it saw contact and which has "
            "the bending of the lever taken off"
        ]
        return from_text(path, separator="\t", decimal=".", assumed=assumed)

"""Instron's WaveMatrix: dynamic tests, commas, units in the names ("Position(Linear:Digital Position) (mm)")."""

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from tissuejax.recordings.exports.export import Exported, TableExport, from_text


class WaveMatrix(TableExport):
    """Tracking or peak-and-trough files of WaveMatrix; torsion is read, though no experiment takes it."""

    name: ClassVar[str] = "instron-wavematrix"
    machine: ClassVar[str] = "Instron WaveMatrix"
    basis: ClassVar[str] = "a hand-written example of its header and its public description"
    meanings: ClassVar[Mapping[str, str]] = {
        "cycle elapsed time": "",
        "elapsed cycles": "",
        "total cycles": "",
        "torque": "",
        "rotation": "angle",
    }

    def recognises(self, path: Path, head: str) -> bool:
        """By its "Total Time (s)" with cycles, or channels named after their axis."""
        marks = ("Total Cycle", "Elapsed Cycle", "(Linear:", "(Rotary:", "Rotation (", "Torque (")
        return "Total Time (s)" in head and any(m in head for m in marks)

    def read(self, path: Path) -> Exported:
        """Its table."""
        return from_text(path, separator=",")

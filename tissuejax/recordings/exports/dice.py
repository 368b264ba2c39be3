"""DICe (Sandia's open image correlation): full field as CSV under lines of "***", in pixels, y downwards."""

from pathlib import Path
from typing import ClassVar

from tissuejax.recordings.exports.field import FieldColumns, field
from tissuejax.recordings.exports.tracked import MarkerExport, Tracked

_COLUMNS = FieldColumns(
    ("COORDINATE_X", "COORDINATE_Y", "COORDINATE_Z"),
    ("DISPLACEMENT_X", "DISPLACEMENT_Y", "DISPLACEMENT_Z"),
    # DICe gives sigma = -1 to a subset that failed.
    ("SIGMA", lambda v: v < 0),
    "SUBSET_ID",
)


class DICe(MarkerExport):
    """One solution file, a step of the deformation."""

    name: ClassVar[str] = "dice"
    program: ClassVar[str] = "DICe image correlation"
    basis: ClassVar[str] = "a real file (full field)"

    def recognises(self, path: Path, head: str) -> bool:
        """By its banner, or its columns."""
        return "(DICe)" in head or ("COORDINATE_X" in head and "DISPLACEMENT_X" in head)

    def read(self, path: Path) -> Tracked:
        """Subsets in the order of the file."""
        return field(path, _COLUMNS, "pixel", ("lengths are pixels and y counts downwards, as its header says",))

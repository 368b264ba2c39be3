"""Correlated Solutions' VIC-3D: CSV export of one image, world coordinates X Y Z and displacements U V W."""

from pathlib import Path
from typing import ClassVar

from tissuejax.recordings.exports.field import FieldColumns, field, names_of_field
from tissuejax.recordings.exports.tracked import MarkerExport, Tracked

# Capital letters are lengths in space; small ones (x, y, u, v, q, r) are pixels of the two images.
_COLUMNS = FieldColumns(("X", "Y", "Z"), ("U", "V", "W"), (r"(?i)sigma", lambda v: v < 0))


class Vic3D(MarkerExport):
    """One image's points; sigma = -1 marks a point that wasn't matched."""

    name: ClassVar[str] = "vic-3d"
    program: ClassVar[str] = "VIC-3D image correlation"
    basis: ClassVar[str] = "its public description"

    def recognises(self, path: Path, head: str) -> bool:
        """By its column names on one line."""
        return names_of_field(head, _COLUMNS, axes=3)

    def read(self, path: Path) -> Tracked:
        """Points in the order of the file; millimetres, as the program calibrates."""
        return field(path, _COLUMNS, "mm", ("lengths are taken as millimetres, as the calibration target is entered",))

"""GOM Correlate / ZEISS Inspect Correlate: facet points as CSV, coordinates and displacements of one stage."""

from pathlib import Path
from typing import ClassVar

from tissuejax.recordings.exports.field import FieldColumns, field, names_of_field
from tissuejax.recordings.exports.tracked import MarkerExport, Tracked

_COLUMNS = FieldColumns(
    (
        r"(?i)(point |coordinate |coord\.? ?|undeformed )?x",
        r"(?i)(point |coordinate |coord\.? ?|undeformed )?y",
        r"(?i)(point |coordinate |coord\.? ?|undeformed )?z",
    ),
    (
        r"(?i)dx|displacement[ ._]?x|x displacement",
        r"(?i)dy|displacement[ ._]?y|y displacement",
        r"(?i)dz|displacement[ ._]?z|z displacement",
    ),
    None,
    r"(?i)(id|index|name|element)",
)


class Gom(MarkerExport):
    """Text export of a surface component."""

    name: ClassVar[str] = "gom"
    program: ClassVar[str] = "GOM/ZEISS Correlate"
    basis: ClassVar[str] = "its public description"

    def recognises(self, path: Path, head: str) -> bool:
        """By its program's name, or displacements called after axes beside coordinates."""
        low = head.lower()
        return ("gom" in low[:400] and "displacement" in low) or (
            "displacement" in low and names_of_field(head, _COLUMNS)
        )

    def read(self, path: Path) -> Tracked:
        """Points in the order of the file; millimetres where no unit stands."""
        return field(path, _COLUMNS, "mm", ("lengths are taken as millimetres where no unit stands",))

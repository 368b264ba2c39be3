"""MatchID: CSV export of one image, "Coordinates..." and "Horizontal Displacement U" with units in brackets."""

from pathlib import Path
from typing import ClassVar

from tissuejax.recordings.exports.field import FieldColumns, field
from tissuejax.recordings.exports.tracked import MarkerExport, Tracked

_COLUMNS = FieldColumns(
    (
        r"(?i)(coor\w*[. ])?(world )?x( ?coordinate)?",
        r"(?i)(coor\w*[. ])?(world )?y( ?coordinate)?",
        r"(?i)(coor\w*[. ])?(world )?z( ?coordinate)?",
    ),
    (
        r"(?i)(disp\w*[. ])?horizontal displacement u",
        r"(?i)(disp\w*[. ])?vertical displacement v",
        r"(?i)(disp\w*[. ])?out[- ]of[- ]plane(:| )? ?(displacement )?w",
    ),
    (r"(?i)(corr\w*[. ])?correlation( value)?", lambda v: v < 0),
)


class MatchId(MarkerExport):
    """One image's points, two- or three-dimensional."""

    name: ClassVar[str] = "matchid"
    program: ClassVar[str] = "MatchID image correlation"
    basis: ClassVar[str] = "its public description"

    def recognises(self, path: Path, head: str) -> bool:
        """By the names of its displacements."""
        return "Horizontal Displacement U" in head

    def read(self, path: Path) -> Tracked:
        """Points in the order of the file."""
        return field(path, _COLUMNS, "pixel", ("lengths are pixels where no unit stands",))

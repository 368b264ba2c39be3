"""TA Instruments' TRIOS: a rheometer's or DMA's text export, tab-separated, one block a step.

Key lines, sections in brackets ("[Geometry Parameters]"), then for each step "[step]", the step's name, names, units
below them, numbers. Time comes in minutes and stress in MPa as the machine was told to show them.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from tissuejax.recordings.delimited import text_lines
from tissuejax.recordings.exports import text
from tissuejax.recordings.exports.export import Exported, TableExport, stacked


class Trios(TableExport):
    """Text export of TRIOS."""

    name: ClassVar[str] = "ta-trios"
    machine: ClassVar[str] = "TA Instruments TRIOS"
    basis: ClassVar[str] = "a real file (creep on a rotational rheometer)"
    experiment: ClassVar[str] = "simple-shear"
    meanings: ClassVar[Mapping[str, str]] = {
        "strain": "shear",
        "stress": "nominal_stress",
        "displacement": "",
        "gap": "",
        "axial force": "",
    }

    def recognises(self, path: Path, head: str) -> bool:
        """By its version line or its sections."""
        return "Trios version" in head or ("[File Parameters]" in head and "[Geometry Parameters]" in head)

    def read(self, path: Path) -> Exported:
        """Each step as a block by its name; key lines of all sections as header (geometry, gap, instrument)."""
        lines = text_lines(path)
        whole = text.understood(lines, "\t", ".")
        steps = [(t, t.names_at) for t in whole.tables if t.names_at is not None]
        names = [_step(lines, names_at, k) for k, (_, names_at) in enumerate(steps)]
        top = steps[0][1] if steps else len(lines)
        assumed = [
            "shear stress and strain at the rim are taken as those of the whole specimen, as the machine gives them"
        ]
        return stacked(path, [t for t, _ in steps], text.header(lines[:top], "\t"), names, assumed)


def _step(lines: list[str], names_at: int, k: int) -> str:
    """The step's name: the line above the names, under "[step]"."""
    above = [lines[i].strip() for i in range(max(0, names_at - 3), names_at) if lines[i].strip()]
    return above[-1] if above and not above[-1].startswith("[") else str(k + 1)

"""The family of marker exports: positions of points over time, from motion capture or image correlation."""

import abc
import functools
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError
from tissuejax.families import members
from tissuejax.recordings.exports.export import head_of


@dataclass(frozen=True)
class Tracked:
    """Points over time, as the file has them.

    Attributes:
        time: s; None where the file holds no time (a full field: first frame the reference, then the deformed ones).
        position: NaN where a point was lost; the third coordinate is zero where the file is plane.
        labels: names of the points.
        unit: "m", "mm", ...; "pixel" or "" where the file gives no length.
        assumed: sentences on what the reader took for granted.
        plane: whether the file holds no third coordinate.
    """

    time: Float[np.ndarray, " m"] | None
    position: Float[np.ndarray, "m k 3"]
    labels: tuple[str, ...]
    unit: str
    assumed: tuple[str, ...] = ()
    plane: bool = False


class MarkerExport(abc.ABC):
    """One program's file of points.

    Class data:
        name: as written in a side file, `format = "..."`.
        program: what wrote it, for messages.
        basis: what the reader was tested on.
    """

    name: ClassVar[str]
    program: ClassVar[str]
    basis: ClassVar[str]

    @abc.abstractmethod
    def recognises(self, path: Path, head: str) -> bool:
        """Whether a file with this beginning is of this format."""

    @abc.abstractmethod
    def read(self, path: Path) -> Tracked:
        """The points.

        Raises:
            InputError: no points in it, or one that can't be read.
        """


@functools.cache
def marker_exports() -> dict[str, MarkerExport]:
    """All marker exports by name."""
    import tissuejax.recordings.exports as folder

    return {name: kind() for name, kind in members(folder, MarkerExport).items()}


def marker_export(path: Path) -> MarkerExport | None:
    """The marker export that a file is, by its content; None where no member knows it."""
    head = head_of(path)
    return next((kind for kind in marker_exports().values() if kind.recognises(path, head)), None)


def tracked(path: Path) -> Tracked:
    """The points in a file of any known format.

    Raises:
        InputError: an unknown format; those known are named.
    """
    kind = marker_export(path)
    if kind is None:
        known = ", ".join(k.program for k in marker_exports().values())
        raise InputError(
            f"{path}: found no file of points that is known, expected one of: {known}, or a CSV of columns"
        )
    return kind.read(path)

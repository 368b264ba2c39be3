"""A round column of hexes on its base, graded to the middle of its top: whole, or the quarter that symmetry leaves.

A square grid is pressed into the disc (x sqrt(1 - y^2/2), y sqrt(1 - x^2/2)), so there is no bad element on the axis.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError
from tissuejax.mesh.columns import box
from tissuejax.recordings.recording import Geometry


class Disc(NamedTuple):
    """The mesh, and which axes of its fixed nodes are held: all on the base, the normal one on a symmetry plane."""

    geometry: Geometry
    held: Float[np.ndarray, "F 3"]


def disc(
    radius: float, height: float, counts: tuple[int, int], inward: float = 0.0, upward: float = 0.0, whole: bool = False
) -> Disc:
    """A disc of hexes.

    Args:
        radius, height: m.
        counts: elements along a radius, and layers.
        inward, upward: grading by sinh towards the axis and towards the top; 0 is uniform. The finest spacing is
            the uniform one times steepness / sinh(steepness).
        whole: the whole disc instead of the quarter x, y >= 0.

    Raises:
        InputError: counts below one, lengths that are not positive.
    """
    n, layers = counts
    if min(n, layers) < 1 or not radius > 0 or not height > 0:
        raise InputError(f"disc of {radius} x {height} m with {counts} elements: all of it must be positive")
    g = box((2.0, 2.0, 1.0), (2 * n, 2 * n, layers)) if whole else box((1.0, 1.0, 1.0), (n, n, layers))
    plan = g.points[:, :2] if whole else g.points[:, :2] + 0.5
    x, y = _graded(plan, inward).T
    z = height * (1 - _graded(1 - g.points[:, 2], upward))
    plan = radius * np.stack([x * np.sqrt(1 - y * y / 2), y * np.sqrt(1 - x * x / 2)], 1)
    points = np.concatenate([plan, z[:, None]], 1)
    on = np.zeros((len(points), 3), bool)
    on[g.fixed] = True
    if not whole:
        on[:, :2] |= points[:, :2] < 1e-9 * radius
    fixed = np.flatnonzero(on.any(1))
    return Disc(Geometry(points, g.cells, g.cell_type, fixed), on[fixed].astype(float))


def _graded(x, steepness):
    return x if steepness == 0 else np.sinh(steepness * x) / np.sinh(steepness)

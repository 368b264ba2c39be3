"""The column mesh of one site: its fine part moves with the site and is the same on both sides of it.

A fixed mesh prints a saw-tooth of the element's length into the force of a moving probe, and a mesh graded otherwise
on the left than on the right prints a false lateral force. So a core of equal intervals is centred on the site, and
what is left on either side is filled by intervals that grow outwards. Near the rim the core is narrower on that side
alone: a far side drawn in as well would have its few growing intervals reach farther, and be stiffer (by 4 % of the
force, 7 mm from the rim of a top of 180 mm). Node numbers mean the same at every site, so that displacements of
neighbouring sites can be interpolated.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.optimize import brentq

from tissuejax.mesh.columns import Lobe
from tissuejax.recordings.recording import Geometry

GRADING = 2  # changes with the way lines are laid, so that sites kept from before are not taken for today's
INNER = 5 / 8  # share of the intervals on either side that are in the core
CORE, PER_RADIUS = 0.008, 1.7  # m, half-width of the core at least, and at least so many radii
ROOM = 0.75  # of the way to the rim that the core may take


class Grid(NamedTuple):
    """Numbers of elements along s, t and height (the first two even)."""

    counts: tuple[int, int, int]
    radius: float

    @property
    def inner(self) -> tuple[int, int]:
        """Intervals of the core on either side of the site."""
        return tuple(max(2, round(INNER * n / 2)) for n in self.counts[:2])

    def refined(self, factor: float) -> "Grid":
        """With elements smaller by about `factor`."""
        nx, ny, nz = self.counts
        return self._replace(counts=(2 * round(factor * nx / 2), 2 * round(factor * ny / 2), round(factor * nz)))


def half(room: float, core: float, inner: int, outer: int) -> Float[np.ndarray, " k"]:
    """Distances from the site of the lines on one side: `inner` equal intervals, `outer` growing ones up to `room`."""
    h = core / inner
    rest = room - core
    if rest <= outer * h:
        grown = np.full(outer, rest / outer)
    else:
        r = brentq(lambda r: h * sum(r**j for j in range(1, outer + 1)) - rest, 1.0, 1.0 + rest / h)
        grown = h * r ** np.arange(1, outer + 1)
    return np.concatenate([h * np.arange(1, inner + 1), core + np.cumsum(grown)])


def lines(
    lobe: Lobe, place: Float[np.ndarray, "2"], grid: Grid
) -> tuple[Float[np.ndarray, " a"], Float[np.ndarray, " b"]]:
    """Grid lines in the lobe's parameters s and t for a site."""
    q = lobe.parameters_of(np.asarray(place, float))
    found = []
    for axis, (n, inner) in enumerate(zip(grid.counts[:2], grid.inner)):
        metric = np.hypot(*(float(f.ev(*q, dx=1 - axis, dy=axis)) for f in (lobe.x, lobe.y)))
        room = metric * np.array([q[axis], 1 - q[axis]])
        wide = max(CORE, PER_RADIUS * grid.radius)
        left, right = (half(r, min(wide, ROOM * r), inner, n // 2 - inner) / metric for r in room)
        line = np.concatenate([q[axis] - left[::-1], [q[axis]], q[axis] + right])
        line[[0, -1]] = 0, 1
        found.append(line)
    return tuple(found)


def nodes(lobe: Lobe, s, t, layers: int) -> Float[np.ndarray, "a b c 3"]:
    """Node positions on these lines, bottom to top in even layers."""
    x, y, bottom, top = (f(s, t) for f in lobe)
    z = bottom[..., None] + (top - bottom)[..., None] * np.linspace(0, 1, layers + 1)
    return np.stack([np.broadcast_to(x[..., None], z.shape), np.broadcast_to(y[..., None], z.shape), z], -1)


def topology(grid: Grid) -> tuple[Int[np.ndarray, "E 8"], Int[np.ndarray, " F"], Int[np.ndarray, "P 4"]]:
    """Cells, the fixed nodes of the base, and the facets under the probe; the same at every site."""
    nx, ny, nz = grid.counts
    index = np.arange((nx + 1) * (ny + 1) * (nz + 1)).reshape(nx + 1, ny + 1, nz + 1)

    def ring(m):
        return [m[:-1, :-1], m[1:, :-1], m[1:, 1:], m[:-1, 1:]]

    cells = np.stack([v.ravel() for v in (*ring(index[:, :, :-1]), *ring(index[:, :, 1:]))], 1)
    kx, ky = grid.inner
    near = index[nx // 2 - kx : nx // 2 + kx + 1, ny // 2 - ky : ny // 2 + ky + 1, nz]
    patch = np.stack([v.ravel() for v in ring(near)], 1)
    return cells, index[:, :, 0].ravel(), patch


def geometry(lobe: Lobe, place: Float[np.ndarray, "2"], grid: Grid) -> Geometry:
    """The mesh of one site."""
    cells, fixed, _ = topology(grid)
    return Geometry(nodes(lobe, *lines(lobe, place, grid), grid.counts[2]).reshape(-1, 3), cells, "hexahedron", fixed)

"""Relaxation by a memory of stress: isochoric stress over the organ in few modes, each with the material's Prony terms.

A memory of the force is wrong by 5 to 9 % of the peak in a drag, since the tissue under the new place has not relaxed.
The material says S = S_e - sum_k g_k q_k with dq_k/dt = (S_e - q_k) / tau_k at every point. With S_e(p) = sum_m b_m(p)
phi_m on a fixed grid of material points, q_k has the same modes; and by virtual work over the strains E(p) that the
ball makes, the force on the ball is F = -dW/dp + sum_k g_k sum_m q_km de_m/dp, e_m(p) = int phi_m : E(p) dV.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.interpolate import RegularGridInterpolator

from tissuejax.errors import InputError
from tissuejax.mesh.columns import Lobe
from tissuejax.mesh.quality import cell_volumes
from tissuejax.surrogate.cardinal import design, through
from tissuejax.surrogate.modes import Modes, modes
from tissuejax.surrogate.places import Box
from tissuejax.surrogate.ramp import Ramp
from tissuejax.surrogate.site_mesh import CORE, PER_RADIUS, Grid, lines, nodes

TOLERATED, MOST_MODES = 0.01, 64
DOUBLE = np.array([1.0, 1, 1, 2, 2, 2])  # off-diagonal components count twice in S : E
POINTS = 26  # material cells along an axis at most
FINEST = 2e-3  # m between the places of the memory's tables
WIDEST = (
    0.036  # m: `MOST_MODES` modes and `POINTS` cells were tried up to 24 mm; beyond this cells are wider than a contact
)


class Material(NamedTuple):
    """Points fixed in the material: parameters s, t and height share of their centres on a grid, and cell volumes."""

    axes: tuple[Float[np.ndarray, " a"], ...]
    volume: Float[np.ndarray, " n"]


def narrow(box: Box) -> None:
    """Nothing, if the memory of one region holds the box.

    Raises:
        InputError: it is too wide.
    """
    wide = box.high - box.low
    if wide.max() > WIDEST + 1e-9:
        raise InputError(
            f"a box of {1e3 * wide[0]:.0f} x {1e3 * wide[1]:.0f} mm with relaxation: the memory of stress holds "
            f"{1e3 * WIDEST:.0f} mm at most: take --reach {500 * WIDEST:.0f} or less, several files, or no relaxation"
        )


def material(lobe: Lobe, box: Box, grid: Grid) -> Material:
    """A fixed grid, fine wherever the ball may come, coarse beyond."""
    core, finest, found = max(CORE, PER_RADIUS * grid.radius), 1.6e-3, []
    middle = lobe.parameters_of((box.low + box.high) / 2)
    for axis in range(2):
        ends = [(box.low[axis], box.high[axis])[k] for k in (0, 1)]
        place = (box.low + box.high) / 2
        q = []
        for end in ends:
            place[axis] = end
            q.append(lobe.parameters_of(place)[axis])
        metric = np.hypot(*(float(f.ev(*middle, dx=1 - axis, dy=axis)) for f in (lobe.x, lobe.y)))
        low, high = max(0.02, min(q) - core / metric), min(0.98, max(q) + core / metric)
        count = min(POINTS - 6, int(np.ceil((high - low) * metric / finest)))
        fine = np.linspace(low, high, count + 1)
        found.append(np.concatenate([np.linspace(0, low, 4)[:-1], fine, np.linspace(high, 1, 4)[1:]]))
    s, t = found
    corners = nodes(lobe, s, t, grid.counts[2])
    index = np.arange(corners[..., 0].size).reshape(corners.shape[:3])
    ring = lambda m: [m[:-1, :-1], m[1:, :-1], m[1:, 1:], m[:-1, 1:]]  # noqa: E731
    cells = np.stack([v.ravel() for v in (*ring(index[:, :, :-1]), *ring(index[:, :, 1:]))], 1)
    volume = cell_volumes(corners.reshape(-1, 3), cells, "hexahedron")
    heights = np.linspace(0, 1, grid.counts[2] + 1)
    return Material(tuple((a[1:] + a[:-1]) / 2 for a in (s, t, heights)), volume)


def read_off(material: Material, lobe: Lobe, grid: Grid, place, fields: Float[np.ndarray, "k E 6"]):
    """Fields at the centres of a site's elements, (k, E, 6), at the material points, (k, n, 6)."""
    s, t = lines(lobe, place, grid)
    own = [(a[1:] + a[:-1]) / 2 for a in (s, t, np.linspace(0, 1, grid.counts[2] + 1))]
    values = np.moveaxis(fields.reshape(len(fields), *grid.counts, 6), 0, -1)
    wanted = np.stack(np.meshgrid(*material.axes, indexing="ij"), -1).reshape(-1, 3)
    inside = np.clip(wanted, [a[0] for a in own], [a[-1] for a in own])
    return np.moveaxis(RegularGridInterpolator(own, values)(inside), -1, 0)


class Dense(NamedTuple):
    """Places no more than `FINEST` apart, and what interpolates a field of the sites to them, in the mesh that moves.

    Seen from a fixed point of the material the stress under a passing ball changes over the width of the contact, and
    sites that are good enough for the force are too far apart for it. Seen from the ball it hardly changes.
    """

    counts: tuple[int, int]
    places: Float[np.ndarray, "n 2"]
    rows: tuple[Float[np.ndarray, "a m"], Float[np.ndarray, "b p"]]
    ramps: Sequence[Ramp]

    def field(self, name: str) -> Float[np.ndarray, "n k E 6"]:
        """`strain` or `stress` at all places: large, so one at a time."""
        some = np.stack([getattr(r, name) for r in self.ramps]).astype(np.float32)
        at = some.reshape(*(r.shape[1] for r in self.rows), -1)
        return np.einsum("ai,bj,ijk->abk", *self.rows, at, optimize=True).reshape(-1, *some.shape[1:])


def between_sites(box: Box, ramps: Sequence[Ramp]) -> Dense:
    """The places between the sites of a box."""
    counts, rows = [], []
    for n, gap in zip(box.counts, box.spacing):
        counts.append((n - 1) * max(1, int(np.ceil(gap / FINEST - 1e-9))) + 1)
        rows.append((design(np.linspace(0, n - 1, counts[-1]), max(n - 1, 1)) @ through(n)).astype(np.float32))
    places = box._replace(counts=tuple(counts)).sites().reshape(-1, 2)
    return Dense(tuple(counts), places, tuple(rows), ramps)


class Projected(NamedTuple):
    """b (k, M): coefficients of the stress, Pa sqrt(m^3); e (k, M): of the strain, sqrt(m^3); and the modes."""

    stress: Float[np.ndarray, "k M"]
    strain: Float[np.ndarray, "k M"]
    modes: Modes


def projected(material: Material, lobe: Lobe, grid: Grid, dense: Dense, tolerance: float = TOLERATED) -> Projected:
    """All states of all places in stress modes."""
    metric = (material.volume[:, None] * DOUBLE).ravel()

    def rows(name):
        for place, some in zip(dense.places, dense.field(name)):
            yield read_off(material, lobe, grid, place, some).reshape(len(some), -1)

    each = len(dense.ramps[0].depth)
    stress = np.empty((each * len(dense.places), len(metric)), np.float32)  # 130 to 180 MB for 24 x 24 mm
    for i, some in enumerate(rows("stress")):
        stress[each * i : each * (i + 1)] = some
    found = modes(stress, tolerance, MOST_MODES, metric)
    weighted = (found.shapes * metric).T
    found_stress = np.concatenate([stress[i : i + each] @ weighted for i in range(0, len(stress), each)])
    del stress
    return Projected(found_stress, np.concatenate([some @ weighted for some in rows("strain")]), found)

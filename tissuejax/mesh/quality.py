"""Is this mesh fit for a simulation? A report in numbers, and a refusal that names the place."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tissuejax.errors import InputError
from tissuejax.mesh.facets import area_vectors, boundary
from tissuejax.recordings.recording import Geometry

FOOT = 0.002  # share of the surface that a support must hold at least
SMALLEST, LARGEST = 1e-3, 2.0  # m: an organ or specimen outside this has its units wrong
CORNERS = {  # for each corner the three neighbours, right-handed
    "hexahedron": (
        (0, 1, 3, 4), (1, 2, 0, 5), (2, 3, 1, 6), (3, 0, 2, 7), (4, 7, 5, 0), (5, 4, 6, 1), (6, 5, 7, 2), (7, 6, 4, 3)
    ),
    "tetra": ((0, 1, 2, 3),),
}  # fmt: skip


class Quality(NamedTuple):
    """What a mesh is like.

    Attributes:
        n_points, n_cells: counts.
        volume: m^3.
        size: extent of the bounding box, m.
        smallest_edge: m.
        worst_jacobian: smallest scaled corner Jacobian (1 is a cube, 0 is flat) and its cell.
        worst_aspect: largest ratio of longest to shortest edge and its cell.
    """

    n_points: int
    n_cells: int
    volume: float
    size: tuple[float, float, float]
    smallest_edge: float
    worst_jacobian: tuple[float, int]
    worst_aspect: tuple[float, int]

    def __str__(self) -> str:
        x, y, z = (1e3 * s for s in self.size)
        return (
            f"{self.n_cells} cells, {self.n_points} points, {x:.1f} x {y:.1f} x {z:.1f} mm, {1e6 * self.volume:.2f} ml"
            f"; shortest edge {1e3 * self.smallest_edge:.3g} mm; worst scaled Jacobian {self.worst_jacobian[0]:.2f} "
            f"(cell {self.worst_jacobian[1]}); worst aspect {self.worst_aspect[0]:.1f} (cell {self.worst_aspect[1]})"
        )


def corner_jacobians(points: Float[np.ndarray, "N 3"], cells: Int[np.ndarray, "E k"], cell_type: str):
    """Scaled Jacobian (triple product of unit edges) at each corner of each cell."""
    x = np.asarray(points)[cells]
    columns = []
    for a, b, c, d in CORNERS[cell_type]:
        edges = x[:, [b, c, d]] - x[:, [a]]
        lengths = np.linalg.norm(edges, axis=2)
        columns.append(np.linalg.det(edges) / np.maximum(np.prod(lengths, 1), 1e-300))
    return np.stack(columns, 1)


def cell_volumes(points: Float[np.ndarray, "N 3"], cells: Int[np.ndarray, "E k"], cell_type: str):
    """Volume of each cell, m^3, exact: a trilinear hex by 2 x 2 x 2 Gauss points."""
    x = np.asarray(points)[cells]
    if cell_type == "tetra":
        return np.linalg.det(x[:, 1:] - x[:, :1]) / 6
    signs = np.array([[-1, 1, 1, -1, -1, 1, 1, -1], [-1, -1, 1, 1, -1, -1, 1, 1], [-1, -1, -1, -1, 1, 1, 1, 1]])
    total = np.zeros(len(x))
    for place in signs.T / np.sqrt(3):
        one = 1 + place[:, None] * signs
        slopes = signs * np.stack([one[1] * one[2], one[0] * one[2], one[0] * one[1]]) / 8
        total = total + np.linalg.det(np.einsum("ja,eai->eji", slopes, x))
    return total


def quality(geometry: Geometry) -> Quality:
    """Measure a mesh."""
    points, cells = np.asarray(geometry.points), np.asarray(geometry.cells)
    jacobian = corner_jacobians(points, cells, geometry.cell_type).min(1)
    pairs = [(a, b) for a, *rest in CORNERS[geometry.cell_type] for b in rest]
    if geometry.cell_type == "tetra":
        pairs += [(1, 2), (1, 3), (2, 3)]
    edges = np.stack([np.linalg.norm(points[cells[:, a]] - points[cells[:, b]], axis=1) for a, b in pairs], 1)
    wide, deep, high = np.ptp(points, axis=0)
    aspect = edges.max(1) / np.maximum(edges.min(1), 1e-300)
    return Quality(
        len(points),
        len(cells),
        float(cell_volumes(points, cells, geometry.cell_type).sum()),
        (float(wide), float(deep), float(high)),
        float(edges.min()),
        (float(jacobian.min()), int(jacobian.argmin())),
        (float(aspect.max()), int(aspect.argmax())),
    )


def _place(points, index) -> str:
    x, y, z = 1e3 * np.asarray(points)[index].reshape(-1, 3).mean(0)
    return f"({x:.1f}, {y:.1f}, {z:.1f}) mm"


def refuse_bad(geometry: Geometry, needs_support: bool = True, joined: Int[np.ndarray, "J 2"] | None = None) -> Quality:
    """Measure a mesh and refuse one that can't be simulated, with the place.

    Args:
        geometry: points, cells and fixed nodes.
        needs_support: whether the fixed nodes have to hold the body against floating.
        joined: pairs of nodes that something else holds together (faces of a cut), so that they count as one piece.

    Raises:
        InputError: an index out of range, a size that means wrong units, an inverted or flat cell, points in no cell,
            a body in several pieces, no fixed node, or fixed nodes that let the body float or are a mere handful.
    """
    points, cells, fixed = (np.asarray(a) for a in (geometry.points, geometry.cells, geometry.fixed))
    if not len(cells) or cells.min() < 0 or cells.max() >= len(points):
        raise InputError(f"cells name nodes outside 0..{len(points) - 1} (or there are none); check the numbering")
    if not np.isfinite(points).all():
        raise InputError(f"point {int(np.argwhere(~np.isfinite(points))[0, 0])} is not finite; repair the mesh")
    refuse_units(float(np.ptp(points, axis=0).max()))
    worst = corner_jacobians(points, cells, geometry.cell_type)
    bad = np.flatnonzero((worst.min(1) <= 1e-3) | (cell_volumes(points, cells, geometry.cell_type) <= 0))
    if len(bad):
        raise InputError(
            f"{len(bad)} of {len(cells)} cells are inverted or flat, first cell {bad[0]} at "
            f"{_place(points, cells[bad[0]])}; check node order or remesh there"
        )
    lonely = np.setdiff1d(np.arange(len(points)), cells)
    if len(lonely):
        raise InputError(
            f"{len(lonely)} points belong to no cell, first point {lonely[0]} at {_place(points, lonely[:1])}; "
            "remove them"
        )
    pairs = np.stack([np.repeat(cells[:, 0], cells.shape[1] - 1), cells[:, 1:].ravel()], 1)
    pairs = pairs if joined is None else np.concatenate([pairs, joined])
    star = coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=(len(points), len(points)))
    pieces, label = connected_components(star, directed=False)
    if pieces > 1:
        small = np.flatnonzero(label == np.bincount(label).argmin())
        raise InputError(
            f"the mesh is in {pieces} pieces; the smallest has {len(small)} points near {_place(points, small)}; "
            "merge coincident nodes or remove the piece"
        )
    if needs_support:
        _refuse_floating(points, fixed)
        _refuse_handful(geometry, points, fixed)
    return quality(geometry)


def refuse_units(extent: float) -> None:
    """Refuse a body of a size that means wrong units: `extent` in m.

    Raises:
        InputError: it is shorter than `SMALLEST` or longer than `LARGEST`.
    """
    if not SMALLEST <= extent <= LARGEST:
        raise InputError(
            f"the body is {extent:.4g} m long; expected between {SMALLEST} and {LARGEST} m. "
            "Lengths are metres: were millimetres given as metres (or the reverse)?"
        )


def _refuse_handful(geometry: Geometry, points, fixed) -> None:
    """A support must be an area: a body that stands on a few nodes tears there, whatever holds it in reality."""
    facets = boundary(geometry.cells, geometry.cell_type).nodes
    area = np.linalg.norm(area_vectors(points, facets), axis=1)
    on = np.isin(facets, fixed)
    share = float(area[on.all(1)].sum() / area.sum())
    nodes = float(on.any(1).sum() / len(facets))  # held nodes that fill no facet: edges, inner nodes
    if share < FOOT and nodes < 10 * FOOT:
        raise InputError(
            f"the support holds {len(fixed)} of {len(points)} nodes, {share:.2%} of the surface: next to nothing, and "
            "the tissue would tear there. Hold the nodes of the whole area that rests on something: a larger `support` "
            "height, or turn the body so that it lies on its flat side"
        )


def _refuse_floating(points, fixed) -> None:
    if not len(fixed):
        raise InputError("no fixed node: the body would float away; name the nodes that the support holds")
    if fixed.min() < 0 or fixed.max() >= len(points):
        raise InputError(f"fixed nodes outside 0..{len(points) - 1}; check the numbering")
    spread = np.linalg.svd(points[fixed] - points[fixed].mean(0), compute_uv=False)
    if len(fixed) < 3 or spread[1] < 1e-3 * np.ptp(points, axis=0).max():
        raise InputError(
            f"the {len(fixed)} fixed nodes near {_place(points, fixed)} lie on a point or a line, so the body floats "
            "(it can turn); fix at least three nodes that are not in line"
        )

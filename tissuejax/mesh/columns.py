"""Column hexes between a support and a free surface, graded towards probing sites.

A `Lobe` is a smooth map from the unit square to the plan of the organ with a bottom and a top height over it. It comes
from a structured column mesh (this file: its own grid, splined) or from a point cloud (`cloud.py`), and any number of
columns can be cut out of it; a coarse mesh that is fine at the site is the cheap accurate one.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.interpolate import RectBivariateSpline

from tissuejax.errors import InputError
from tissuejax.mesh.facets import boundary
from tissuejax.recordings.recording import Geometry


class Lobe(NamedTuple):
    """Smooth map (s, t) in [0, 1]^2 -> x, y, bottom and top height, each a spline."""

    x: RectBivariateSpline
    y: RectBivariateSpline
    bottom: RectBivariateSpline
    top: RectBivariateSpline

    @classmethod
    def of_grid(cls, s, t, x, y, bottom, top) -> "Lobe":
        """Through the values on a grid of parameters (cubic, or lower for fewer than four lines)."""
        degrees = {"kx": min(3, len(s) - 1), "ky": min(3, len(t) - 1)}
        return cls(*(RectBivariateSpline(s, t, v, **degrees) for v in (x, y, bottom, top)))

    def parameters_of(self, place: Float[np.ndarray, "2"]) -> Float[np.ndarray, "2"]:
        """(s, t) of the column under a place in plan; the nearest column for a place outside."""
        grid = np.linspace(0, 1, 41)
        d = (self.x(grid, grid) - place[0]) ** 2 + (self.y(grid, grid) - place[1]) ** 2
        q = grid[np.array(np.unravel_index(d.argmin(), d.shape))]
        for _ in range(20):
            r = np.array([self.x.ev(*q) - place[0], self.y.ev(*q) - place[1]])
            J = np.array([[f.ev(*q, dx=1), f.ev(*q, dy=1)] for f in (self.x, self.y)])
            q = np.clip(q - np.linalg.lstsq(J, r, rcond=None)[0], 0, 1)
        return q


def lines(
    length: float, n: int, sites: Sequence[float] = (), core: float = 0.0, ratio: float = 1.0
) -> Float[np.ndarray, " n+1"]:
    """n + 1 grid lines over [0, 1], close together near the sites.

    The line density is 1 within `core` of a site and falls to 1 / ratio with distance.

    Args:
        length: physical length of the unit interval, m.
        n: intervals.
        sites: places in [0, 1].
        core: half-width of the fine part, m.
        ratio: far spacing over near spacing; 1 is uniform.
    """
    if not len(sites) or ratio == 1:
        return np.linspace(0, 1, n + 1)
    fine = np.linspace(0, 1, 4001)
    away = np.min([np.abs(fine - s) for s in sites], axis=0) * length
    reach = max(length / 2 - core, core)
    density = 1 / (1 + (ratio - 1) * np.clip((away - core) / reach, 0, 1))
    total = np.concatenate([[0], np.cumsum((density[1:] + density[:-1]) / 2)])
    out = np.interp(np.linspace(0, total[-1], n + 1), total, fine)
    out[[0, -1]] = 0, 1
    return out


def columns(
    lobe: Lobe,
    counts: tuple[int, int, int],
    sites: Sequence[Float[np.ndarray, "2"]] = (),
    core: float = 0.008,
    ratio: float = 3.0,
    upward: float = 1.0,
) -> Geometry:
    """Column hexes of a lobe; the nodes of the lowest layer are fixed.

    Keep elements that bend about as long as high: one plain hex through the height of a slender beam gives 96 % of the
    deflection as a cube, 32 % twice as long, 6 % five times as long; `build.Numerics(element="hexahedron-bending")`
    gives 99, 97 and 90 % (`tests/tled/test_bending.py`).

    Args:
        lobe: the map.
        counts: elements along s, t and height.
        sites: places in plan that get the fine columns, m.
        core: half-width of the fine part, m.
        ratio: far over near spacing.
        upward: bottom over top layer thickness (over 1: fine under the free surface).

    Raises:
        InputError: fewer than two elements along an axis.
    """
    if min(counts) < 2:
        raise InputError(f"column mesh {counts}: at least two elements along each axis; raise the counts")
    nx, ny, nz = counts
    near = [lobe.parameters_of(np.asarray(site[:2], float)) for site in sites]
    mid = np.linspace(0, 1, 101)
    length_s = np.hypot(np.diff(lobe.x(mid, [0.5])[:, 0]), np.diff(lobe.y(mid, [0.5])[:, 0])).sum()
    length_t = np.hypot(np.diff(lobe.x([0.5], mid)[0]), np.diff(lobe.y([0.5], mid)[0])).sum()
    s = lines(length_s, nx, [q[0] for q in near], core, ratio)
    t = lines(length_t, ny, [q[1] for q in near], core, ratio)
    layers = np.concatenate([[0], np.cumsum(np.geomspace(upward, 1, nz))])
    zeta = layers / layers[-1]
    x, y, bottom, top = (f(s, t) for f in lobe)
    z = bottom[..., None] + (top - bottom)[..., None] * zeta
    points = np.stack([np.broadcast_to(x[..., None], z.shape), np.broadcast_to(y[..., None], z.shape), z], -1)
    index = np.arange(z.size).reshape(z.shape)
    return Geometry(points.reshape(-1, 3), _hexes(index), "hexahedron", index[:, :, 0].ravel())


def _hexes(index: Int[np.ndarray, "a b c"]) -> Int[np.ndarray, "E 8"]:
    """Cells of a structured block of node numbers, meshio order."""
    lower, upper = index[:, :, :-1], index[:, :, 1:]
    ring = lambda m: [m[:-1, :-1], m[1:, :-1], m[1:, 1:], m[:-1, 1:]]  # noqa: E731
    return np.stack([v.ravel() for v in (*ring(lower), *ring(upper))], 1)


def box(size: tuple[float, float, float], counts: tuple[int, int, int]) -> Geometry:
    """A box of hexes standing on z = 0, centred in plan, its base fixed."""
    axes = [
        np.linspace(-size[0] / 2, size[0] / 2, counts[0] + 1),
        np.linspace(-size[1] / 2, size[1] / 2, counts[1] + 1),
    ]
    x, y, z = np.meshgrid(*axes, np.linspace(0, size[2], counts[2] + 1), indexing="ij")
    index = np.arange(x.size).reshape(x.shape)
    return Geometry(np.stack([x, y, z], -1).reshape(-1, 3), _hexes(index), "hexahedron", index[:, :, 0].ravel())


def lobe_of_mesh(geometry: Geometry) -> Lobe:
    """The map behind a structured column mesh of hexes (columns along z, a rectangle of columns in topology).

    Raises:
        InputError: tets, cells that don't stack in columns, or columns that don't form a rectangular grid.
    """
    if geometry.cell_type != "hexahedron":
        raise InputError(
            "regrading follows columns of hexes; this mesh has tets: take `cloud.lobe_of_cloud` on its surface"
        )
    points, cells = np.asarray(geometry.points), np.asarray(geometry.cells)
    cells = _standing(points, cells)
    above = np.full(len(points), -1)
    above[cells[:, :4]] = cells[:, 4:]
    is_top = np.zeros(len(points), bool)
    is_top[cells[:, 4:]] = True
    quads = cells[~is_top[cells[:, :4]].any(1)][:, :4]
    grid = _grid(quads)
    bottom = grid.copy()
    top = grid.copy()
    for _ in range(len(points)):
        up = above[top]
        if (up < 0).all():
            break
        if (up < 0).any():
            raise InputError(
                "columns of different height in one mesh; regrading needs the same number of layers everywhere"
            )
        top = up
    if grid.size != len(np.unique(cells[:, :4][~is_top[cells[:, :4]]])):
        raise InputError("the columns don't form one rectangular grid; give a mesh size instead, made from the surface")
    s, t = np.linspace(0, 1, grid.shape[0]), np.linspace(0, 1, grid.shape[1])
    # columns may lean: x and y are those of the top, where the probe is
    return Lobe.of_grid(s, t, points[top, 0], points[top, 1], points[bottom, 2], points[top, 2])


def _standing(points, cells):
    """Cells renumbered so that their third local axis is the one along z, upwards."""
    turns = np.array([[0, 1, 2, 3, 4, 5, 6, 7], [0, 3, 7, 4, 1, 2, 6, 5], [0, 4, 5, 1, 3, 7, 6, 2]])
    turns = np.concatenate([turns, turns[:, [4, 7, 6, 5, 0, 3, 2, 1]]])  # and upside down
    x = points[cells]
    edges = np.stack([x[:, o[4:]] - x[:, o[:4]] for o in turns], 1)
    rise = (edges[..., 2] / np.linalg.norm(edges, axis=-1)).min(2)  # how upright, not how tall: the rim is steep
    best = rise.argmax(1)
    if (np.take_along_axis(rise, best[:, None], 1) <= 0).any():
        raise InputError(
            "some cells have no upward axis, so they don't stack in columns; give a column mesh or a point cloud"
        )
    return np.take_along_axis(cells, turns[best], 1)


def _grid(quads: Int[np.ndarray, "Q 4"]) -> Int[np.ndarray, "a b"]:
    """Node numbers of a rectangular patch of quads as an array, by walking across shared edges."""
    by_edge: dict[frozenset, list[int]] = {}
    for q, nodes in enumerate(quads):
        for a, b in zip(nodes, np.roll(nodes, -1)):
            by_edge.setdefault(frozenset((int(a), int(b))), []).append(q)
    place = dict(zip((int(n) for n in quads[0]), ((0, 0), (1, 0), (1, 1), (0, 1))))
    queue, done = [0], {0}
    while queue:
        q = queue.pop()
        ring = [int(n) for n in quads[q]]
        for k in range(4):
            a, b, c = ring[k], ring[(k + 1) % 4], ring[(k + 2) % 4]
            for other in by_edge[frozenset((a, b))]:
                if other in done:
                    continue
                away = np.subtract(place[b], place[c])
                nodes = [int(n) for n in quads[other]]
                i = nodes.index(b)
                beyond_b, beyond_a = (
                    (nodes[(i + 1) % 4], nodes[(i + 2) % 4])
                    if nodes[(i - 1) % 4] == a
                    else (nodes[(i - 1) % 4], nodes[(i - 2) % 4])
                )
                for node, near in ((beyond_b, b), (beyond_a, a)):
                    across, along = np.add(place[near], away)
                    spot = int(across), int(along)
                    if place.setdefault(node, spot) != spot:
                        raise InputError(
                            f"the columns don't form a rectangular grid (around node {node}); use the surface"
                        )
                done.add(other)
                queue.append(other)
    where = np.array(list(place.values()))
    where = where - where.min(0)
    grid = np.full(where.max(0) + 1, -1)
    grid[where[:, 0], where[:, 1]] = list(place)
    if (grid < 0).any():
        raise InputError("the columns don't form a full rectangle; give a mesh size instead, made from the surface")
    return grid


def top_of(geometry: Geometry) -> Float[np.ndarray, "S 3"]:
    """Points of the boundary that are not fixed: a cloud of the free surface."""
    nodes = np.setdiff1d(np.unique(boundary(geometry.cells, geometry.cell_type).nodes), geometry.fixed)
    return np.asarray(geometry.points)[nodes]

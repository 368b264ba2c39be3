"""Cut a mesh open along element faces: nodes on the cut are doubled, beyond its end the body stays whole.

A node is doubled where the cells around it fall apart once no cell is joined to another through a face of the cut. So
the end of a blind cut, where one can still walk around from cell to cell, keeps its nodes; nothing else decides.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from tissuejax.errors import InputError
from tissuejax.mesh.facets import FACES
from tissuejax.recordings.recording import Geometry

ON = 1e-4  # a node lies on the cut if it is off it by less than this share of the shortest edge there


class Split(NamedTuple):
    """A mesh with doubled nodes, and the two sides of the cut.

    Attributes:
        geometry: with the nodes of the plus side where the body was cut last in `points`; `fixed` has the copies too.
        minus, plus: nodes of each face as seen from either side, corner by corner the same place.
        origin: for each node, the node of the whole mesh that it was.
    """

    geometry: Geometry
    minus: Int[np.ndarray, "P v"]
    plus: Int[np.ndarray, "P v"]
    origin: Int[np.ndarray, " N"]


def split(
    geometry: Geometry,
    side: Callable[[Float[np.ndarray, "m 3"]], Float[np.ndarray, " m"]],
    within: Callable[[Float[np.ndarray, "m 3"]], Bool[np.ndarray, " m"]] | None = None,
) -> Split:
    """Split a mesh along a surface that follows its element faces.

    Args:
        geometry: hexes or tets.
        side: signed distance from the surface, m; positive on the plus side.
        within: which faces take part, by their middles (a blind cut); all of the surface by default.

    Raises:
        InputError: no face lies on the surface: a cut path off the element faces.
    """
    points, cells = np.asarray(geometry.points, float), np.asarray(geometry.cells)
    faces = np.asarray(FACES[geometry.cell_type])
    corner = cells[:, faces]  # (E, f, v)
    distance = np.asarray(side(points))
    edge = np.linalg.norm(points[corner[:, 0, 0]] - points[corner[:, 0, 1]], axis=1).min()
    on = np.abs(distance) < ON * edge
    owner, local = np.nonzero(on[corner].all(2))
    found = corner[owner, local]
    key = np.sort(found, 1)
    _, first, back, counts = np.unique(key, axis=0, return_index=True, return_inverse=True, return_counts=True)
    inner = counts == 2
    if inner.any() and within is not None:
        inner &= np.asarray(within(points[found[first]].mean(1)), bool)
    if not inner.any():
        raise InputError(_off(points, cells, distance, on, counts, within is not None))
    pairs = np.array([np.flatnonzero(back.ravel() == k) for k in np.flatnonzero(inner)])
    a, b = owner[pairs[:, 0]], owner[pairs[:, 1]]
    high = np.asarray(side(points[cells].mean(1)))
    swap = high[a] > high[b]
    lower, upper = np.where(swap, b, a), np.where(swap, a, b)
    face = found[pairs[np.arange(len(pairs)), swap.astype(int)]]  # as the minus cell has it: normal towards plus
    new, origin = _doubled(cells, faces, face, upper, len(points))
    doubled = np.flatnonzero(np.isin(origin[len(points) :], geometry.fixed)) + len(points)
    fixed = np.concatenate([np.asarray(geometry.fixed), doubled])
    minus, plus = (_seen_from(cells, new, own, face) for own in (lower, upper))
    made = Geometry(points[origin], new, geometry.cell_type, fixed, geometry.surface_points)
    return Split(made, minus, plus, origin)


def _seen_from(cells, new, own, face):
    """Nodes of each face as its cell has them after the doubling."""
    corner = (cells[own][:, :, None] == face[:, None, :]).argmax(1)
    return np.take_along_axis(new[own], corner, 1)


def _doubled(cells, faces, face, upper, count):
    """New cells, and the old node of each new one."""
    cut = {tuple(sorted(f)) for f in face.tolist()}
    touched = np.unique(face)
    around: dict[int, list[int]] = {int(n): [] for n in touched}
    near = np.flatnonzero(np.isin(cells, touched).any(1))
    joined: dict[tuple, list[int]] = {}
    for c in near.tolist():
        for n in cells[c].tolist():
            if n in around:
                around[n].append(c)
        for f in cells[c][faces].tolist():
            joined.setdefault(tuple(sorted(f)), []).append(c)
    above = set(upper.tolist())
    new, origin = cells.copy(), list(range(count))
    links = [(f, both) for f, both in joined.items() if len(both) == 2 and f not in cut]
    by_node: dict[int, list[tuple[int, int]]] = {}
    for f, (c, d) in links:
        for n in f:
            if n in around:
                by_node.setdefault(n, []).append((c, d))
    for n, mine in around.items():
        groups = _groups(mine, by_node.get(n, []))
        # the group without a cell of the plus side keeps the node
        groups.sort(key=lambda g: bool(g & above))
        for group in groups[1:]:
            for c in group:
                new[c][cells[c] == n] = len(origin)
            origin.append(n)
    return new, np.array(origin)


def _groups(mine: list[int], links: list[tuple[int, int]]) -> list[set[int]]:
    """Cells in sets that hang together by links."""
    of = {c: {c} for c in mine}
    for c, d in links:
        if of[c] is not of[d]:
            both = of[c] | of[d]
            for e in both:
                of[e] = both
    return list({id(g): g for g in of.values()}.values())


def _off(points, cells, distance, on, counts, blind) -> str:
    if len(counts) and (counts == 2).any() and blind:
        return "the cut: faces lie on its surface but none within its bounds; deepen the cut or check its frame"
    sizes = distance[cells]
    crossed = int(((sizes.min(1) < 0) & (sizes.max(1) > 0) & ~on[cells].any(1)).sum())
    near = 1e3 * np.abs(distance).min()
    return (
        f"the cut path lies off the element faces: {int(on.sum())} nodes are on it, the nearest other is {near:.3g} mm "
        f"off and {crossed} elements are crossed in their middle. A cut follows faces: make the mesh with a line of "
        "nodes on the path, or move the path"
    )

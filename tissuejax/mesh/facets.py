"""The surface of a volume mesh: boundary facets turned outwards, their areas, normals and the cells behind them."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from tissuejax.errors import InputError

FACES = {
    "hexahedron": ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
    "tetra": ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)),
}


class Facets(NamedTuple):
    """Boundary facets, nodes counter-clockwise seen from outside.

    Attributes:
        nodes: node indices, 4 a facet for hexes and 3 for tets.
        cells: the cell behind each facet.
    """

    nodes: Int[np.ndarray, "S v"]
    cells: Int[np.ndarray, " S"]


def boundary(cells: Int[np.ndarray, "E k"], cell_type: str) -> Facets:
    """Facets that belong to one cell only.

    Raises:
        InputError: a cell type other than hexahedron or tetra, or a facet shared by more than two cells.
    """
    if cell_type not in FACES:
        raise InputError(f"cell type {cell_type!r}: facets are known for {', '.join(FACES)}; convert the mesh")
    faces = np.asarray(FACES[cell_type])
    nodes = np.asarray(cells)[:, faces].reshape(-1, faces.shape[1])
    owner = np.repeat(np.arange(len(cells)), len(faces))
    _, first, counts = np.unique(np.sort(nodes, 1), axis=0, return_index=True, return_counts=True)
    if (counts > 2).any():
        bad = nodes[first[counts > 2][0]]
        raise InputError(f"facet with nodes {bad.tolist()} belongs to more than two cells; repair the mesh there")
    keep = np.sort(first[counts == 1])
    return Facets(nodes[keep], owner[keep])


def area_vectors(points: Float[np.ndarray, "N 3"], nodes: Int[np.ndarray, "S v"]) -> Float[np.ndarray, "S 3"]:
    """Outward normal times area of each facet, m^2 (half the cross product of the diagonals for quads)."""
    x = np.asarray(points)[nodes]
    if nodes.shape[1] == 4:
        return 0.5 * np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])
    return 0.5 * np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])


def facing_up(points: Float[np.ndarray, "N 3"], facets: Facets, least: float = 0.2) -> Facets:
    """The facets whose outward normal has a z component of at least `least`: where a probe along -z can touch."""
    normal = area_vectors(points, facets.nodes)
    keep = normal[:, 2] >= least * np.linalg.norm(normal, axis=1)
    return Facets(facets.nodes[keep], facets.cells[keep])


def triangles(nodes: Int[np.ndarray, "S v"]) -> Int[np.ndarray, "T 3"]:
    """Facets as triangles; a quad becomes two."""
    if nodes.shape[1] == 3:
        return nodes
    return np.concatenate([nodes[:, [0, 1, 2]], nodes[:, [0, 2, 3]]])

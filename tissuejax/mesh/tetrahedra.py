"""Tets inside a closed surface, through the fTetWild generator (`pytetwild`, MPL-2.0)."""

import contextlib
import tempfile

import numpy as np
import trimesh

from tissuejax.errors import InputError
from tissuejax.recordings.recording import Geometry


def fill(surface: trimesh.Trimesh, edge: float, support: float = 1e-4) -> Geometry:
    """A tet mesh of the inside of a closed surface.

    Args:
        surface: watertight triangles, m.
        edge: target edge length, m.
        support: nodes at most this far above the lowest point are held, m.

    Raises:
        InputError: a surface with holes (their number and the first place), or no tets inside.
    """
    import pytetwild  # a compiled generator, needed here only

    if not surface.is_watertight:
        edges = surface.edges_sorted
        _, first, counts = np.unique(edges, axis=0, return_index=True, return_counts=True)
        open_edges = edges[first[counts == 1]]
        where = 1e3 * surface.vertices[open_edges[0]].mean(0) if len(open_edges) else np.zeros(3)
        raise InputError(
            f"the surface is not closed: {len(open_edges)} open edges, first near {np.round(where, 1).tolist()} mm; "
            "fill the holes (trimesh.repair.fill_holes) or mesh the organ by columns"
        )
    diagonal = float(np.linalg.norm(surface.extents))
    # the generator leaves its working surface in the current folder, which is the user's
    with tempfile.TemporaryDirectory() as scratch, contextlib.chdir(scratch):
        points, cells = pytetwild.tetrahedralize(
            np.asarray(surface.vertices),
            np.asarray(surface.faces, np.int32),
            edge_length_fac=edge / diagonal,
            optimize=True,
        )[:2]
    points, cells = np.asarray(points, float), np.asarray(cells, int)
    if not len(cells):
        raise InputError(
            f"no tets came out at edge {edge} m; the surface may be turned inside out or the edge too long"
        )
    x = points[cells]
    turned = np.linalg.det(x[:, 1:] - x[:, :1]) < 0
    cells[turned] = cells[turned][:, [0, 2, 1, 3]]
    used, cells = np.unique(cells, return_inverse=True)
    points = points[used]
    return Geometry(points, cells.reshape(-1, 4), "tetra", np.flatnonzero(points[:, 2] <= points[:, 2].min() + support))

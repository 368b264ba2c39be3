"""Volume meshes in and out through meshio, surfaces through trimesh."""

from pathlib import Path

import meshio
import numpy as np
import trimesh

from tissuejax.errors import InputError
from tissuejax.mesh.facets import boundary, triangles
from tissuejax.recordings.recording import Geometry


def read_mesh(path: str | Path, scale: float = 1.0, support: float | None = None) -> Geometry:
    """A volume mesh from any format meshio knows.

    Args:
        path: the file.
        scale: metres per unit of the file (1e-3 for millimetres).
        support: nodes at most this far above the lowest point are held, m; None takes a point set named "fixed".

    Raises:
        InputError: an unreadable file, a surface (with the way to fill it), no hexes or tets in it, or both at once.
    """
    try:
        mesh = meshio.read(path)
    except (Exception, SystemExit) as error:  # meshio leaves by SystemExit on an unknown suffix
        raise InputError(
            f"{path}: meshio can't read it ({error}); give one of its formats (vtu, msh, inp, ...)"
        ) from error
    kinds = [k for k in ("hexahedron", "tetra") if k in mesh.cells_dict]
    if not kinds and {"triangle", "quad"} & set(mesh.cells_dict):
        raise InputError(
            f"{path}: holds a surface ({', '.join(sorted(mesh.cells_dict))}), and a simulation needs its inside in "
            f"hexes or tets. Fill it: surface = trimesh.load({str(path)!r}), surface.apply_scale(1e-3) if that is in "
            "millimetres, then tissuejax.mesh.tetrahedra.fill(surface, edge=0.005, support=0.002)"
        )
    if len(kinds) != 1:
        raise InputError(
            f"{path}: holds {sorted(mesh.cells_dict)}; expected either hexahedron or tetra cells; convert it"
        )
    points = scale * np.asarray(mesh.points, float)
    if support is not None:
        fixed = np.flatnonzero(points[:, 2] <= points[:, 2].min() + support)
    elif "fixed" in mesh.point_data:
        fixed = np.flatnonzero(np.asarray(mesh.point_data["fixed"]).ravel())
    else:
        fixed = np.asarray(mesh.point_sets.get("fixed", []), int)
    return Geometry(points, np.asarray(mesh.cells_dict[kinds[0]], int), kinds[0], fixed)


def write_mesh(geometry: Geometry, path: str | Path, point_data=None, cell_data=None) -> None:
    """A volume mesh to any format meshio knows, fixed nodes as the point field "fixed"."""
    held = np.zeros(len(geometry.points))
    held[np.asarray(geometry.fixed, int)] = 1
    meshio.Mesh(
        np.asarray(geometry.points),
        [(geometry.cell_type, np.asarray(geometry.cells))],
        point_data={"fixed": held, **(point_data or {})},
        cell_data={k: [v] for k, v in (cell_data or {}).items()},
    ).write(path)


def surface_of(geometry: Geometry) -> trimesh.Trimesh:
    """The boundary as a trimesh, for its queries (closest point, inside or outside, watertight)."""
    faces = triangles(boundary(geometry.cells, geometry.cell_type).nodes)
    return trimesh.Trimesh(np.asarray(geometry.points), faces, process=False)

"""The body of a probing from what a lab has: a closed surface, a point cloud, a solid mesh, or the sizes of a slab.

The `[body]` table of a probing side file, `probing_files`. Lengths are in `unit`; z points up, away from the support.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float

from tissuejax.errors import InputError, unknown
from tissuejax.mesh.cloud import lobe_of_cloud
from tissuejax.mesh.columns import box, columns
from tissuejax.mesh.files import read_mesh
from tissuejax.mesh.tetrahedra import fill
from tissuejax.recordings.exports.export import from_text
from tissuejax.recordings.exports.meanings import bare, split_unit
from tissuejax.recordings.places import resolve
from tissuejax.recordings.recording import Geometry
from tissuejax.units import factor, quantity

BODY_KEYS = ("surface", "cloud", "mesh", "slab", "unit", "edge", "thickness", "support", "width")
KINDS = BODY_KEYS[:4]


def body(table: Mapping[str, Any], side: Path) -> tuple[Geometry, list[str], float]:
    """The body that a `[body]` table describes, standing on z = 0, sentences on how it was made, and how far the file's
    frame was lifted for that, m.

    Args:
        table: one of `surface` (STL, PLY, OBJ; closed), `cloud` (PLY, or text of x y z), `mesh` (any format of meshio)
            or `slab` (its height); `unit` of the file's lengths; `edge` of the elements; `thickness` of the tissue
            under a cloud's highest point; `width` of a slab; `support`: nodes this near to the lowest are held.
        side: the side file, for paths and messages.

    Raises:
        InputError: no kind or two, an unknown key, no unit, a surface with holes, a cloud with fewer than 30 points.
    """
    for key in table:
        if key not in BODY_KEYS:
            raise unknown("key in [body]", key, BODY_KEYS)
    kinds = [k for k in KINDS if k in table]
    if len(kinds) != 1:
        came = " and ".join(kinds) or "nothing"
        raise InputError(f"body: found {came}, expected exactly one of {', '.join(KINDS)}")
    kind = kinds[0]
    if kind == "slab":
        return *_slab(table), 0.0
    if "unit" not in table:
        raise InputError(f'body.unit: found nothing, expected the unit of the lengths in the {kind}, e.g. unit = "mm"')
    scale = factor(str(table["unit"]), "m")
    path = resolve(str(table[kind]), side)
    support = quantity(table.get("support", "0.1 mm"), "m", "body.support")
    if kind == "mesh":
        found = read_mesh(path, scale, support if "support" in table else None)
        if not len(found.fixed):
            raise InputError(f'{path}: no node is held: give body.support, e.g. support = "0.5 mm"')
        lowest = found.points[:, 2].min()
        return _lifted(found, -lowest), [f"Body: {len(found.cells)} cells of {path.name}."], -lowest
    edge = quantity(table["edge"], "m", "body.edge") if "edge" in table else None
    if kind == "surface":
        surface = _surface(path)
        surface.apply_scale(scale)
        edge = edge or float(np.max(surface.extents)) / 12
        made = fill(surface, edge, support)
        lift = -float(surface.bounds[0, 2])
        across = f"{1e3 * np.max(surface.extents):.1f} mm across"
        note = f"Body: {path.name} ({across}) filled with {len(made.cells)} tetrahedra of about {1e3 * edge:.1f} mm."
        return _lifted(made, lift), [note], lift
    return _from_cloud(path, scale, table, edge)


def _slab(table: Mapping[str, Any]) -> tuple[Geometry, list[str]]:
    height = quantity(table["slab"], "m", "body.slab")
    width = quantity(table["width"], "m", "body.width") if "width" in table else 6 * height
    edge = quantity(table["edge"], "m", "body.edge") if "edge" in table else height / 6
    if not min(height, width, edge) > 0:
        raise InputError("body: slab, width and edge must be above zero")
    across, up = max(4, round(width / edge)), max(3, round(height / edge))
    if across * across * up > 60_000:
        raise InputError(f"body: {across} x {across} x {up} elements; give a larger edge or a smaller width")
    made = box((width, width, height), (across, across, up))
    return made, [f"Body: a slab of {1e3 * height:.1f} mm, {1e3 * width:.0f} mm wide, held below."]


def _surface(path: Path) -> trimesh.Trimesh:
    try:
        found = trimesh.load(path, force="mesh")
    except Exception as error:  # trimesh's readers raise many kinds
        raise InputError(f"{path}: found a surface that can't be read ({error}), expected STL, PLY or OBJ") from error
    if not isinstance(found, trimesh.Trimesh) or not len(found.faces):
        raise InputError(f"{path}: found no triangles, expected a closed surface; points alone go into body.cloud")
    found.merge_vertices()
    return found


def _from_cloud(
    path: Path, scale: float, table: Mapping[str, Any], edge: float | None
) -> tuple[Geometry, list[str], float]:
    cloud, lift = scale * _points(path), 0.0
    if "thickness" in table:
        lift = quantity(table["thickness"], "m", "body.thickness") - float(cloud[:, 2].max())
        cloud[:, 2] += lift
    lobe = lobe_of_cloud(cloud)
    span, height = float(np.ptp(cloud[:, :2], axis=0).max()), float(cloud[:, 2].max())
    edge = edge or span / 14
    counts = (max(4, round(span / edge)), max(4, round(span / edge)), max(3, round(height / edge)))
    made = columns(lobe, counts)
    cells = f"{counts[0]} x {counts[1]} x {counts[2]}"
    return (
        Geometry(made.points, made.cells, made.cell_type, made.fixed, cloud),
        [f"Body: {cells} columns under the {len(cloud)} points of {path.name}, {1e3 * height:.1f} mm high."],
        lift,
    )


def _points(path: Path) -> Float[np.ndarray, "S 3"]:
    if path.suffix.lower() in (".ply", ".stl", ".obj", ".off"):
        try:
            return np.array(trimesh.load(path).vertices, float)  # pyright: ignore[reportAttributeAccessIssue]: clouds and meshes
        except Exception as error:  # as above
            raise InputError(f"{path}: found points that can't be read ({error})") from error
    found = from_text(path)
    names = {bare(split_unit(n)[0]): n for n in found.columns.cells}
    chosen = [names[a] for a in "xyz"] if set("xyz") <= names.keys() else list(found.columns.cells)[:3]
    if len(chosen) < 3:
        raise InputError(f"{path}: found {len(chosen)} columns, expected x, y and z")
    return np.stack([found.columns.numbers(n) for n in chosen], axis=1)


def _lifted(made: Geometry, lift: float) -> Geometry:
    """The same body, standing on z = 0 as recordings have it."""
    if lift == 0:
        return made
    points = np.asarray(made.points) + [0.0, 0.0, lift]
    return Geometry(points, made.cells, made.cell_type, made.fixed, made.surface_points)

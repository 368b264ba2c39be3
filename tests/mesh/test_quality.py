"""Bad meshes are refused with the place; tets fill a closed surface."""

import equinox as eqx
import numpy as np
import pytest
import trimesh

from tissuejax.errors import InputError
from tissuejax.mesh.columns import box
from tissuejax.mesh.files import read_mesh
from tissuejax.mesh.quality import quality, refuse_bad
from tissuejax.mesh.tetrahedra import fill
from tissuejax.recordings.recording import Geometry

GOOD = box((0.04, 0.03, 0.02), (4, 3, 2))


def changed(**what) -> Geometry:
    return eqx.tree_at(lambda g: [getattr(g, k) for k in what], GOOD, list(what.values()))


def test_good_box_is_accepted_with_its_numbers():
    q = refuse_bad(GOOD)
    assert q.worst_jacobian[0] == pytest.approx(1)
    assert q.worst_aspect[0] == pytest.approx(1)
    assert "24 cells" in str(q)


def inverted():
    cells = GOOD.cells.copy()
    cells[5] = cells[5][[4, 5, 6, 7, 0, 1, 2, 3]]
    return changed(cells=cells)


def two_pieces():
    return Geometry(
        np.concatenate([GOOD.points, GOOD.points + [0.1, 0, 0]]),
        np.concatenate([GOOD.cells, GOOD.cells + len(GOOD.points)]),
        "hexahedron",
        GOOD.fixed,
    )


@pytest.mark.parametrize(
    ("mesh", "says"),
    [
        (inverted(), r"1 of 24 cells are inverted or flat, first cell 5 at \("),
        (two_pieces(), "2 pieces; the smallest has 60 points near"),
        (changed(points=np.concatenate([GOOD.points, [[0.0, 0.0, 0.05]]])), r"first point 60 at \(0.0, 0.0, 50.0\) mm"),
        (changed(points=1e3 * GOOD.points), "millimetres"),
        (changed(points=1e-3 * GOOD.points), "metres"),
        (changed(fixed=np.array([], int)), "no fixed node"),
        (changed(fixed=GOOD.fixed[:1]), "floats"),
        (changed(fixed=GOOD.fixed[:3] * 0 + GOOD.fixed[[0, 1, 2]]), "floats"),
        (changed(fixed=np.array([0, 1, 999])), "outside 0..59"),
        (changed(cells=GOOD.cells + 30), "outside 0..59"),
    ],
)
def test_bad_meshes_are_refused_with_the_place(mesh, says):
    with pytest.raises(InputError, match=says):
        refuse_bad(mesh)


def test_tets_fill_a_sphere():
    sphere = trimesh.creation.icosphere(subdivisions=2, radius=0.02)
    g = fill(sphere, edge=0.006)
    q = quality(g)
    assert g.cell_type == "tetra"
    assert q.volume == pytest.approx(sphere.volume, rel=0.03)
    assert q.worst_jacobian[0] > 0.05


def test_open_surface_is_refused():
    sphere = trimesh.creation.icosphere(subdivisions=1, radius=0.02)
    sphere.update_faces(np.arange(len(sphere.faces)) > 0)
    with pytest.raises(InputError, match="not closed: 3 open edges"):
        fill(sphere, edge=0.006)


def test_a_surface_in_other_units_is_refused_before_it_is_meshed():
    with pytest.raises(InputError, match="6.4 m long; expected between"):
        fill(trimesh.creation.icosphere(subdivisions=1, radius=3.2), edge=0.5)


def test_a_surface_mesh_leads_to_the_way_to_fill_it(tmp_path):
    path = tmp_path / "organ.stl"
    trimesh.creation.icosphere(subdivisions=1, radius=0.02).export(path)
    with pytest.raises(InputError, match=r"holds a surface \(triangle\).* tissuejax.mesh.tetrahedra.fill\(surface"):
        read_mesh(path)


def test_a_support_of_a_handful_of_nodes_is_refused():
    g = box((0.04, 0.04, 0.02), (20, 20, 4))
    few = g.fixed[[0, 1, 21]]
    with pytest.raises(InputError, match=r"holds 3 of 2205 nodes, 0.00% of the surface: next to nothing"):
        refuse_bad(Geometry(g.points, g.cells, g.cell_type, few))

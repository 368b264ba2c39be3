"""Splitting a mesh along element faces."""

import numpy as np
import pytest

from tests.tled.cases import tets
from tissuejax.errors import InputError
from tissuejax.mesh.columns import box
from tissuejax.mesh.facets import area_vectors, boundary
from tissuejax.mesh.quality import cell_volumes, refuse_bad
from tissuejax.mesh.split import split


def middle(p):
    return p[:, 1]


@pytest.mark.parametrize("kind", ["hexahedron", "tetra"])
def test_both_sides_and_their_area(kind):
    g = box((0.03, 0.02, 0.01), (6, 4, 3))
    g = tets(g) if kind == "tetra" else g
    cut = split(g, middle)
    np.testing.assert_array_equal(cut.geometry.points[cut.minus], cut.geometry.points[cut.plus])
    assert not np.intersect1d(cut.minus, cut.plus).size
    vectors = area_vectors(cut.geometry.points, cut.minus)
    np.testing.assert_allclose(vectors.sum(0), [0, 0.03 * 0.01, 0], atol=1e-15)  # normal from minus to plus
    volume = cell_volumes(cut.geometry.points, cut.geometry.cells, kind)
    assert volume.sum() == pytest.approx(0.03 * 0.02 * 0.01)
    assert (volume > 0).all()
    low = cut.geometry.points[cut.geometry.cells].mean(1)[:, 1] < 0
    assert not np.intersect1d(cut.geometry.cells[low], cut.plus).size
    fixed = cut.geometry.points[cut.geometry.fixed]
    assert (fixed[:, 2] == 0).all()
    assert len(cut.geometry.fixed) == len(g.fixed) + 7
    with pytest.raises(InputError, match="2 pieces"):
        refuse_bad(cut.geometry)
    refuse_bad(cut.geometry, joined=np.stack([cut.minus.ravel(), cut.plus.ravel()], 1))


@pytest.mark.parametrize("kind", ["hexahedron", "tetra"])
def test_a_blind_cut_stays_whole_beyond_its_depth(kind):
    g = box((0.03, 0.02, 0.012), (6, 4, 4))
    g = tets(g) if kind == "tetra" else g
    cut = split(g, middle, lambda p: p[:, 2] > 0.006)
    refuse_bad(cut.geometry)
    doubled = cut.geometry.points[len(g.points) :]
    assert len(doubled) == 7 * 2  # two upper rows of nodes; the row at the crack's end is one
    assert doubled[:, 2].min() > 0.006 + 1e-9
    # new boundary: both sides of the cut and nothing else
    extra = len(boundary(cut.geometry.cells, kind).nodes) - len(boundary(g.cells, kind).nodes)
    assert extra == 2 * len(cut.minus)


def test_a_slit_inside_the_body():
    g = box((0.03, 0.02, 0.012), (6, 4, 4))
    cut = split(g, middle, lambda p: (np.abs(p[:, 2] - 0.006) < 0.003) & (np.abs(p[:, 0]) < 0.01))
    assert len(cut.geometry.points) - len(g.points) == 3 * 1  # only nodes with a whole ring of cut faces around them


def test_off_the_faces_is_refused_with_the_place():
    g = box((0.03, 0.02, 0.01), (6, 4, 3))
    with pytest.raises(InputError, match="off the element faces"):
        split(g, lambda p: p[:, 1] - 0.001)
    with pytest.raises(InputError, match="deepen the cut"):
        split(g, middle, lambda p: p[:, 2] > 1.0)

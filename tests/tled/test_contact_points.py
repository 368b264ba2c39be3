"""Points of a facet at which contact is summed: their weights and shape functions by integrals over the facet."""

import numpy as np
import pytest

from tissuejax.tled.contact import quadrature

SQUARE = np.array([[4, 2, 1, 2], [2, 4, 2, 1], [1, 2, 4, 2], [2, 1, 2, 4]]) / 9  # of two bilinear shapes over [-1, 1]^2
TRIANGLE = (np.ones((3, 3)) + np.eye(3)) / 24  # of two linear shapes over a triangle of area 1/2


@pytest.mark.parametrize(("corners", "moments"), [(4, SQUARE), (3, TRIANGLE)])
def test_products_of_shapes_are_integrated_exactly(corners, moments):
    shape, weight = quadrature(corners)
    assert shape.sum(1) == pytest.approx(np.ones(len(weight)))
    assert np.einsum("q,qi,qj->ij", weight, shape, shape) == pytest.approx(moments)


def test_points_of_the_middle_line_see_what_changes_along_it():
    """(1 + a)/2 from edge 3-0 to edge 1-2, which the two corners there share: over [-1, 1]^2 its integral is 2, of its
    square 4/3, of its fourth power 4/5."""
    shape, weight = quadrature(4, 3)
    assert weight.shape == (3,)
    assert shape == pytest.approx(shape[:, [3, 2, 1, 0]]), "the line is in the middle"
    along = shape[:, 1] + shape[:, 2]
    assert [float(weight @ along**k) for k in (0, 1, 2, 4)] == pytest.approx([4.0, 2.0, 4 / 3, 4 / 5])

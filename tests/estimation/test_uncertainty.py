"""Standard errors from a Jacobian, by linear algebra."""

import numpy as np
import pytest

from tissuejax.estimation.covariance import inflation, uncertainty

NAMES, UNITS = ("a", "b", "c"), ("Pa", "1", "s")


def test_errors_of_a_linear_fit_are_the_inverse_of_the_normal_matrix(rng):
    size = np.array([1e4, 0.3, 20.0])
    jacobian = rng.normal(size=(60, 3)) / (0.05 * size)
    of = uncertainty(jacobian, size, size, NAMES, UNITS, 1.7)
    by_hand = 1.7**2 * np.linalg.inv(jacobian.T @ jacobian)
    np.testing.assert_allclose(of.covariance, by_hand, rtol=1e-8)
    np.testing.assert_allclose(of.std, np.sqrt(np.diag(by_hand)), rtol=1e-8)
    np.testing.assert_allclose(of.correlation, by_hand / np.outer(of.std, of.std), rtol=1e-8)


def test_correlated_residuals_make_a_sandwich(rng):
    jacobian = rng.normal(size=(50, 2)) * [3.0, 40.0]
    noise = 0.8 ** np.abs(np.subtract.outer(np.arange(50), np.arange(50)))
    of = uncertainty(jacobian, np.ones(2), np.ones(2), NAMES[:2], UNITS[:2], correlated=lambda j: noise @ j)
    bread = np.linalg.inv(jacobian.T @ jacobian)
    np.testing.assert_allclose(of.covariance, bread @ jacobian.T @ noise @ jacobian @ bread, rtol=1e-8)


@pytest.mark.parametrize(("b", "size"), [(5.0, 5.0), (0.0, 0.01), (-0.004, 0.01)])
def test_the_condition_is_of_relative_steps_and_of_a_thousandth_of_what_is_typical_near_zero(b, size):
    """Orthogonal columns of lengths 2 and 3: the singular values are those times the sizes."""
    of = uncertainty(np.eye(4)[:, :2] * [2.0, 3.0], np.array([7.0, b]), np.array([10.0, 10.0]), NAMES[:2], UNITS[:2])
    assert of.condition == pytest.approx(max(14 / (3 * size), 3 * size / 14))
    np.testing.assert_allclose(of.std, [1 / 2, 1 / 3], rtol=1e-9)


def test_a_flat_direction_has_no_error_and_neither_have_its_members():
    jacobian = np.array([[1.0, 1.0, 0.0], [2.0, 2.0, 0.0], [0.0, 0.0, 4.0]])
    of = uncertainty(jacobian, np.ones(3), np.ones(3), NAMES, UNITS)
    assert np.isinf(of.std[:2]).all()
    assert of.std[2] == pytest.approx(0.25)
    assert of.sentences


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_two_columns_that_are_one_have_no_condition_whatever_their_size(rng, size):
    """Their second singular value is rounding: some 1e-16 of the first, and not nothing."""
    column = size * rng.normal(size=(80, 1))
    of = uncertainty(column * [1.0, 3.0], np.ones(2), np.ones(2), NAMES[:2], UNITS[:2])
    assert of.condition == np.inf


@pytest.mark.parametrize(
    ("chi2", "n", "k", "estimated", "expected"),
    [
        (94.0, 50, 3, False, (2.0, 47.0)),  # more than the noise: widened, Student's t of 47
        (94.0, 50, 3, True, (2.0, 47.0)),
        (23.5, 50, 3, False, (1.0, np.inf)),  # a recorded level is not narrowed by chance
        (23.5, 50, 3, True, (0.5, 47.0)),
        (6.0, 3, 3, True, (6.0, 1.0)),  # none to spare: one is taken
    ],
)
def test_variances_are_inflated_by_the_misfit_a_degree_of_freedom(chi2, n, k, estimated, expected):
    assert inflation(chi2, n, k, estimated) == pytest.approx(expected)

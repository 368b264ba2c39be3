"""Standard errors from a Jacobian, by linear algebra."""

import numpy as np
import pytest

from tissuejax.estimation.covariance import autocorrelation, inflation, standard_errors, uncertainty, unseen

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


def test_standard_errors_are_the_roots_of_the_inverse_and_none_where_two_columns_are_one(rng):
    jacobian = rng.normal(size=(40, 3)) * [1e-5, 3.0, 1e7]
    expected = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian / np.outer(*2 * [[1e-5, 3.0, 1e7]]))))
    np.testing.assert_allclose(standard_errors(jacobian) * [1e-5, 3.0, 1e7], expected, rtol=1e-8)
    for apart, seen in ((1e-9, False), (1e-6, True)):
        twins = np.column_stack([jacobian[:, 0], jacobian[:, 0] + apart * 1e-5 * rng.normal(size=40)])
        assert np.isfinite(standard_errors(twins)).all() == seen


def test_standard_errors_are_no_numbers_where_nothing_depends_on_a_parameter():
    slopes = np.array([[1.0, 0.0], [2.0, 0.0], [0.0, 0.0]])
    np.testing.assert_array_equal(standard_errors(slopes), [np.nan, np.nan])
    np.testing.assert_array_equal(standard_errors(np.zeros((3, 2))), [np.nan, np.nan])


def test_variances_are_multiplied_by_what_correlation_and_level_make_of_them(rng):
    jacobian = rng.normal(size=(30, 2))
    noise = 0.6 ** np.abs(np.subtract.outer(np.arange(30), np.arange(30)))
    ones = np.ones(2)
    of = uncertainty(jacobian, ones, ones, "ab", UNITS[:2], 1.5, correlated=lambda j: noise @ j, dof=12.0)
    bread = np.linalg.inv(jacobian.T @ jacobian)
    whole = 2.25 * bread @ jacobian.T @ noise @ jacobian @ bread
    np.testing.assert_allclose(of.inflation, np.diag(whole) / np.diag(bread), rtol=1e-8)
    assert (of.dof, of.serial, of.widening) == (12.0, True, 1.5)
    assert of.quantile() == pytest.approx(2.1788, abs=1e-4)  # Student's t of 12
    plain = uncertainty(jacobian, ones, ones, "ab", UNITS[:2])
    assert (plain.serial, plain.sentences) == (False, ())
    assert plain.quantile() == pytest.approx(1.95996, abs=1e-5)
    np.testing.assert_allclose(plain.inflation, 1.0)


@pytest.mark.parametrize(("wide", "said"), [(0.99, 0), (1.01, 1)])
def test_a_parameter_is_not_identified_from_an_error_of_its_own_size_on(wide, said):
    of = uncertainty(np.diag([1.0 / wide, 50.0])[[0, 1, 1]], np.ones(2), np.ones(2), NAMES[:2], UNITS[:2])
    assert len(of.sentences) == said
    assert all(
        s.startswith("a is not identified by these recordings: it is known to within 101 %") for s in of.sentences
    )
    level = uncertainty(np.diag([2.0, 50.0]), np.ones(2), np.ones(2), NAMES[:2], UNITS[:2], 2.0 * wide)
    assert len(level.sentences) == said  # the noise's own level counts


@pytest.mark.parametrize(
    ("direction", "size", "units", "wide", "expected"),
    [
        (
            [0.0, 1.0, 0.29],
            [1, 1, 1],
            UNITS,
            9.9,
            "b is not identified by these recordings: it is known to within 990 %",
        ),
        (
            [0.0, 1.0, 0.0],
            [1, 1, 1],
            UNITS,
            10.1,
            "b is not identified by these recordings: it hardly shows in the pre",
        ),
        ([-0.5, 1.0, 0.0], [2, 4, 1], ("Pa",) * 3, 5, "Only a + 0.25 b is seen: a change of one against the other is"),
        ([0.5, 1.0, 0.0], [2, 4, 1], ("Pa",) * 3, 5, "Only a - 0.25 b is seen"),
        ([-1.0, 0.0, 1.0], [2, 1, 2.05], ("Pa",) * 3, 5, "Only a + c is seen"),
        ([-1.0, 0.0, 1.0], [2.2, 1, 2], ("Pa",) * 3, 5, "Only a + 1.1 c is seen"),
        ([-0.9, 0.0, 1.0], [2, 1, 2], UNITS, 5, "Only a * c^0.9 is seen"),
        ([-0.96, 0.0, 1.0], [2, 1, 2], UNITS, 5, "Only a * c is seen"),
        ([-0.5, 0.0, 1.0], [2, 1, 2], ("1",) * 3, 5, "Only a * c^0.5 is seen"),  # exponents make no sum
        (
            [0.8, -1.0, 0.31],
            [1, 1, 1],
            UNITS,
            5,
            "a change of a by +80 %, b by -100 %, c by +31 % together is known to",
        ),
    ],
)
def test_what_the_data_leave_open_is_said_by_who_takes_part(direction, size, units, wide, expected):
    """From three tenths of the largest share on; equal units make a sum, others a product."""
    said = unseen(np.array(direction), np.array(size, float), NAMES, units, wide)
    assert expected in said


def test_neighbouring_residuals_are_compared_about_their_mean():
    """A straight line of eight samples; of seven nothing is told."""
    r = np.arange(9.0, 17.0)
    d = r - 12.5
    assert autocorrelation(r) == pytest.approx(sum(d[1:] * d[:-1]) / sum(d * d))
    assert autocorrelation(r[:7]) == 0.0
    assert autocorrelation(np.full(20, 3.0)) == 0.0
    assert autocorrelation(np.tile([1.0, -1.0], 50)) == pytest.approx(-0.99)

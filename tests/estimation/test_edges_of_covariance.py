"""Standard errors, conditions and sentences at the edges of their rules: diagonal Jacobians give exact numbers."""

import math
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from tissuejax.estimation.covariance import (
    Directions,
    Uncertainty,
    autocorrelation,
    inflation,
    seen_pair,
    standard_errors,
    uncertainty,
    unseen,
)

NAMES, UNITS = ("a", "b", "c"), ("Pa", "1", "s")
INF = math.inf


def of(*diagonal, x=None, scale=None, widening=1.0, **more):
    """Of a diagonal Jacobian, parameters and their scales one unless told."""
    n = len(diagonal)
    x, scale = (np.ones(n) if given is None else np.array(given, float) for given in (x, scale))
    return uncertainty(np.diag(diagonal), x, scale, NAMES[:n], UNITS[:n], widening, **more)


def turned(angle):
    """Two parameters of which one combination is not seen: (sin, cos) of the angle."""
    return np.diag([1.0, 0.0]) @ [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]


def test_singular_values_are_inverted_down_to_rounding_of_the_largest():
    size = np.array([1.0, 2.0, 1.0])
    found = Directions.of(np.diag([4.0, 1.0, 1e-15]), size)
    np.testing.assert_allclose(found.s, [4.0, 2.0, 1e-15])
    assert found.top == 4.0
    np.testing.assert_allclose(found.inverse, [0.25, 0.5, 1 / 4e-13], rtol=1e-12)
    np.testing.assert_allclose(found.relative(), np.diag([0.0625, 0.25, 1 / 16e-26]), rtol=1e-12)
    small = Directions.of(np.diag([0.5, 0.25]), np.ones(2))
    assert small.top == 0.5
    np.testing.assert_allclose(small.inverse, [2.0, 4.0])
    with pytest.raises(FrozenInstanceError):
        small.s = np.ones(2)  # pyright: ignore[reportAttributeAccessIssue]


def test_where_nothing_is_seen_the_largest_counts_as_one():
    nothing, empty = Directions.of(np.zeros((3, 2)), np.ones(2)), Directions.of(np.zeros((0, 2)), np.ones(2))
    assert (nothing.top, empty.top) == (1.0, 1.0)
    np.testing.assert_allclose(nothing.inverse, [1e13, 1e13])
    assert empty.inverse.shape == (0,)
    told = of(0.0, 0.0)
    assert np.isinf(told.std).all()
    assert told.condition == INF
    assert len(told.sentences) == 2


def test_relative_covariance_is_that_of_least_squares_with_any_noise(rng):
    """(A' A)^-1 A' V A (A' A)^-1 with A = J size, V by its share along u."""
    jacobian, size = rng.normal(size=(12, 3)), np.array([2.0, 0.1, 30.0])
    root = rng.normal(size=(12, 12))
    noise = root @ root.T
    found, A = Directions.of(jacobian, size), jacobian * size
    bread = np.linalg.inv(A.T @ A)
    np.testing.assert_allclose(found.relative(), bread, rtol=1e-9)
    sandwich = bread @ A.T @ noise @ A @ bread
    np.testing.assert_allclose(found.relative(found.u.T @ noise @ found.u), sandwich, rtol=1e-8)


@pytest.mark.parametrize(("weakest", "seen"), [(0.4, True), (0.5, True), (math.nextafter(1, 0), True), (1.0, False)])
def test_the_weakest_combination_must_lie_above_its_share_of_the_strongest(weakest, seen):
    """Orthogonal columns are alike in unit length, whatever theirs: the share is one."""
    told = standard_errors(np.diag([4.0, 0.5])[[0, 1, 1, 1, 1]] * [[1.0], [1.0], [0.0], [0.0], [0.0]], weakest)
    np.testing.assert_allclose(told, [0.25, 2.0] if seen else [math.nan, math.nan])


def test_a_level_is_widened_from_just_above_one_and_never_to_nothing():
    assert inflation(47.0, 50, 3) == (1.0, INF)
    assert inflation(math.nextafter(47.0, 48), 50, 3) == (pytest.approx(1.0), 47.0)
    assert inflation(47.0, 50, 3, True) == (1.0, 47.0)
    assert inflation(23.5, 50, 3) == (1.0, INF)
    scale, dof = inflation(0.0, 50, 3, True)
    assert (1e12 * scale, dof) == (pytest.approx(1.0), 47.0)
    assert inflation(3.0, 5, 3, True) == (1.5, 2.0)
    assert inflation(3.0, 4, 3, True) == (3.0, 1.0)
    assert inflation(3.0, 2, 3, True) == (3.0, 1.0)


def test_an_uncertainty_by_itself_is_of_known_independent_noise():
    bare = Uncertainty(np.ones(1), np.eye(1), np.eye(1), 1.0, ())
    assert (bare.inflation, bare.dof, bare.serial, bare.widening) == (None, INF, False, 1.0)
    assert bare.quantile() == pytest.approx(1.959964, abs=1e-6)
    assert bare.quantile(0.68268949) == pytest.approx(1.0, abs=1e-6)
    cauchy = Uncertainty(np.ones(1), np.eye(1), np.eye(1), 1.0, (), dof=1.0)
    assert cauchy.quantile(0.5) == pytest.approx(1.0)
    with pytest.raises(FrozenInstanceError):
        bare.condition = 2.0  # pyright: ignore[reportAttributeAccessIssue]
    told = of(3.0, 5.0)
    assert (told.widening, told.dof, told.serial) == (1.0, INF, False)
    np.testing.assert_allclose(told.std, [1 / 3, 0.2])


@pytest.mark.parametrize("top", [1.0, 1e3])
@pytest.mark.parametrize(("share", "lost"), [(0.9e-10, True), (1e-10, True), (1.1e-10, False)])
def test_a_direction_is_flat_to_a_ten_billionth_of_the_strongest(top, share, lost):
    told = of(top, top * share)
    assert np.isinf(told.std).tolist() == [False, lost]
    assert told.std[0] == pytest.approx(1 / top)
    if not lost:
        assert told.std[1] == pytest.approx(1 / (top * share))


@pytest.mark.parametrize("top", [1.0, 1e3])
@pytest.mark.parametrize(("share", "condition"), [(0.9e-13, INF), (1.1e-13, 1 / 1.1e-13), (0.5, 2.0), (1.0, 1.0)])
def test_a_condition_is_finite_as_far_as_rounding_lets_it(top, share, condition):
    assert of(top, top * share).condition == pytest.approx(condition)


def test_a_condition_is_that_of_the_strongest_to_the_weakest_of_all():
    assert of(1.0, 0.5, 0.25).condition == pytest.approx(4.0)
    assert of(0.5, 1e-20, 2.0).condition == INF
    assert of(0.25).condition == 1.0


def test_correlation_is_covariance_over_both_errors():
    """Of two columns at an angle of cosine 0.6 it is -0.6, whatever their lengths and the level."""
    jacobian = np.array([[1.0, 0.6], [0.0, 0.8]]) * [7.0, 0.1]
    told = uncertainty(jacobian, np.array([2.0, 50.0]), np.ones(2), NAMES[:2], UNITS[:2], 3.0)
    np.testing.assert_allclose(told.correlation, [[1.0, -0.6], [-0.6, 1.0]], rtol=1e-9)
    np.testing.assert_allclose(told.std, [3 / (7.0 * 0.8), 3 / (0.1 * 0.8)], rtol=1e-9)


@pytest.mark.parametrize(("share", "open_"), [(0.0099, False), (0.0101, True), (-0.0101, True), (0.6, True)])
def test_who_takes_a_hundredth_part_in_a_flat_direction_has_no_error(share, open_):
    told = uncertainty(turned(math.asin(share)), np.ones(2), np.ones(2), NAMES[:2], UNITS[:2])
    assert np.isinf(told.std).tolist() == [open_, True]


def test_two_flat_directions_leave_no_error_to_the_members_of_either():
    told = of(2.0, 0.0, 0.0)
    assert told.std[0] == 0.5
    assert np.isinf(told.std[1:]).all()


@pytest.mark.parametrize(("widening", "s", "said"), [
    (1.0, 1.0, None),  # as large as the parameter itself: that much is identified
    (2.0, 2.0, None),
    (1.0, 0.5, "is known to within 200 % only"),
    (4.0, 0.5, "is known to within 800 % only"),
    (5.0, 0.5, "is known to within 1000 % only"),
    (5.0, 0.49, "hardly shows in the prediction"),
    (1.0, 1e-20, "hardly shows in the prediction"),
])  # fmt: skip
def test_a_relative_error_beyond_one_is_said_with_its_size_up_to_ten(widening, s, said):
    told = of(64.0, s, widening=widening)
    expected = () if said is None else (f"b is not identified by these recordings: it {said}.",)
    assert told.sentences == expected


def test_every_direction_that_is_left_open_has_a_sentence_the_strongest_first():
    told = of(0.2, 64.0, 0.5)
    assert [s[0] for s in told.sentences] == ["c", "a"]
    assert ["200 %" in told.sentences[0], "500 %" in told.sentences[1]] == [True, True]


def test_errors_are_relative_to_a_parameter_and_to_a_thousandth_of_its_scale_near_zero():
    """Sizes 5, 0.02 and 0.01: the errors are 0.25 / 5, 0.25 / 0.02 and 0.25 / 0.01 of them."""
    told = of(4.0, 4.0, 4.0, x=[-5.0, 0.0, 0.009], scale=[1.0, 20.0, 10.0])
    np.testing.assert_allclose(told.std, 0.25, rtol=1e-12)
    assert told.condition == pytest.approx(500.0)
    assert sorted(told.sentences) == [
        "b is not identified by these recordings: it hardly shows in the prediction.",
        "c is not identified by these recordings: it hardly shows in the prediction.",
    ]


def test_a_level_and_a_correlation_multiply_variances():
    """Noise of variance 4 in the first residual and 9 in the second, level 3: 36 and 81 times as much."""
    told = of(2.0, 5.0, widening=3.0, correlated=lambda j: np.array([[4.0], [9.0]]) * j, dof=6.0)
    assert told.inflation == pytest.approx([36.0, 81.0])
    np.testing.assert_allclose(told.std, [6 / 2, 9 / 5], rtol=1e-12)
    np.testing.assert_allclose(told.covariance, np.diag([9.0, 3.24]), atol=1e-12)
    assert (told.serial, told.dof, told.widening) == (True, 6.0, 3.0)
    assert of(2.0, 5.0, widening=3.0).inflation == pytest.approx([9.0, 9.0])


@pytest.mark.parametrize(("direction", "who"), [
    ([1.0, 0.3, 0.0], "a is not identified"),  # three tenths of the largest are not yet a part
    ([1.0, 0.30001, 0.0], "Only "),
    ([-0.5, 0.0, 0.15], "a is not identified"),
    ([0.5, 0.0, -0.1501], "Only "),
    ([0.2, 0.0601, -0.0601], "a change of a by +100 %, b by +30 %, c by -30 % together"),
    ([0.1, 0.4, -0.2], "Only b * c^2 is seen: a change of one against the other is known to within 500 % only."),
])  # fmt: skip
def test_members_of_a_combination_have_more_than_three_tenths_of_the_largest(direction, who):
    said = unseen(np.array(direction), np.ones(3), NAMES, UNITS, 5.0)
    assert who in said


def test_sentences_say_whole_what_is_open():
    two = unseen(np.array([0.0, -0.8, 0.4]), np.ones(3), NAMES, ("Pa",) * 3, 10.0)
    assert two == "Only b + 2 c is seen: a change of one against the other is known to within 1000 % only."
    three = unseen(np.array([0.4, -0.5, 0.25]), np.ones(3), NAMES, UNITS, 10.1)
    assert three == (
        "One combination is not identified: a change of a by +80 %, b by -100 %, c by +50 % together hardly shows in "
        "the prediction."
    )


@pytest.mark.parametrize(("direction", "size", "units", "said"), [
    ([-3.0, 2.0], [1.0, 1.0], ("Pa", "Pa"), "a + 1.5 b"),
    ([3.0, 2.0], [1.0, 1.0], ("Pa", "Pa"), "a - 1.5 b"),
    ([-1.0, 1.0], [3.0, 2.0], ("Pa", "Pa"), "a + 1.5 b"),
    ([-1.0, 1.0], [1.04, 1.0], ("Pa", "Pa"), "a + b"),
    ([-1.0, 1.0], [1.0, 1.04], ("Pa", "Pa"), "a + b"),
    ([1.0, 1.0], [1.04, 1.0], ("Pa", "Pa"), "a - b"),
    ([-1.0, 1.0], [1.06, 1.0], ("Pa", "Pa"), "a + 1.1 b"),
    ([-1.0, 1.0], [0.94, 1.0], ("Pa", "Pa"), "a + 0.94 b"),
    ([-1.0, 1.0], [7.0, 1.0], ("Pa", "s"), "a * b"),  # of a product the sizes say nothing
    ([-1.04, 1.0], [1.0, 1.0], ("Pa", "s"), "a * b"),
    ([-0.94, 1.0], [1.0, 1.0], ("Pa", "s"), "a * b^0.94"),
    ([-1.06, 1.0], [1.0, 1.0], ("Pa", "s"), "a * b^1.1"),
    ([3.0, 2.0], [1.0, 1.0], ("Pa", "s"), "a * b^-1.5"),
    ([-3.0, 2.0], [1.0, 1.0], ("1", "1"), "a * b^1.5"),
])  # fmt: skip
def test_the_combination_that_is_seen_is_orthogonal_to_the_one_that_is_not(direction, size, units, said):
    d, s = np.array(direction), np.array(size)
    assert seen_pair(d, s, ("a", "b"), units, 0, 1) == said


def test_eight_residuals_have_a_correlation_and_seven_none():
    r = np.array([1.0, 2.0, 0.0, -1.0, 3.0, 5.0, -2.0, 4.0])
    d = r - r.mean()
    assert autocorrelation(r) == pytest.approx(float(np.sum(d[1:] * d[:-1]) / np.sum(d * d)), rel=1e-12)
    assert autocorrelation(r[:7]) == 0.0
    assert autocorrelation(np.zeros(8)) == 0.0
    assert autocorrelation(1e-4 * r) == pytest.approx(autocorrelation(r), rel=1e-9)

"""Coordinates without bounds against their formulas, parts of a whole against products, and both sides of each edge."""

import math

import numpy as np
import pytest

from tissuejax.errors import InputError
from tissuejax.estimation.transforms import Box, Sticks, chained, checked_bounds, unchained, width

INF = math.inf


@pytest.mark.parametrize(("lower", "upper"), [(1.0, 1.0), (2.0, 1.0), (math.nan, 1.0), (0.0, math.nan), (INF, INF)])
def test_what_is_no_pair_of_bounds_is_refused_with_its_name(lower, upper):
    with pytest.raises(InputError, match=r"bounds of energy\.mu: \("):
        checked_bounds("energy.mu", lower, upper)


def test_a_pair_of_bounds_is_given_back_as_numbers():
    assert checked_bounds("x", -INF, 3) == (-INF, 3.0)
    assert checked_bounds("x", 1, math.nextafter(1, 2)) == (1.0, math.nextafter(1, 2))
    assert width(-1.0, 1.5, 2.0) == 2.0
    assert width(-1.0, 0.5, 2.0) == 1.5
    assert [width(*ends, 2.0) for ends in ((-INF, INF), (0.0, INF), (-INF, 0.0), (5.0, INF))] == [2.0] * 4
    assert width(0.0, 1.5, 2.0) == 1.5


@pytest.mark.parametrize(("x", "whole", "parts"), [
    ([0.3, 0.1, 0.25, 7.0], 0.8, [0.3, 0.1, 0.25]),
    ([0.4, 0.2, 0.3, -7.0], 1.0, [0.4, 0.2, 0.3]),
    ([0.0, 0.0, 0.0, 7.0], 1.0, [0.0, 0.0, 0.0]),
    ([-0.3, 0.5, 0.2, 7.0], 1.0, [0.0, 0.5, 0.2]),  # what is negative counts for nothing
    ([0.4, 0.3, 0.279, 7.0], 1.0, [0.4, 0.3, 0.279]),
    ([0.4, 0.3, 0.281, 7.0], 1.0, [0.4 * 0.98 / 0.981, 0.3 * 0.98 / 0.981, 0.281 * 0.98 / 0.981]),  # 98 % at most
    ([2.0, 1.0, 1.0, 7.0], 0.5, [0.245, 0.1225, 0.1225]),
    ([5.0, 0.0, 0.0, 7.0], 0.5, [0.49, 0.0, 0.0]),
])  # fmt: skip
def test_fractions_are_of_what_the_parts_before_have_left(x, whole, parts):
    """The order is 2, 0, 1; the fourth is none of them."""
    sticks, x = Sticks((2, 0, 1), whole), np.array(x)
    kept = x.copy()
    f = sticks.fractions(x)
    np.testing.assert_array_equal(x, kept)
    a, b, c = parts
    np.testing.assert_allclose(f, [a / (whole - c), b / (whole - c - a), c / whole, x[3]], atol=1e-14)
    back, _ = sticks.parts(f)
    np.testing.assert_allclose(back, [*parts, x[3]], atol=1e-14)


def test_a_whole_is_one_unless_told():
    assert Sticks((0,)).parts(np.array([0.25]))[0].tolist() == [0.25]
    np.testing.assert_allclose(Sticks((0,)).fractions(np.array([0.25])), [0.25])


def test_parts_are_products_and_their_derivatives_leave_one_factor_out():
    """x = W f2, W (1 - f2) f0, W (1 - f2)(1 - f0) f1."""
    p, q, s, W = 0.3, 0.6, 0.45, 0.8
    f = np.array([q, s, p, 5.0])
    x, slope = Sticks((2, 0, 1), W).parts(f)
    np.testing.assert_allclose(x, [W * (1 - p) * q, W * (1 - p) * (1 - q) * s, W * p, 5.0], rtol=1e-14)
    expected = np.zeros((4, 4))
    expected[0, [0, 2]] = W * (1 - p), -W * q
    expected[1, [0, 1, 2]] = -W * (1 - p) * s, W * (1 - p) * (1 - q), -W * (1 - q) * s
    expected[2, 2], expected[3, 3] = W, 1.0
    np.testing.assert_allclose(slope, expected, atol=1e-14)
    assert f.tolist() == [q, s, p, 5.0]


LOWER, UPPER = [-1.0, -2.0, -INF, -INF, -INF, 0.0], [7.0, INF, 6.0, INF, INF, 1e4]
SCALE, WIDE = [0.5, 2.0, 3.0, 4.0, 5.0, 6.0], [True, True, True, False, True, False]


@pytest.mark.parametrize("at", [-7.0, -3.0, -0.4, 0.0, 1.1, 2.5, 9.0])
def test_each_kind_of_bound_has_its_formula_and_its_slope(at):
    """Both, lower, upper, none, none over decades, and a wide range; only where there is no bound decades count."""
    box = Box(LOWER, UPPER, SCALE, WIDE)
    share, fall = 1 / (1 + math.exp(-at)), 1 / (1 + math.exp(at))
    x, slope = box.bounded(np.full(6, at))
    soft, firm = math.log(1 + math.exp(at)), math.log(1 + math.exp(-at))
    formula = [-1 + 8 * share, -2 + 2 * soft, 6 - 3 * firm, 4 * at, 5e-3 * math.sinh(at), 1e4 * share]
    np.testing.assert_allclose(x, formula, rtol=1e-12)
    both = share * fall
    derived = [8 * both, 2 * share, 3 * fall, 4.0, 5e-3 * math.cosh(at), 1e4 * both]
    np.testing.assert_allclose(slope, derived, rtol=1e-12)
    if abs(at) < 5:  # further out it is nearer to a bound than a start may be
        np.testing.assert_allclose(box.free(x), np.full(6, at), atol=1e-9)


def test_without_a_word_on_decades_what_has_no_bound_is_linear():
    x, slope = Box([-INF, 0.0], [INF, INF], [4.0, 1.0]).bounded(np.array([50.0, 0.0]))
    assert x.tolist() == [200.0, pytest.approx(math.log(2))]
    assert slope.tolist() == [4.0, 0.5]


def test_over_decades_no_coordinate_leads_beyond_sixty():
    box = Box([-INF], [INF], [2.0], [True])
    for y, reached in ((59.5, 59.5), (60.0, 60.0), (60.5, 60.0), (1e9, 60.0), (-61.0, -60.0)):
        x, slope = box.bounded(np.array([y]))
        assert x[0] == pytest.approx(2e-3 * math.sinh(reached), rel=1e-12)
        assert slope[0] == pytest.approx(2e-3 * math.cosh(reached), rel=1e-12)


@pytest.mark.parametrize("z", [1e-2, 0.5, 3.0, 12.0, 29.0, 31.0, 700.0, 1e5])
def test_far_from_one_bound_the_coordinate_is_the_distance(z):
    """y = log(e^z - 1) = z + log(1 - e^-z)."""
    box = Box([3.0, -INF], [INF, -3.0], [2.0, 2.0])
    y = z + math.log1p(-math.exp(-z))
    np.testing.assert_allclose(box.free(np.array([3 + 2 * z, -3 - 2 * z])), [y, -y], rtol=1e-11)


@pytest.mark.parametrize(("lower", "upper", "scale", "step"), [
    (0.0, 1.0, 5.0, 1e-3),  # of the range
    (0.0, 100.0, 5.0, 5e-3),  # of what is typical
    (0.0, INF, 5.0, 5e-3),
    (-INF, 0.0, 5.0, 5e-3),
    (-1.5e308, 1.5e308, 5.0, 5e-3),  # a range beyond all numbers
])  # fmt: skip
def test_a_start_is_moved_inside_by_a_thousandth(lower, upper, scale, step):
    with np.errstate(over="ignore"):
        box = Box([lower], [upper], [scale])
    ends = [lower + step if lower > -INF else -1e9, upper - step if upper < INF else 1e9]
    found = [float(box.inward(np.array([x]))[0]) for x in (max(lower, -1e9), min(upper, 1e9))]
    if upper < 1e300:
        np.testing.assert_allclose(found, ends, rtol=1e-12)
    else:
        assert found == [max(lower + step, -1e9), 1e9]
    if 0.0 < upper < 1e300 and lower == 0.0:
        assert box.inward(np.array([lower - 5.0]))[0] == lower + step
        assert box.inward(np.array([0.4]))[0] == 0.4
        assert box.bounded(box.free(np.array([lower])))[0][0] == pytest.approx(step, rel=1e-9)


@pytest.mark.parametrize(("lower", "upper", "scale", "inside"), [
    (0.0, 1.0, 5.0, 2e-3),  # of a range that is less than what is typical
    (2.0, 102.0, 0.5, 4e-3),  # of the value itself where that is more: about 2 there
    (-3.0, INF, 7.0, 1.4e-2),
    (-INF, 3.0, 7.0, 1.4e-2),
    (0.0, 100.0, 5.0, 1e-2),
])  # fmt: skip
def test_an_estimate_is_at_a_bound_within_two_thousandths(lower, upper, scale, inside):
    box = Box([lower], [upper], [scale])
    for end, name, inward in ((lower, "lower", 1), (upper, "upper", -1)):
        if not math.isfinite(end):
            continue
        near = 0.2 if end >= 100.0 else inside  # of 102 no more than the range
        for times, told in ((0.0, name), (0.98, name), (1.02, None), (-3.0, name)):
            assert box.at_bound(np.array([end + inward * times * near])) == [told]
    unbound = Box([-INF], [INF], [scale])
    assert unbound.at_bound(np.zeros(1)) == [None]


def test_just_two_thousandths_from_a_bound_is_not_at_it():
    assert Box([0.0], [INF], [1.0]).at_bound(np.array([2e-3])) == [None]
    assert Box([-INF], [0.0], [1.0]).at_bound(np.array([-2e-3])) == [None]
    assert Box([0.0], [1.0], [1.0]).at_bound(np.array([math.nextafter(2e-3, 0)])) == ["lower"]


def test_of_a_box_with_several_each_has_its_own_bound():
    box = Box(LOWER, UPPER, SCALE, WIDE)
    assert box.at_bound(np.array([-1.0, -2.0, 6.0, 0.0, 0.0, 1e4])) == ["lower", "lower", "upper", None, None, "upper"]


def test_parts_of_two_wholes_follow_fractions_in_a_box():
    """A fraction is 0.999 / (1 + exp(-y)); derivatives by differences."""
    box = Box([0.0] * 4 + [-INF], [1.0] * 4 + [INF], [0.1] * 4 + [3.0], sticks=(Sticks((0, 3), 0.8), Sticks((2, 1))))
    y = np.array([0.3, -0.7, 1.2, -1.5, 2.0])
    f = 0.999 / (1 + np.exp(-y))
    expected = [0.8 * f[0], (1 - f[2]) * f[1], f[2], 0.8 * (1 - f[0]) * f[3], 6.0]
    x, slope = box.bounded(y)
    np.testing.assert_allclose(x, expected, rtol=1e-12)
    numeric = np.stack([(box.bounded(y + h)[0] - box.bounded(y - h)[0]) / 2e-6 for h in 1e-6 * np.eye(5)], 1)
    np.testing.assert_allclose(slope, numeric, atol=1e-8)
    np.testing.assert_allclose(box.free(np.array(expected)), y, atol=1e-9)
    assert box.at_bound(np.array([0.0, 0.5, 0.9965, 0.3, 0.0])) == ["lower", None, None, None, None]
    assert box.at_bound(np.array([0.1, 0.5, 0.99895, 0.3, 0.0]))[2] == "upper"


def test_columns_go_through_a_slope_and_back(rng):
    jacobian, slope, matrix = rng.normal(size=(6, 3)), np.array([2.0, -0.5, 4.0]), rng.normal(size=(3, 3))
    np.testing.assert_allclose(chained(jacobian, slope), jacobian @ np.diag(slope), rtol=1e-14)
    np.testing.assert_allclose(unchained(jacobian, slope), jacobian @ np.diag(1 / slope), rtol=1e-14)
    np.testing.assert_allclose(chained(jacobian, matrix), np.einsum("ij,jk", jacobian, matrix), rtol=1e-12)
    np.testing.assert_allclose(unchained(jacobian, matrix), jacobian @ np.linalg.inv(matrix), rtol=1e-9)

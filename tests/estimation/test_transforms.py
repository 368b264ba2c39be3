"""Coordinates of a descent: there and back, and derivatives through them against differences."""

import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.estimation.transforms import Box, Sticks, chained, unchained, width
from tissuejax.fitting.target import bounded

LOWER = [-np.inf, 0.0, -np.inf, -1.0, 0.0, 0.0, -np.inf]
UPPER = [np.inf, np.inf, 5.0, 3.0, 1.0, 1.0, np.inf]
SCALE = [2.0, 1e3, 0.5, 1.0, 0.1, 0.1, 10.0]
X = np.array([-3.0, 800.0, 4.2, 1.7, 0.3, 0.4, 25.0])
WIDE = [False] * 6 + [True]


@pytest.mark.parametrize("sticks", [(), (Sticks((4, 5)),)])
def test_derivatives_go_through_the_transform_and_back(rng, sticks):
    """f(x) = A x + (b . x)^2 for its curvature; columns by y are central differences of f(x(y))."""
    box = Box(LOWER, UPPER, SCALE, WIDE, sticks)
    y = box.free(X)
    x, slope = box.bounded(y)
    assert x == pytest.approx(X, rel=1e-9)
    assert slope.ndim == (2 if sticks else 1)
    a, b = rng.normal(size=(9, 7)) / np.array(SCALE), rng.normal(size=7) / np.array(SCALE)

    def f(at):
        return a @ at + (b @ at) ** 2

    by_x, h = a + 2 * (b @ x) * b, 1e-6
    by_y = np.stack([(f(box.bounded(y + h * e)[0]) - f(box.bounded(y - h * e)[0])) / (2 * h) for e in np.eye(7)], 1)
    assert chained(by_x, slope) == pytest.approx(by_y, rel=1e-5, abs=1e-6 * np.max(np.abs(by_y)))
    assert unchained(chained(by_x, slope), slope) == pytest.approx(by_x, rel=1e-9, abs=1e-9)


def test_what_lies_on_or_beyond_a_bound_begins_a_little_inside():
    box = Box([0.0, -np.inf, 0.0], [1.0, 2.0, np.inf], [1.0, 1.0, 100.0])
    inside = box.inward(np.array([1.5, 2.0, -3.0]))
    assert 0.99 < inside[0] < 1
    assert 1.99 < inside[1] < 2
    assert 0 < inside[2] < 1
    assert box.inward(np.array([0.5, 0.0, 5.0])) == pytest.approx([0.5, 0.0, 5.0])


def test_the_traced_transform_is_the_same(rng):
    """What samplers of a posterior use, with the logarithm of its slope."""
    box, y = Box(LOWER, UPPER, SCALE), rng.normal(size=7)
    x, slope = box.bounded(y)
    traced, logs = bounded(box, jnp.asarray(y))
    np.testing.assert_allclose(traced, x, rtol=1e-12)
    np.testing.assert_allclose(logs, np.log(slope), rtol=1e-12)


@pytest.mark.parametrize(
    ("lower", "upper", "scale", "expected"),
    [(2.0, 2.5, 1.0, 0.5), (2.0, 9.0, 1.0, 1.0), (0.0, np.inf, 3.0, 3.0), (-np.inf, 4.0, 3.0, 3.0)],
)
def test_nearness_to_a_bound_goes_by_the_range_or_by_what_is_typical(lower, upper, scale, expected):
    assert width(lower, upper, scale) == expected

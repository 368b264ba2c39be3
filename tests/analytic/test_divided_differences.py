"""Divided differences of x^s ln(x)^m against quotients apart and derivatives where points meet; one rotation."""

import functools
import itertools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax import spectral
from tissuejax.tensors import Sym

quick = functools.partial(jax.jit, compiler_options={"xla_backend_optimization_level": "0"})  # compiled for one use
SHAPES = [(m, s) for m in range(5) for s in (-1.5, 2.5)]


def f(m: int, s: float, x: float) -> float:
    return x**s * math.log(x) ** m


@functools.cache
def slopes(m: int, s: float):
    """First and second derivative, by JAX of the plain formula."""
    plain = lambda x: x**s * jnp.log(x) ** m  # noqa: E731
    return jax.grad(plain), jax.grad(jax.grad(plain))


def first(m: int, s: float, x: float, y: float) -> float:
    return float(spectral._first(m, jnp.asarray(s), jnp.asarray(x), jnp.asarray(y)))


def second(m: int, s: float, *at: float) -> float:
    return float(spectral._second(m, jnp.asarray([s]), *(jnp.asarray([x]) for x in at))[0])


@pytest.mark.parametrize(("m", "s"), SHAPES)
def test_first_differences(m, s):
    for x, y in ((0.4, 2.5), (3.0, 0.7), (1.0, 1.5)):
        assert first(m, s, x, y) == pytest.approx((f(m, s, x) - f(m, s, y)) / (x - y), rel=1e-12, abs=1e-13)
    for x in (0.6, 1.0, 2.3):
        slope = float(slopes(m, s)[0](x))
        assert first(m, s, x, x) == pytest.approx(slope, rel=1e-13, abs=1e-14)
        assert first(m, s, x, x * (1 + 1e-9)) == pytest.approx(slope, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize(("m", "s"), SHAPES)
def test_second_differences_in_any_order_of_their_points(m, s):
    """Apart by the recurrence; within a tenth of the logarithm by an integral, which must be the same."""
    for low, middle, high in ((0.5, 1.3, 3.0), (0.8, 0.8, 2.0), (0.7, 1.9, 1.9), (1.2, 1.24, 1.2 * math.exp(0.099))):
        lower = (f(m, s, middle) - f(m, s, low)) / (middle - low) if middle > low else float(slopes(m, s)[0](low))
        upper = (f(m, s, high) - f(m, s, middle)) / (high - middle) if high > middle else float(slopes(m, s)[0](high))
        expected = (upper - lower) / (high - low)
        found = [second(m, s, *at) for at in itertools.permutations((low, middle, high))]
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-11)
    for x in (0.6, 1.4):
        assert second(m, s, x, x, x) == pytest.approx(0.5 * float(slopes(m, s)[1](x)), rel=1e-12, abs=1e-13)


@pytest.mark.parametrize(("m", "s"), SHAPES)
def test_curvature_is_the_second_derivative(m, s):
    x = jnp.array([0.3, 1.0, 1.8])
    expected = [float(slopes(m, s)[1](float(k))) for k in x]
    np.testing.assert_allclose(spectral._curvature(m, jnp.asarray(s), x), expected, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(
        spectral._f(m, jnp.asarray(s), x), [f(m, s, float(k)) for k in x], rtol=1e-13, atol=1e-15
    )


def test_the_quotient_of_an_exponential_and_its_derivatives_at_nothing():
    """expm1(u) / u = 1 + u / 2 + u^2 / 6 + ...: its k-th derivative at 0 is 1 / (k + 1)."""
    u = np.array([-2.0, -1.001e-3, -0.999e-3, -1e-7, 1e-7, 0.999e-3, 1.001e-3, 3.0])
    np.testing.assert_allclose(spectral._phi(jnp.asarray(u)), np.expm1(u) / u, rtol=1e-15)
    derivative = spectral._phi
    for k in range(5):
        assert float(quick(derivative)(jnp.asarray(0.0))) == pytest.approx(1 / (k + 1), rel=1e-14)
        derivative = jax.grad(derivative)


@pytest.mark.parametrize("entries", [
    [2.0, 1.0, 3.0, 0.4, 0.2, -0.3], [1.0, 2.0, 3.0, 0.4, 0.2, -0.3], [1.0, 1.0, 3.0, -0.4, 0.2, 0.0],
    [1.0, 2.0, 3.0, 0.0, 0.2, -0.3], [1.0, 1.0, 1.0, 0.0, 0.0, 0.0], [1.0, 2.0, 0.5, -0.4, 0.1, 0.6],
])  # fmt: skip
def test_a_rotation_annihilates_one_entry_and_renames_the_axes(entries):
    a = Sym(*(jnp.asarray(x) for x in entries))
    one, zero = jnp.asarray(1.0), jnp.asarray(0.0)
    turned, axes = spectral._rotation(a, ((one, zero, zero), (zero, one, zero), (zero, zero, one)))
    q = np.array(axes, float)
    np.testing.assert_allclose(q @ q.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(q) == pytest.approx(1.0, rel=1e-14)
    full = q @ np.asarray(a.matrix()) @ q.T
    np.testing.assert_allclose(turned.matrix(), full, atol=2e-15)
    assert abs(full[0, 2]) < 1e-15, "the entry of the old axes x and y"
    assert np.abs(q[:, 2]).tolist() == [0.0, 1.0, 0.0], "the old z is the new y"
    assert abs(q[0, 1]) >= math.sqrt(0.5) - 1e-12, "by an eighth of a turn at most"


def test_sums_of_powers_take_numbers_and_fields_of_exponents():
    x = jnp.array([[0.5, 1.0, 2.0], [1.5, 1.5, 0.7]])
    zero, two, four = (jnp.asarray(k) for k in (0.0, 2.0, 4.0))
    c = Sym(x[:, 0], x[:, 1], x[:, 2], zero, zero, zero)
    each, both = jnp.array([2.0, -3.0]), spectral.power_sums(c, (two, jnp.asarray(-1.0)))
    np.testing.assert_allclose(both[0], np.sum(x, axis=1), rtol=1e-13)
    np.testing.assert_allclose(both[1], np.sum(np.asarray(x) ** -0.5, axis=1), rtol=1e-13)
    field, one = spectral.power_sums(c, (each, four))
    np.testing.assert_allclose(field, np.sum(np.asarray(x) ** (np.asarray(each)[:, None] / 2), axis=1), rtol=1e-13)
    np.testing.assert_allclose(one, np.sum(np.asarray(x) ** 2, axis=1), rtol=1e-13)
    root, square = spectral.powers(c, (jnp.asarray(0.5), two))
    np.testing.assert_allclose(np.stack(root[:3], 1), np.sqrt(x), rtol=1e-13)
    np.testing.assert_allclose(np.stack(square[:3], 1), np.asarray(x) ** 2, rtol=1e-13)


def test_derivatives_in_an_exponent_raise_the_power_of_the_logarithm():
    """Of sum x^(alpha / 2) it is the sum of x^(alpha / 2) (ln x / 2)^k; of C^s along the axes x^s ln(x)^k."""
    x = np.array([0.5, 1.2, 3.0])
    c = Sym(*(jnp.asarray(k) for k in (*x, 0.0, 0.0, 0.0)))
    total = lambda alpha: spectral.power_sums(c, (alpha,))[0]  # noqa: E731
    each = lambda s: jnp.stack(spectral.powers(c, (s,))[0])  # noqa: E731
    for k in range(3):
        found, power = quick(total)(2.6), quick(each)(-0.7)
        assert float(found) == pytest.approx(np.sum(x**1.3 * (0.5 * np.log(x)) ** k), rel=1e-12)
        np.testing.assert_allclose(power, [*(x**-0.7 * np.log(x) ** k), 0.0, 0.0, 0.0], rtol=1e-12, atol=1e-15)
        total, each = jax.jacfwd(total), jax.jacfwd(each)

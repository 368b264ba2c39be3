"""Powers of tensors against matrix products and numpy's eigensolver, derivatives to the third at equal eigenvalues."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax import spectral
from tissuejax.tensors import Sym

quick = functools.partial(jax.jit, compiler_options={"xla_backend_optimization_level": "0"})  # compiled for one use
POINTS = {
    "rest": [1.0, 1.0, 1.0, 0.0, 0.0, 0.0],
    "two equal": [1.3, 0.8, 0.8, 0.0, 0.0, 0.0],
    "two nearly equal": [1.2, 0.9000001, 0.9, 1e-9, 0.0, 0.0],
    "full": [1.2, 0.9, 1.1, 0.2, -0.1, 0.3],
    "wide": [1.0, 2.0, 5.0, 0.2, 0.3, 0.1],
}


def matrix(v):
    return Sym(*v).matrix()


# Traces whose every derivative comes from products of matrices, no eigenvalue in sight.
REFERENCE = {
    6.0: lambda v: jnp.trace(matrix(v) @ matrix(v) @ matrix(v)),
    -2.0: lambda v: jnp.trace(jnp.linalg.inv(matrix(v))),
}


@functools.cache
def derivatives():
    """The first three of tr C^(alpha/2), compiled once for all points and exponents."""
    f, found = lambda v, alpha: spectral.power_sums(Sym(*v), (alpha,))[0], []
    for derivative in (jax.jacrev, jax.jacfwd, jax.jacrev):
        f = derivative(f)
        found.append(quick(f))
    return found


@pytest.mark.parametrize("alpha", REFERENCE)
@pytest.mark.parametrize("point", POINTS)
def test_three_derivatives_are_exact(point, alpha):
    v = jnp.array(POINTS[point])
    other = REFERENCE[alpha]
    for derivative in derivatives():
        other = jax.jacfwd(other)
        a, b = derivative(v, alpha), quick(other)(v)
        np.testing.assert_allclose(a, b, atol=2e-12 * float(jnp.max(jnp.abs(b))))


def test_three_forward_derivatives_too():
    f = lambda l: spectral.power_sums(Sym(l, 1.0, 1.0, 0.0, 0.0, 0.0), (5.0,))[0]  # noqa: E731
    for _ in range(3):
        f = jax.jacfwd(f)
    assert quick(f)(1.0) == pytest.approx(2.5 * 1.5 * 0.5)


def test_derivatives_in_a_traced_exponent_mix_with_those_in_the_tensor():
    # tr C^s at distinct eigenvalues: d/ds = sum x^s ln x, then in C = diag: d/dx = s x^(s-1) ln x + x^(s-1).
    x, alpha = jnp.array([1.7, 1.0, 0.6]), 2.6
    f = lambda a, x: spectral.power_sums(Sym(*x, 0.0, 0.0, 0.0), (a,))[0]  # noqa: E731
    s = alpha / 2
    want = 0.5 * (s * x ** (s - 1) * jnp.log(x) + x ** (s - 1))
    np.testing.assert_allclose(jax.jacfwd(jax.grad(f, 0), 1)(alpha, x), want, rtol=1e-13)
    np.testing.assert_allclose(jax.jacfwd(jax.grad(f, 1), 0)(alpha, x), want, rtol=1e-13)
    second = jax.grad(jax.grad(f))(alpha, x)
    np.testing.assert_allclose(second, 0.25 * jnp.sum(x**s * jnp.log(x) ** 2), rtol=1e-13)


def test_a_fourth_derivative_is_refused_not_wrong():
    f = lambda x: spectral.power_sums(Sym(x, 1.0, 1.0, 0.0, 0.0, 0.0), (3.0,))[0]  # noqa: E731
    for _ in range(4):
        f = jax.jacfwd(f)
    with pytest.raises(NotImplementedError, match="a fourth not at all"):
        jax.eval_shape(f, 1.1)


@pytest.mark.parametrize(("kind", "tolerance"), [(jnp.float64, 5e-15), (jnp.float32, 2e-6)])
def test_eigensystem_agrees_with_numpy_over_many_tensors(rng, kind, tolerance):
    # Small strains, large ones, and ratios of stretch to 30, with degenerate and diagonal ones among them.
    F = np.concatenate([np.eye(3) + scale * rng.normal(size=(3000, 3, 3)) for scale in (1e-6, 0.1, 1.0)])
    C = np.swapaxes(F, 1, 2) @ F
    C = np.concatenate([C[np.linalg.eigvalsh(C)[:, 0] > 1e-3], np.eye(3)[None], np.diag([2.0, 1.0, 1.0])[None]])
    values, vectors = spectral.eigensystem(Sym.from_matrix(jnp.asarray(C, kind)))
    want = np.linalg.eigvalsh(C)
    got = np.sort(np.stack(values, -1), -1)
    assert got.dtype == kind
    assert np.max(np.abs(got - want) / want[:, 2:]) < tolerance
    Q = np.stack([np.stack(v, -1) for v in vectors], -1)
    rebuilt = Q * np.stack(values, -1)[:, None, :] @ np.swapaxes(Q, 1, 2)
    assert np.max(np.abs(rebuilt - C) / want[:, 2:, None]) < 2 * tolerance


def test_powers_of_a_tensor():
    C = Sym(*POINTS["full"])
    root, inverse = spectral.powers(C, (0.5, -1))
    np.testing.assert_allclose(root.matrix() @ root.matrix(), C.matrix(), atol=1e-14)
    np.testing.assert_allclose(inverse.matrix() @ C.matrix(), np.eye(3), atol=1e-14)


def by_eigenvalues(m, v, s):
    """tr C^s ln(C)^m and C^s ln(C)^m by numpy, C of the components v."""
    values, vectors = np.linalg.eigh(np.asarray(matrix(v)))
    f = values**s * np.log(values) ** m
    return f.sum(), (vectors * f) @ vectors.T


@pytest.mark.parametrize("m", [0, 1, 2])
def test_powers_with_logarithms_have_the_slopes_of_numpy(m):
    v, s = np.array(POINTS["wide"]), 0.7
    dv = np.array([0.3, -0.2, 0.4, 0.1, -0.3, 0.2])
    step = 1e-5
    ahead, behind = (by_eigenvalues(m, v + e * dv, s) for e in (step, -step))
    _, trace = jax.jvp(lambda x: spectral._traces(m, Sym(*x), jnp.array([s])), (jnp.array(v),), (jnp.array(dv),))
    assert float(trace[0]) == pytest.approx((ahead[0] - behind[0]) / (2 * step), rel=1e-7)

    def slope(s):  # of the tensor, along dv
        return spectral._derivative(m, Sym(*jnp.array(v)), jnp.array([s]), Sym(*jnp.array(dv)))

    one, other = ([by_eigenvalues(m, v + e * dv, t)[1] for e in (step, -step)] for t in (s + step, s - step))
    mixed = ((one[0] - one[1]) - (other[0] - other[1])) / (4 * step**2)
    _, found = jax.jvp(slope, (s,), (1.0,))
    assert np.asarray(found.matrix())[0] == pytest.approx(mixed, abs=1e-4 * np.max(np.abs(mixed)))

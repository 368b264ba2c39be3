"""Powers of symmetric 3x3 tensors and their traces, differentiable where eigenvalues meet.

Energies in principal stretches need sum_i l_i^alpha = tr C^(alpha/2). Differentiating an eigensolver divides by
differences of eigenvalues, which vanish at rest and all along a uniaxial test. Here three facts replace that:

- d tr f(C) = f'(C) : dC, with no difference of eigenvalues at all;
- d f(C) = Q (f[l_i, l_j] o Q^T dC Q) Q^T (Daleckii and Krein; Higham 2008, theorem 3.11), with the divided
  difference f[x, y] of a power written in expm1, so that it is exact at x = y and free of cancellation nearby;
- d2 f(C) by second divided differences f[x, y, z], from their integral where the three are close: third derivatives
  of an energy, forward throughout or with reverse outermost (other orders, and a fourth, are refused).

All functions have the form f(x) = x^s ln(x)^m, as differentiating in s raises m by one; so exponents may be traced.
Eigenvalues come from a fixed number of branch-free cyclic Jacobi rotations on components (Golub and Van Loan
2013, 8.5): no difference between one point and a million, float32 and float64 alike.
"""

import itertools
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.tensors import Sym, double_dot, total

SWEEPS = 4  # quadratic convergence: 4 reach float64 round-off (tests, also at widely spread eigenvalues)
CLOSE = 0.1  # below this spread of ln(eigenvalue) second divided differences are integrated
UPPER = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # order of the components of Sym
Vector = tuple[Either, Either, Either]


def eigensystem(C: Sym) -> tuple[Vector, tuple[Vector, Vector, Vector]]:
    """Eigenvalues (unsorted) and unit eigenvectors of a symmetric tensor. Not differentiable; see below."""
    return _eigensystem(Sym(*jnp.broadcast_arrays(*C)))


def power_sums(C: Sym, alphas: tuple[Float[Either, "..."], ...]) -> tuple[Float[Either, "..."], ...]:
    """sum_i l_i^alpha for each alpha, l_i^2 the eigenvalues of C (l_i: principal stretches); it is tr C^(alpha/2)."""
    C, s = _prepared(C, alphas)
    return tuple(_traces(0, C, 0.5 * s))


def powers(C: Sym, exponents: tuple[Float[Either, "..."], ...]) -> tuple[Sym, ...]:
    """C^s for each exponent s (any real, traced or not) of a positive definite symmetric tensor."""
    C, s = _prepared(C, exponents)
    together = _powers(0, C, s)
    return tuple(Sym(*(c[k] for c in together)) for k in range(len(exponents)))


def _prepared(C: Sym, exponents: tuple[Either, ...]) -> tuple[Sym, Either]:
    """One dtype and shape for the components, and the exponents along a new first axis (less for the compiler)."""
    kind = jnp.result_type(*C, *exponents, float)
    C = Sym(*jnp.broadcast_arrays(*(jnp.asarray(c, dtype=kind) for c in C)))
    exponents = tuple(jnp.asarray(s, dtype=kind) for s in exponents)
    one_each = all(s.ndim == 0 for s in exponents)
    shape = (1,) * C.xx.ndim if one_each else C.xx.shape
    return C, jnp.stack([jnp.broadcast_to(s, shape) for s in exponents])


# --- f(x) = x^s ln(x)^m as trace and as tensor, each with its derivative ----------------------------------------------
# C has components of shape `...`, s has shape `k ...` (or `k 1...`): results have the axis of exponents first.


def _f(m: int, s: Either, x: Either) -> Either:
    log = jnp.log(x)
    return jnp.exp(s * log) * log**m if m else jnp.exp(s * log)


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def _traces(m: int, C: Sym, s: Float[Either, "k ..."]) -> Float[Either, "k ..."]:
    """tr C^s ln(C)^m."""
    values, _ = _eigensystem(C)
    return total(_f(m, s, x) for x in values)


@partial(_traces.defjvp, symbolic_zeros=True)
def _traces_jvp(m, primals, tangents):
    (C, s), (dC, ds) = primals, tangents
    dC, along_C = _tangent(dC)
    value = _traces(m, C, s)
    out = jnp.zeros_like(value)
    if along_C:  # f'(C) : dC, f' = s x^(s-1) ln^m + m x^(s-1) ln^(m-1)
        out = s * double_dot(_powers(m, C, s - 1), dC)
        if m:
            out = out + m * double_dot(_powers(m - 1, C, s - 1), dC)
    if not isinstance(ds, SymbolicZero):
        out = out + _traces(m + 1, C, s) * ds
    return value, out


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def _powers(m: int, C: Sym, s: Float[Either, "k ..."]) -> Sym:
    """C^s ln(C)^m."""
    values, vectors = _eigensystem(C)
    return _assemble(vectors, {(i, i): _f(m, s, x) for i, x in enumerate(values)})


@partial(_powers.defjvp, symbolic_zeros=True)
def _powers_jvp(m, primals, tangents):
    (C, s), (dC, ds) = primals, tangents
    dC, along_C = _tangent(dC)
    value = _powers(m, C, s)
    out = _derivative(m, C, s, dC) if along_C else Sym(*map(jnp.zeros_like, value))
    if not isinstance(ds, SymbolicZero):
        out = _added(out, _powers(m + 1, C, s), ds)
    return value, out


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def _derivative(m: int, C: Sym, s: Float[Either, "k ..."], H: Sym) -> Sym:
    """Derivative of C^s ln(C)^m in the direction H (Daleckii and Krein)."""
    values, vectors = _eigensystem(C)
    h = _in_eigenframe(vectors, H)
    return _assemble(vectors, {(i, j): _first(m, s, values[i], values[j]) * h[i, j] for i, j in UPPER})


@partial(_derivative.defjvp, symbolic_zeros=True)
def _derivative_jvp(m, primals, tangents):
    (C, s, H), (dC, ds, dH) = primals, tangents
    dC, along_C = _tangent(dC)
    dH, along_H = _tangent(dH)
    value = _derivative(m, C, s, H)
    out = _derivative(m, C, s, dH) if along_H else Sym(*map(jnp.zeros_like, value))
    if along_C:
        out = _added(out, _second_derivative(m, C, s, H, dC))
    if not isinstance(ds, SymbolicZero):
        out = _added(out, _derivative(m + 1, C, s, H), ds)
    return value, out


def _second_derivative(m: int, C: Sym, s: Float[Either, "k ..."], H: Sym, K: Sym) -> Sym:
    """Second derivative of C^s ln(C)^m in the directions H and K."""
    values, vectors = _eigensystem(C)
    h, k = _in_eigenframe(vectors, H), _in_eigenframe(vectors, K)
    triples = itertools.combinations_with_replacement(range(3), 3)
    f = {triple: _second(m, s, *(values[q] for q in triple)) for triple in triples}
    frame = {
        (i, j): total(f[_ordered(i, n, j)] * (h[i, n] * k[n, j] + k[i, n] * h[n, j]) for n in range(3))
        for i, j in UPPER
    }
    return _assemble(vectors, frame)


# --- divided differences ----------------------------------------------------------------------------------------------


def _phi(u: Either) -> Either:
    """expm1(u) / u, with value and derivatives right at u = 0."""
    near = jnp.abs(u) < 1e-3
    safe = jnp.where(near, 1.0, u)
    return jnp.where(near, 1 + u / 2 * (1 + u / 3 * (1 + u / 4 * (1 + u / 5))), jnp.expm1(safe) / safe)


def _first(m: int, s: Either, x: Either, y: Either) -> Either:
    """f[x, y] = (f(x) - f(y)) / (x - y), f'(x) at x = y, without cancellation."""
    log_x, log_y = jnp.log(x), jnp.log(y)
    u = log_x - log_y
    log_difference = 1 / (y * _phi(u))
    difference = s * jnp.exp(s * log_y) * _phi(s * u) * log_difference
    for lower in range(m):  # product rule of divided differences, f = (x^s ln^lower) ln
        difference = difference * log_x + _f(lower, s, y) * log_difference
    return difference


# Gauss points (a, a b) and weights of the triangle 0 <= t2 <= t1 <= 1, each along one axis of 25.
_G, _W = (0.5 * g for g in np.polynomial.legendre.leggauss(5))
_A, _B = (g.ravel() for g in np.meshgrid(_G + 0.5, _G + 0.5, indexing="ij"))
_WEIGHTS = np.outer(_W, _W).ravel() * _A


def _second(m: int, s: Either, x: Either, y: Either, z: Either) -> Either:
    """f[x, y, z]: by the recurrence on the two that are farthest apart, by its integral where all three are close."""
    low, high = jnp.minimum(jnp.minimum(x, y), z), jnp.maximum(jnp.maximum(x, y), z)
    middle = jnp.maximum(jnp.minimum(x, y), jnp.minimum(jnp.maximum(x, y), z))
    close = jnp.log(high) - jnp.log(low) < CLOSE
    gap = jnp.where(close, 1.0, high - low)
    apart = (_first(m, s, high, middle) - _first(m, s, middle, low)) / gap
    a, b, weight = (jnp.asarray(g, x.dtype).reshape(-1, *[1] * s.ndim) for g in (_A, _B, _WEIGHTS))
    points = low + a * (middle - low) + a * b * (high - middle)  # Hermite-Genocchi: mean of f'' over the triangle
    integral = jnp.sum(weight * _curvature(m, s, points), axis=0)
    return jnp.where(close, integral, apart)


def _curvature(m: int, s: Either, x: Either) -> Either:
    """f''(x)."""
    curvature = s * (s - 1) * _f(m, s - 2, x)
    if m >= 1:
        curvature = curvature + m * (2 * s - 1) * _f(m - 1, s - 2, x)
    if m >= 2:
        curvature = curvature + m * (m - 1) * _f(m - 2, s - 2, x)
    return curvature


# --- components -------------------------------------------------------------------------------------------------------


@jax.custom_jvp
@jax.jit
def _eigensystem(C: Sym) -> tuple[Vector, tuple[Vector, Vector, Vector]]:
    one, zero = jnp.ones_like(C.xx), jnp.zeros_like(C.xx)
    start = C, ((one, zero, zero), (zero, one, zero), (zero, zero, one))
    # A loop, not unrolled: the compiler's time grows faster than the number of operations it sees at once.
    A, v = jax.lax.fori_loop(0, 3 * SWEEPS, lambda _, state: _rotation(*state), start)
    return (A.xx, A.yy, A.zz), v


def _rotation(A: Sym, v: tuple[Vector, ...]) -> tuple[Sym, tuple[Vector, ...]]:
    """Annihilate the xy entry by a rotation, then rename the axes x y z to z x y, so that three calls make a sweep."""
    d, off = A.yy - A.xx, 2 * A.xy
    reach = jnp.abs(d) + jnp.sqrt(d * d + off * off)
    t = jnp.where(d >= 0, off, -off) / jnp.where(reach > 0, reach, 1.0)
    c = 1 / jnp.sqrt(t * t + 1)
    s = t * c
    xx, yy = A.xx - t * A.xy, A.yy + t * A.xy
    xz, yz = c * A.xz - s * A.yz, s * A.xz + c * A.yz
    (x0, x1, x2), (y0, y1, y2) = v[0], v[1]
    x = (c * x0 - s * y0, c * x1 - s * y1, c * x2 - s * y2)
    y = (s * x0 + c * y0, s * x1 + c * y1, s * x2 + c * y2)
    return Sym(xx=yy, yy=A.zz, zz=xx, xy=yz, xz=jnp.zeros_like(t), yz=xz), (y, v[2], x)


@_eigensystem.defjvp
def _eigensystem_jvp(primals, tangents):
    # Only reached where a linear part was separated from its rule: by a fourth derivative, or forward over reverse over
    # another. A formula in 1 / (l_i - l_j) would answer, wrongly at equal stretches.
    raise NotImplementedError(
        "no such derivative of an energy in principal stretches: the first two in C come in any order, a third "
        "only with reverse mode outermost or forward mode throughout, a fourth not at all"
    )


def _tangent(d: Sym) -> tuple[Sym, bool]:
    """A tangent with symbolic zeros filled in, and whether there is anything in it."""
    some = any(not isinstance(x, SymbolicZero) for x in d)
    return Sym(*(jnp.zeros(x.shape, x.dtype) if isinstance(x, SymbolicZero) else x for x in d)), some


def _added(A: Sym, B: Sym, factor: Either | float = 1.0) -> Sym:
    return Sym(*(a + b * factor for a, b in zip(A, B)))


def _ordered(i: int, j: int, k: int) -> tuple[int, int, int]:
    a, b, c = sorted((i, j, k))
    return a, b, c


def _assemble(v: tuple[Vector, ...], frame: dict[tuple[int, int], Either]) -> Sym:
    """sum_ij frame_ij v_i v_j^T, frame given by its upper triangle (absent entries are zero)."""

    def entry(k: int, l: int) -> Either:
        return total(
            x * (v[i][k] * v[i][l] if i == j else v[i][k] * v[j][l] + v[j][k] * v[i][l]) for (i, j), x in frame.items()
        )

    return Sym(*(entry(k, l) for k, l in UPPER))


def _in_eigenframe(v: tuple[Vector, ...], H: Sym) -> dict[tuple[int, int], Either]:
    """v_i . H v_j for all i, j."""
    rows = ((H.xx, H.xy, H.xz), (H.xy, H.yy, H.yz), (H.xz, H.yz, H.zz))
    Hv = [tuple(sum(h * x for h, x in zip(row, vj)) for row in rows) for vj in v]
    frame = {(i, j): total(x * y for x, y in zip(v[i], Hv[j])) for i in range(3) for j in range(i, 3)}
    return frame | {(j, i): h for (i, j), h in frame.items()}

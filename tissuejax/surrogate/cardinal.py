"""Cubic splines on uniform breakpoints in one to three variables, cheap to ask in any language.

A table over x, y and s holds coefficients c of uniform cubic B-splines: with t = (x - origin) / spacing, i = floor(t)
and u = t - i, the value is sum_k B_k(u) c_(i+k), k = 0..3, in each axis. An axis of n intervals has n + 3
coefficients. Interpolation is with "not-a-knot" ends, as is usual (de Boor 1978, ch. IV).
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.interpolate import make_interp_spline


def four(u) -> tuple:
    """The four basis functions at u in [0, 1], of a number or an array."""
    v = 1.0 - u
    return v**3 / 6, ((3 * u - 6) * u * u + 4) / 6, ((3 * v - 6) * v * v + 4) / 6, u**3 / 6


def four_slopes(u) -> tuple:
    """Their derivatives by u."""
    v = 1.0 - u
    return -v * v / 2, (3 * u - 4) * u / 2, -(3 * v - 4) * v / 2, u * u / 2


def weights(u, xp=jnp):
    """The basis functions as one array, (4, ...)."""
    return xp.stack(four(u))


def slopes(u, xp=jnp):
    """Their derivatives by u, (4, ...)."""
    return xp.stack(four_slopes(u))


def design(t: Float[np.ndarray, " m"], intervals: int, derivative: bool = False) -> Float[np.ndarray, "m c"]:
    """Rows that give the value (or slope per spacing) at t, in spacings, from the coefficients of an axis."""
    i = np.clip(np.floor(t).astype(int), 0, intervals - 1)
    row = (slopes if derivative else weights)(t - i, np).T
    out = np.zeros((len(t), intervals + 3))
    np.put_along_axis(out, i[:, None] + np.arange(4), row, 1)
    return out


def through(n: int) -> Float[np.ndarray, "c n"]:
    """Coefficients from values at n places 0, 1, ... n - 1 (not-a-knot; a polynomial for fewer than four)."""
    if n == 1:
        return np.ones((4, 1))  # a constant: the basis sums to one
    fine = np.linspace(0, n - 1, 8 * n)
    values = make_interp_spline(np.arange(n), np.eye(n), k=min(3, n - 1))(fine)
    return np.linalg.lstsq(design(fine, max(n - 1, 1)), values, rcond=None)[0]


def _from_inside(rows: Float[np.ndarray, "n c"]) -> Float[np.ndarray, "c n"]:
    """Coefficients on [0, n] from n conditions; the third derivative is continuous at 1, 2 and n - 1."""
    n = len(rows)
    if n < 4:
        raise ValueError("at least four depths are needed by a cubic spline that starts at contact")
    jump = np.zeros((3, n + 3))
    for row, at in zip(jump, (1, 2, n - 1)):
        row[at : at + 4] += (-1, 3, -3, 1)
        row[at - 1 : at + 3] -= (-1, 3, -3, 1)
    return np.linalg.solve(np.concatenate([rows, jump]), np.eye(n + 3))[:, :n]


def from_depths(n: int) -> Float[np.ndarray, "c n"]:
    """Coefficients on s in [0, 1] from values at s = 1/n, 2/n, ... 1: nothing is told at s = 0, first contact."""
    return _from_inside(design(np.arange(1, n + 1.0), n))


def energy_from_force(n: int) -> Float[np.ndarray, "c n"]:
    """Coefficients of w(s) from g = (5 w + s dw/ds) / 2 at s = 1/n, ... 1.

    With depth d = D s^2 and force d^1.5 g(s), the work over depth is D^2.5 s^5 w(s).
    """
    s = np.arange(1, n + 1.0)
    return _from_inside((5 * design(s, n) + s[:, None] * design(s, n, derivative=True)) / 2)


class Table(eqx.Module):
    """A tensor-product spline with M values at a place.

    Attributes:
        origin, spacing: of each axis.
        coefficients: one axis a variable, then the M values.
    """

    origin: Float[Array, " k"]
    spacing: Float[Array, " k"]
    coefficients: Float[Array, "..."]

    def __call__(self, place: Float[Array, " k"], derivative: int | None = None) -> Float[Array, " M"]:
        """The values at one place, or their derivatives by one of the variables; outside the axes the outermost pieces
        go on. Pure JAX."""
        t = (place - self.origin) / self.spacing
        *counts, last = self.coefficients.shape
        i = jnp.clip(jnp.floor(jax.lax.stop_gradient(t)).astype(int), 0, jnp.asarray(counts) - 4)
        some = jax.lax.dynamic_slice(self.coefficients, (*i, 0), (*(4,) * len(counts), last))
        rows = weights(t - i)
        if derivative is not None:
            rows = rows.at[:, derivative].set(slopes(t[derivative] - i[derivative]) / self.spacing[derivative])
        product = rows[:, 0]
        for axis in range(1, len(counts)):
            product = product[..., None] * rows[:, axis]
        return product.ravel() @ some.reshape(-1, last)

    def sample(self, places: Float[np.ndarray, "m k"]) -> Float[np.ndarray, "m M"]:
        """The values at many places, on the host."""
        out = np.asarray(self.coefficients, float)
        where = (np.asarray(places, float) - np.asarray(self.origin)) / np.asarray(self.spacing)
        rows = [design(t, n - 3) for t, n in zip(where.T, out.shape)]
        out = np.einsum("mi,i...->m...", rows[0], out)
        for row in rows[1:]:
            out = np.einsum("mi,mi...->m...", row, out)
        return out


def table(origin, spacing, values: Float[np.ndarray, "..."], matrices) -> Table:
    """A table from values at the nodes; `matrices` lead each axis from values to coefficients."""
    for axis, matrix in enumerate(matrices):
        values = np.moveaxis(np.tensordot(matrix, values, (1, axis)), 0, axis)
    return Table(np.asarray(origin, float), np.asarray(spacing, float), values)

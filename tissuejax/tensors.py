"""Small 3x3 algebra on components, for one point or for any number at once.

A symmetric tensor is six arrays `(c11, c22, c33, c12, c13, c23)` of one shape, a general one nine, row by
row. Keeping components apart (element axis last) is what lets XLA vectorise over elements; the same code
serves a single material point with scalars.
"""

import operator
from collections.abc import Iterable
from functools import reduce
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Float

from tissuejax.arrays import Either


def total(terms: Iterable[Either]) -> Either:
    """The sum of at least one array; unlike `sum` it begins with the first and not with the integer 0."""
    return reduce(operator.add, terms)


class Sym(NamedTuple):
    """Symmetric 3x3 tensor by components; each entry has one common shape `...`."""

    xx: Float[Either, "..."]
    yy: Float[Either, "..."]
    zz: Float[Either, "..."]
    xy: Float[Either, "..."]
    xz: Float[Either, "..."]
    yz: Float[Either, "..."]

    @classmethod
    def from_matrix(cls, m: Float[Either, "... 3 3"]) -> "Sym":
        """Components of the symmetric part of `m`."""
        m = 0.5 * (m + jnp.swapaxes(m, -1, -2))
        return cls(m[..., 0, 0], m[..., 1, 1], m[..., 2, 2], m[..., 0, 1], m[..., 0, 2], m[..., 1, 2])

    def matrix(self) -> Float[Either, "... 3 3"]:
        """As full matrices."""
        xx, yy, zz, xy, xz, yz = self
        rows = [jnp.stack(r, -1) for r in ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))]
        return jnp.stack(rows, -2)


def trace(c: Sym) -> Float[Either, "..."]:
    """tr C."""
    return c.xx + c.yy + c.zz


def trace_of_square(c: Sym) -> Float[Either, "..."]:
    """C : C = tr C^2 of a symmetric tensor."""
    return c.xx**2 + c.yy**2 + c.zz**2 + 2 * (c.xy**2 + c.xz**2 + c.yz**2)


def double_dot(a: Sym, b: Sym) -> Float[Either, "..."]:
    """a : b = tr(a b) of two symmetric tensors."""
    return a.xx * b.xx + a.yy * b.yy + a.zz * b.zz + 2 * (a.xy * b.xy + a.xz * b.xz + a.yz * b.yz)


def determinant(c: Sym) -> Float[Either, "..."]:
    """det C."""
    return c.xx * (c.yy * c.zz - c.yz * c.yz) - c.xy * (c.xy * c.zz - c.yz * c.xz) + c.xz * (c.xy * c.yz - c.yy * c.xz)


def right_cauchy_green(F: Float[Either, "... 3 3"]) -> Sym:
    """C = F^T F (Lister 2012, 4.3.2 prints F F^T, a slip)."""
    return Sym.from_matrix(jnp.swapaxes(F, -1, -2) @ F)

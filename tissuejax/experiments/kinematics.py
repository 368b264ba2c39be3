"""Deformation of a homogeneous specimen and the nominal stress that goes with it, axes (loaded, second, free)."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.effects.material_test import MaterialTest
from tissuejax.tensors import Sym


class Gradient(NamedTuple):
    """F = [[a, g, 0], [0, b, 0], [0, 0, c]]; entries of one shape."""

    a: Float[Array, "..."]
    b: Float[Array, "..."]
    c: Float[Array, "..."]
    g: Float[Array, "..."]


def deformation(
    test: MaterialTest, drive: Float[Array, "..."], ln_J: Float[Array, "..."], skew: Float[Array, "..."]
) -> Gradient:
    """F from what is driven and what the free faces do.

    Args:
        test: the kind of test.
        drive: stretch, two stretches (last axis), or shear.
        ln_J: logarithm of the volume ratio; 0 is incompressible.
        skew: half the logarithm of b/c in a uniaxial test beyond what isotropy gives; without effect elsewhere.
    """
    if test.mode == "biaxial":
        a, b, g = drive[..., 0], drive[..., 1], jnp.zeros_like(drive[..., 0])
    elif test.mode == "shear":
        one = jnp.ones_like(drive)
        a, b, g = one * test.axial**-0.5, one * test.axial, drive
    else:
        a, g = drive, jnp.zeros_like(drive)
        b = a**test.second * jnp.exp(test.swell * (ln_J + 2 * skew))
    return Gradient(a, b, jnp.exp(ln_J) / (a * b), g)


def right_cauchy_green(F: Gradient) -> Sym:
    """C = F^T F."""
    zero = jnp.zeros_like(F.a)
    return Sym(F.a * F.a, F.b * F.b + F.g * F.g, F.c * F.c, F.a * F.g, zero, zero)


def in_sample(C: Sym, frame: Float[Array, "3 3"]) -> Sym:
    """C in the sample's own frame, from the test's axes (rows of `frame`), where it has no shear out of the plane."""
    first, second, third = frame
    shear = jnp.outer(first, second) + jnp.outer(second, first)
    parts = jnp.stack([jnp.outer(first, first), jnp.outer(second, second), jnp.outer(third, third), shear], -1)
    rows, columns = jnp.array([0, 1, 2, 0, 0, 1]), jnp.array([0, 1, 2, 1, 2, 2])
    return Sym(*(parts[rows, columns] @ jnp.stack([C.xx, C.yy, C.zz, C.xy]).reshape(4, -1)).reshape(6, *C.xx.shape))


def hydrostatic(S: Sym, F: Gradient) -> Float[Array, "..."]:
    """Hydrostatic Kirchhoff stress that makes the third face free, Pa: tau_33 = S_33 c^2 + this = 0."""
    return -S.zz * F.c * F.c


def nominal(test: MaterialTest, S: Sym, F: Gradient) -> Float[Array, "..."]:
    """Nominal stress from the isochoric PK2 stress and the free third face, Pa.

    P = F (S + tau_h C^-1), with tau_h from `hydrostatic`; the first index is the direction of the force, the second
    the normal of the reference face. Source: Holzapfel 2000, eq. 6.63 (pressure from a boundary condition).
    """
    tau = hydrostatic(S, F)
    det = (F.a * F.b) ** 2
    S_11 = S.xx + tau * (F.b * F.b + F.g * F.g) / det
    S_22 = S.yy + tau * F.a * F.a / det
    S_12 = S.xy - tau * F.a * F.g / det
    if test.mode == "shear":
        return F.a * S_12 + F.g * S_22
    P_11 = F.a * S_11 + F.g * S_12
    return jnp.stack([P_11, F.b * S_22], -1) if test.mode == "biaxial" else P_11

"""Stresses and the tangent, all derivatives of the energy and nothing else.

With S = 2 dPsi/dC (source eq. 4.25 prints it without the factor 2, its appendix A with it) and Psi = psi_iso + U(J)
follow P = F S, sigma = F S F^T / J and the material tangent dS/dE = 4 d2Psi/dCdC. All works component by component
on `Sym`, so a trailing element axis is vectorised by XLA, and differentiates further (jvp of grad, vjp of grad, vmap).
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.energy import Energy
from tissuejax.energies.strain import Strain
from tissuejax.energies.volumetric import Volumetric
from tissuejax.parameters import Constants
from tissuejax.tensors import Sym, right_cauchy_green

Values = Constants


def energy_density(
    energy: Energy, volumetric: Volumetric | None, p_energy: Values, p_volumetric: Values | None, C: Sym
) -> Float[Either, "..."]:
    """Psi = psi_iso(C) + U(J), Pa; `volumetric` None leaves U out (incompressible: pressure from elsewhere)."""
    strain = Strain.of(C)
    psi = energy.isochoric(p_energy, strain)
    if volumetric is None:
        return psi
    assert p_volumetric is not None, "a volumetric energy without its parameters"
    return psi + volumetric.energy(p_volumetric, strain.J)


def pk2_isochoric(energy: Energy, p: Values, C: Sym) -> Sym:
    """Isochoric second Piola-Kirchhoff stress S_iso = 2 d psi_iso / dC, Pa, at each point of `C`; S : C = 0."""
    return _twice_gradient(lambda c: energy_density(energy, None, p, None, c), C)


def pk2(energy: Energy, volumetric: Volumetric | None, p_energy: Values, p_volumetric: Values | None, C: Sym) -> Sym:
    """Second Piola-Kirchhoff stress S = 2 dPsi/dC, Pa, at each point of `C`.

    Args:
        energy, p_energy: isochoric energy and its parameters by name.
        volumetric, p_volumetric: volumetric energy and its parameters, or None and None.
        C: right Cauchy-Green tensor; entries of any one shape.
    """
    return _twice_gradient(lambda c: energy_density(energy, volumetric, p_energy, p_volumetric, c), C)


def pk1(
    energy: Energy,
    volumetric: Volumetric | None,
    p_energy: Values,
    p_volumetric: Values | None,
    F: Float[Either, "... 3 3"],
) -> Float[Either, "... 3 3"]:
    """First Piola-Kirchhoff (nominal) stress P = F S, Pa: force per reference area, second index the normal."""
    return F @ pk2(energy, volumetric, p_energy, p_volumetric, right_cauchy_green(F)).matrix()


def cauchy(
    energy: Energy,
    volumetric: Volumetric | None,
    p_energy: Values,
    p_volumetric: Values | None,
    F: Float[Either, "... 3 3"],
) -> Float[Either, "... 3 3"]:
    """Cauchy (true) stress sigma = F S F^T / J, Pa."""
    P = pk1(energy, volumetric, p_energy, p_volumetric, F)
    return P @ jnp.swapaxes(F, -1, -2) / jnp.linalg.det(F)[..., None, None]


def tangent(
    energy: Energy, volumetric: Volumetric | None, p_energy: Values, p_volumetric: Values | None, C: Sym
) -> Float[Either, "... 6 6"]:
    """Material tangent dS/dE = 4 d2Psi/dCdC in Voigt form, Pa: rows S and columns E in the order xx yy zz xy xz yz.

    Shear columns are per engineering shear 2 E_xy, so that the matrix is symmetric.
    """

    def column(direction: Float[Either, "6"]) -> Float[Either, "6 ..."]:
        dC = Sym(*(d * jnp.ones_like(c) for d, c in zip(direction, C)))
        _, dS = jax.jvp(lambda c: pk2(energy, volumetric, p_energy, p_volumetric, c), (C,), (dC,))
        return jnp.stack(dS)

    # dC = 2 dE: a unit normal strain moves C by 2, a unit engineering shear moves its off-diagonal entry by 1.
    directions = jnp.diag(jnp.array([2.0, 2.0, 2.0, 1.0, 1.0, 1.0], dtype=jnp.result_type(*C)))
    return jnp.moveaxis(jax.vmap(column)(directions), (1, 0), (-2, -1))


def _twice_gradient(psi: Callable[[Sym], Either], C: Sym) -> Sym:
    """2 dpsi/dC. An off-diagonal component stands for two entries of C, so its derivative is doubled already."""
    g = jax.grad(lambda c: jnp.sum(psi(c)))(Sym(*(jnp.asarray(x) for x in C)))
    return Sym(2 * g.xx, 2 * g.yy, 2 * g.zz, g.xy, g.xz, g.yz)

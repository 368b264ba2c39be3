"""A fibre family that adds to any energy: Holzapfel-Gasser-Ogden, in tension only."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.barrier import expm1
from tissuejax.energies.energy import Energy
from tissuejax.energies.strain import Strain
from tissuejax.parameters import Constants, Parameter

ONSET = 1e-3  # of E: over it the fibres take up load; above it the formula is exact


class WithFibre(Energy):
    """psi = matrix + k1/(2 k2) (exp(k2 <E>^2) - 1), E = kappa (I1bar - 3) + (1 - 3 kappa) (I4bar - 1).

    I4bar is the squared isochoric stretch along (cos angle, sin angle, 0); kappa is the dispersion, 0 aligned, 1/3
    isotropic. <E> is 0 for E < 0, E for E > 1e-3 and a quartic between, so that fibres carry tension only and yet the
    stress is continuously differentiable. They add nothing to the shear modulus at rest.
    Source: Gasser, Ogden and Holzapfel 2006, J. R. Soc. Interface 3, eq. 3.5.
    """

    name: ClassVar[str] = "+fibre"
    formula: ClassVar[str] = "k1/(2 k2) (exp(k2 <E>^2) - 1), E = kappa (I1bar - 3) + (1 - 3 kappa) (I4bar - 1)"
    shear_modulus: ClassVar[str] = "that of the matrix"
    source: ClassVar[str] = "Gasser, Ogden and Holzapfel 2006, eq. 3.5"
    isotropic: ClassVar[bool] = False
    families: ClassVar[int] = 1
    matrix: Energy

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            *self.matrix.parameters,
            Parameter("k1", "Pa", 1000.0, lower=0.0, meaning="stiffness of the fibres"),
            Parameter("k2", "1", 1.0, lower=0.0, upper=1e3, meaning="stiffening of the fibres"),
            Parameter("kappa", "1", 0.1, lower=0.0, upper=1 / 3, meaning="dispersion: 0 aligned, 1/3 isotropic"),
            Parameter("angle", "rad", 0.0, lower=-3.2, upper=3.2, scale=1.0, meaning="direction from axis 1 to 2"),
        )

    def isochoric(self, p: Constants, strain: Strain) -> Float[Either, "..."]:
        return self.matrix.isochoric(p, strain) + family(p, strain, p["kappa"], p["angle"])

    def initial_shear_modulus(self, p: Constants) -> Float[Either, ""]:
        return self.matrix.initial_shear_modulus(p)

    def margin(self, p: Constants, strain: Strain) -> Float[Either, "..."]:
        return self.matrix.margin(p, strain)

    def angles(self, p: Constants) -> tuple[Either, ...]:
        """Direction of each family from axis 1 to 2, rad."""
        return (p["angle"],)


def family(p: Constants, strain: Strain, kappa: Either | float, angle: Either) -> Float[Either, "..."]:
    """Energy of one family, k1/(2 k2) (exp(k2 <E>^2) - 1), Pa, with dispersion `kappa` about `angle`."""
    along = strain.fibre_stretch_squared(jnp.cos(angle), jnp.sin(angle))
    E = kappa * (strain.I1 - 3) + (1 - 3 * kappa) * (along - 1)
    return 0.5 * p["k1"] / p["k2"] * expm1(p["k2"] * _positive(E) ** 2)


def _positive(E: Float[Either, "..."]) -> Float[Either, "..."]:
    """0 below 0, E above ONSET; between, a quartic that meets E twice smoothly and keeps W'' positive."""
    onset = E * (1 - (1 - E / ONSET) ** 3)
    return jnp.where(E >= ONSET, E, jnp.where(E > 0, onset, 0.0))

"""Demiray: exponential stiffening of soft tissue, one exponent."""

from typing import ClassVar

from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.barrier import expm1
from tissuejax.energies.energy import Energy
from tissuejax.energies.strain import Strain
from tissuejax.parameters import Constants, Parameter


class Demiray(Energy):
    """psi = mu/(2 b) (exp(b (I1bar - 3)) - 1).

    Shear modulus at rest mu; nominal stress in uniaxial tension mu exp(b (I1 - 3)) (l - 1/l^2).
    Source: Demiray 1972, J. Biomech. 5 (with alpha = b and beta = mu).
    """

    name: ClassVar[str] = "demiray"
    formula: ClassVar[str] = "mu/(2 b) (exp(b (I1bar - 3)) - 1)"
    shear_modulus: ClassVar[str] = "mu"
    source: ClassVar[str] = "Demiray 1972"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("mu", "Pa", 1000.0, lower=0.0, meaning="initial shear modulus"),
            Parameter("b", "1", 1.0, lower=0.0, upper=1e3, meaning="stiffening"),
        )

    def isochoric(self, p: Constants, strain: Strain) -> Float[Either, "..."]:
        return 0.5 * p["mu"] / p["b"] * expm1(p["b"] * (strain.I1 - 3))

    def initial_shear_modulus(self, p: Constants) -> Float[Either, ""]:
        return p["mu"]

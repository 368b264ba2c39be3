"""Veronda-Westmann: exponential in I1 less a linear term in I2, made for skin."""

from typing import ClassVar

from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.barrier import expm1
from tissuejax.energies.energy import Energy
from tissuejax.energies.strain import Strain
from tissuejax.parameters import Constants, Parameter


class VerondaWestmann(Energy):
    """psi = C1 (exp(C2 (I1bar - 3)) - 1) - C1 C2/2 (I2bar - 3).

    Shear modulus at rest C1 C2; nominal stress in uniaxial tension 2 C1 C2 (l - 1/l^2) (exp(C2 (I1 - 3)) - 1/(2 l)).
    Source: Veronda and Westmann 1970, J. Biomech. 3.
    """

    name: ClassVar[str] = "veronda-westmann"
    formula: ClassVar[str] = "C1 (exp(C2 (I1bar - 3)) - 1) - C1 C2/2 (I2bar - 3)"
    shear_modulus: ClassVar[str] = "C1 C2"
    source: ClassVar[str] = "Veronda and Westmann 1970"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("C1", "Pa", 1000.0, lower=0.0, meaning="initial shear modulus over C2"),
            Parameter("C2", "1", 1.0, lower=0.0, upper=1e3, meaning="stiffening"),
        )

    def isochoric(self, p: Constants, strain: Strain) -> Float[Either, "..."]:
        return p["C1"] * (expm1(p["C2"] * (strain.I1 - 3)) - 0.5 * p["C2"] * (strain.I2 - 3))

    def initial_shear_modulus(self, p: Constants) -> Float[Either, ""]:
        return p["C1"] * p["C2"]

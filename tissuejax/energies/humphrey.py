"""Humphrey-type exponential: the isotropic part of Humphrey and Yin's heart muscle."""

from typing import ClassVar

from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.barrier import expm1
from tissuejax.energies.energy import Energy
from tissuejax.energies.strain import Strain
from tissuejax.parameters import Constants, Parameter


class Humphrey(Energy):
    """psi = C1 (exp(C2 (I1bar - 3)) - 1).

    Shear modulus at rest 2 C1 C2. The same function as Demiray's with mu = 2 C1 C2 and b = C2; published numbers
    come in both. With fibres: `humphrey+fibre`. Source: Humphrey and Yin 1987, Biophys. J. 52.
    """

    name: ClassVar[str] = "humphrey"
    formula: ClassVar[str] = "C1 (exp(C2 (I1bar - 3)) - 1)"
    shear_modulus: ClassVar[str] = "2 C1 C2"
    source: ClassVar[str] = "Humphrey and Yin 1987"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("C1", "Pa", 500.0, lower=0.0, meaning="initial shear modulus over 2 C2"),
            Parameter("C2", "1", 1.0, lower=0.0, upper=1e3, meaning="stiffening"),
        )

    def isochoric(self, p: Constants, strain: Strain) -> Float[Either, "..."]:
        return p["C1"] * expm1(p["C2"] * (strain.I1 - 3))

    def initial_shear_modulus(self, p: Constants) -> Float[Either, ""]:
        return 2 * p["C1"] * p["C2"]

"""Mooney-Rivlin: linear in both invariants."""

from typing import ClassVar

from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.energy import Energy
from tissuejax.energies.strain import Strain
from tissuejax.parameters import Constants, Parameter


class MooneyRivlin(Energy):
    """psi = C10 (I1bar - 3) + C01 (I2bar - 3).

    Shear modulus at rest 2 (C10 + C01); nominal stress in uniaxial tension 2 (l - 1/l^2) (C10 + C01 / l).
    Source: Mooney 1940, J. Appl. Phys. 11; Rivlin 1948.
    """

    name: ClassVar[str] = "mooney-rivlin"
    formula: ClassVar[str] = "C10 (I1bar - 3) + C01 (I2bar - 3)"
    shear_modulus: ClassVar[str] = "2 (C10 + C01)"
    source: ClassVar[str] = "Mooney 1940; Rivlin 1948"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("C10", "Pa", 400.0, meaning="coefficient of I1bar - 3"),
            Parameter("C01", "Pa", 100.0, meaning="coefficient of I2bar - 3"),
        )

    def isochoric(self, p: Constants, strain: Strain) -> Float[Either, "..."]:
        return p["C10"] * (strain.I1 - 3) + p["C01"] * (strain.I2 - 3)

    def initial_shear_modulus(self, p: Constants) -> Float[Either, ""]:
        return 2 * (p["C10"] + p["C01"])

"""Gent: neo-Hookean chains that run out of length."""

from typing import ClassVar

from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.barrier import LIMIT, minus_log
from tissuejax.energies.energy import Energy
from tissuejax.energies.strain import Strain
from tissuejax.parameters import Constants, Parameter


class Gent(Energy):
    """psi = -mu Jm/2 ln(1 - (I1bar - 3)/Jm).

    Shear modulus at rest mu; ends at I1bar = 3 + Jm. Nominal stress in uniaxial tension
    mu Jm (l - 1/l^2) / (Jm - I1 + 3).
    Source: Gent 1996, Rubber Chem. Technol. 69.
    """

    name: ClassVar[str] = "gent"
    formula: ClassVar[str] = "-mu Jm/2 ln(1 - (I1bar - 3)/Jm)"
    shear_modulus: ClassVar[str] = "mu"
    source: ClassVar[str] = "Gent 1996"
    valid: ClassVar[str] = "I1bar - 3 < Jm"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("mu", "Pa", 1000.0, lower=0.0, meaning="initial shear modulus"),
            Parameter("Jm", "1", 30.0, lower=0.0, meaning="I1bar - 3 at which the chains are straight"),
        )

    def isochoric(self, p: Constants, strain: Strain) -> Float[Either, "..."]:
        return 0.5 * p["mu"] * p["Jm"] * minus_log(1 - (strain.I1 - 3) / p["Jm"])

    def initial_shear_modulus(self, p: Constants) -> Float[Either, ""]:
        return p["mu"]

    def margin(self, p: Constants, strain: Strain) -> Float[Either, "..."]:
        return 1 - (strain.I1 - 3) / p["Jm"] - LIMIT

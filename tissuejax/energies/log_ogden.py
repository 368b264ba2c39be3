"""Log-Ogden: one Ogden sum inside a logarithm, with an end to the stretch."""

from typing import ClassVar

from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.barrier import LIMIT, minus_log
from tissuejax.energies.energy import Energy
from tissuejax.energies.strain import Strain
from tissuejax.parameters import Constants, Parameter


class LogOgden(Energy):
    """psi = -C1 ln(1 - C2 (sum_i lbar_i^alpha - 3)).

    Shear modulus at rest C1 C2 alpha^2 / 2; ends where C2 (sum_i lbar_i^alpha - 3) = 1.
    Source: Lister 2012, table 2.1.
    """

    name: ClassVar[str] = "log-ogden"
    formula: ClassVar[str] = "-C1 ln(1 - C2 (sum_i lbar_i^alpha - 3))"
    shear_modulus: ClassVar[str] = "C1 C2 alpha^2 / 2"
    source: ClassVar[str] = "Lister 2012, table 2.1"
    valid: ClassVar[str] = "C2 (sum_i lbar_i^alpha - 3) < 1"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("C1", "Pa", 100.0, lower=0.0, meaning="scale of the stress"),
            Parameter("C2", "1", 0.5, lower=0.0, meaning="one over the sum at which it ends"),
            Parameter("alpha", "1", -2.5, lower=-50.0, upper=50.0, meaning="exponent of the stretches"),
        )

    def isochoric(self, p: Constants, strain: Strain) -> Float[Either, "..."]:
        (total,) = strain.power_sums((p["alpha"],))
        return p["C1"] * minus_log(1 - p["C2"] * (total - 3))

    def initial_shear_modulus(self, p: Constants) -> Float[Either, ""]:
        return 0.5 * p["C1"] * p["C2"] * p["alpha"] ** 2

    def margin(self, p: Constants, strain: Strain) -> Float[Either, "..."]:
        (total,) = strain.power_sums((p["alpha"],))
        return 1 - p["C2"] * (total - 3) - LIMIT

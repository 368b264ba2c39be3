"""Arruda-Boyce: eight chains of limited length, as the usual five-term series."""

from typing import ClassVar

from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.energy import Energy
from tissuejax.energies.strain import Strain
from tissuejax.parameters import Constants, Parameter

# Series of the inverse Langevin function, Arruda and Boyce 1993, eq. 27.
COEFFICIENTS = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)


class ArrudaBoyce(Energy):
    """psi = mu sum_i c_i / lambda_m^(2i-2) (I1bar^i - 3^i), i = 1..5, c = 1/2, 1/20, 11/1050, 19/7000, 519/673750.

    Shear modulus at rest mu (1 + 3/5 n + 99/175 n^2 + 513/875 n^3 + 42039/67375 n^4), n = 1/lambda_m^2.
    Source: Arruda and Boyce 1993, J. Mech. Phys. Solids 41, eq. 27.
    """

    name: ClassVar[str] = "arruda-boyce"
    formula: ClassVar[str] = "mu sum_i c_i / lambda_m^(2i-2) (I1bar^i - 3^i), i = 1..5"
    shear_modulus: ClassVar[str] = "mu (1 + 3/5 n + 99/175 n^2 + 513/875 n^3 + 42039/67375 n^4), n = 1/lambda_m^2"
    source: ClassVar[str] = "Arruda and Boyce 1993, eq. 27"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("mu", "Pa", 1000.0, lower=0.0, meaning="n k T of the chains"),
            Parameter("lambda_m", "1", 3.0, lower=1.0, upper=100.0, meaning="chain stretch at which they are straight"),
        )

    def isochoric(self, p: Constants, strain: Strain) -> Float[Either, "..."]:
        n, I1 = p["lambda_m"] ** -2, strain.I1
        # I1^i - 3^i = (I1 - 3) q_i with q_i = I1 q_(i-1) + 3^(i-1): exactly zero at rest.
        q, total = 1.0, 0.0
        for i, c in enumerate(COEFFICIENTS):
            q = q if i == 0 else I1 * q + 3.0**i
            total = total + c * n**i * q
        return p["mu"] * (I1 - 3) * total

    def initial_shear_modulus(self, p: Constants) -> Float[Either, ""]:
        n = p["lambda_m"] ** -2
        return p["mu"] * (1 + n * (3 / 5 + n * (99 / 175 + n * (513 / 875 + n * 42039 / 67375))))

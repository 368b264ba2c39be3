"""Reduced polynomial in I1, any order; order 1 is neo-Hookean in C10, order 3 is Yeoh."""

from typing import Any, ClassVar

from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.energy import Energy
from tissuejax.energies.strain import Strain
from tissuejax.parameters import Constants, Parameter


class ReducedPolynomial(Energy):
    """psi = sum_i C_i0 (I1bar - 3)^i.

    Shear modulus at rest 2 C10. Source: Yeoh 1993, Rubber Chem. Technol. 66; Lister 2012, table 2.3.
    """

    name: ClassVar[str] = "reduced-polynomial"
    formula: ClassVar[str] = "sum_i C_i0 (I1bar - 3)^i"
    shear_modulus: ClassVar[str] = "2 C10"
    source: ClassVar[str] = "Yeoh 1993; Lister 2012, table 2.3"
    order: int = 3

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        first = Parameter("C10", "Pa", 500.0, lower=0.0, meaning="half the initial shear modulus")
        rest = (
            Parameter(f"C{i}0", "Pa", 0.0, scale=500.0, meaning=f"coefficient of (I1bar - 3)^{i}")
            for i in range(2, self.order + 1)
        )
        return (first, *rest)

    def isochoric(self, p: Constants, strain: Strain) -> Float[Either, "..."]:
        x = strain.I1 - 3
        psi: Any = 0.0
        for i in range(self.order, 0, -1):  # Horner: one multiplication a term
            psi = (psi + p[f"C{i}0"]) * x
        return psi

    def initial_shear_modulus(self, p: Constants) -> Float[Either, ""]:
        return 2 * p["C10"]

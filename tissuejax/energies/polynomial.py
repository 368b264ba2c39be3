"""Polynomial in both invariants, any order; order 1 is Mooney-Rivlin."""

from typing import Any, ClassVar

from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.energy import Energy
from tissuejax.energies.strain import Strain
from tissuejax.parameters import Constants, Parameter


class Polynomial(Energy):
    """psi = sum_(1 <= i+j <= N) C_ij (I1bar - 3)^i (I2bar - 3)^j.

    Shear modulus at rest 2 (C10 + C01). Source: Rivlin and Saunders 1951, Phil. Trans. R. Soc. A 243.
    """

    name: ClassVar[str] = "polynomial"
    formula: ClassVar[str] = "sum_(1 <= i+j <= N) C_ij (I1bar - 3)^i (I2bar - 3)^j"
    shear_modulus: ClassVar[str] = "2 (C10 + C01)"
    source: ClassVar[str] = "Rivlin and Saunders 1951"
    order: int = 2

    @property
    def exponents(self) -> tuple[tuple[int, int], ...]:
        """(i, j) of each term, lowest order first, I1 before I2: 10, 01, 20, 11, 02, ..."""
        return tuple((n - j, j) for n in range(1, self.order + 1) for j in range(n + 1))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        start = {(1, 0): 400.0, (0, 1): 100.0}
        return tuple(
            Parameter(
                f"C{i}{j}", "Pa", start.get((i, j), 0.0), scale=500.0, meaning=f"of (I1bar - 3)^{i} (I2bar - 3)^{j}"
            )
            for i, j in self.exponents
        )

    def isochoric(self, p: Constants, strain: Strain) -> Float[Either, "..."]:
        x, y = strain.I1 - 3, strain.I2 - 3
        psi: Any = 0.0
        for i in range(self.order, -1, -1):  # Horner in x with, inside, Horner in y
            inner: Any = 0.0
            for j in range(self.order - i, 0 if i == 0 else -1, -1):
                inner = inner * y + p[f"C{i}{j}"]
            psi = psi * x + (inner * y if i == 0 else inner)
        return psi

    def initial_shear_modulus(self, p: Constants) -> Float[Either, ""]:
        return 2 * (p["C10"] + p["C01"])

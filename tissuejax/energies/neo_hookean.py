"""Neo-Hookean: the first thing to try, and the small-strain limit of all others."""

from typing import ClassVar

from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.energy import Energy
from tissuejax.energies.strain import Strain
from tissuejax.parameters import Constants, Parameter


class NeoHookean(Energy):
    """psi = mu/2 (I1bar - 3).

    Shear modulus at rest mu; nominal stress in uniaxial tension mu (l - 1/l^2).
    Source: Treloar 1943, Trans. Faraday Soc. 39; Holzapfel 2000, eq. 6.128.
    """

    name: ClassVar[str] = "neo-hookean"
    formula: ClassVar[str] = "mu/2 (I1bar - 3)"
    shear_modulus: ClassVar[str] = "mu"
    source: ClassVar[str] = "Treloar 1943"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("mu", "Pa", 1000.0, lower=0.0, meaning="initial shear modulus"),)

    def isochoric(self, p: Constants, strain: Strain) -> Float[Either, "..."]:
        return 0.5 * p["mu"] * (strain.I1 - 3)

    def initial_shear_modulus(self, p: Constants) -> Float[Either, ""]:
        return p["mu"]

"""Gasser-Ogden-Holzapfel: two families of fibres that scatter about their directions."""

from typing import ClassVar

from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.energy import Energy
from tissuejax.energies.fibre import family
from tissuejax.energies.strain import Strain
from tissuejax.energies.two_families import DIRECTIONS, REINFORCED, directions
from tissuejax.parameters import Constants, Parameter


class GasserOgdenHolzapfel(Energy):
    """psi = mu/2 (I1bar - 3) + k1/(2 k2) sum_(i=4,6) (exp(k2 <E_i>^2) - 1).

    E_i = kappa (I1bar - 3) + (1 - 3 kappa) (I_i bar - 1), families at angle +- spread. With kappa 0 it
    is Holzapfel-Gasser-Ogden, with 1/3 isotropic. Shear modulus at rest mu.
    Source: Gasser, Ogden and Holzapfel 2006, J. R. Soc. Interface 3, eq. 3.5 and 3.8 (c = mu).
    """

    name: ClassVar[str] = "goh"
    formula: ClassVar[str] = (
        "mu/2 (I1bar - 3) + k1/(2 k2) sum_(i=4,6) (exp(k2 <E_i>^2) - 1), "
        "E_i = kappa (I1bar - 3) + (1 - 3 kappa) (I_i bar - 1)"
    )
    shear_modulus: ClassVar[str] = "mu"
    source: ClassVar[str] = "Gasser, Ogden and Holzapfel 2006, eq. 3.5"
    isotropic: ClassVar[bool] = False
    families: ClassVar[int] = 2

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            *REINFORCED,
            Parameter("kappa", "1", 0.1, lower=0.0, upper=1 / 3, meaning="dispersion: 0 aligned, 1/3 isotropic"),
            *DIRECTIONS,
        )

    def isochoric(self, p: Constants, strain: Strain) -> Float[Either, "..."]:
        fibres = sum(family(p, strain, p["kappa"], angle) for angle in self.angles(p))
        return 0.5 * p["mu"] * (strain.I1 - 3) + fibres

    def initial_shear_modulus(self, p: Constants) -> Float[Either, ""]:
        return p["mu"]

    def angles(self, p: Constants) -> tuple[Either, ...]:
        """Direction of each family from axis 1 to 2, rad."""
        return directions(p)

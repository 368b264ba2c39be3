"""Holzapfel-Gasser-Ogden: neo-Hookean with two aligned families of fibres, for arteries."""

from typing import ClassVar

from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.energy import Energy
from tissuejax.energies.fibre import family
from tissuejax.energies.strain import Strain
from tissuejax.energies.two_families import DIRECTIONS, REINFORCED, directions
from tissuejax.parameters import Constants, Parameter


class HolzapfelGasserOgden(Energy):
    """psi = mu/2 (I1bar - 3) + k1/(2 k2) sum_(i=4,6) (exp(k2 <I_i bar - 1>^2) - 1).

    I4bar and I6bar are squared isochoric stretches along angle +- spread in the plane of axes 1 and 2; <E> is 0 in
    compression (with the smooth onset of `fibre.py`). Shear modulus at rest mu: fibres add nothing there.
    Source: Holzapfel, Gasser and Ogden 2000, J. Elasticity 61, eqs. 62 to 65 (c = mu).
    """

    name: ClassVar[str] = "hgo"
    formula: ClassVar[str] = "mu/2 (I1bar - 3) + k1/(2 k2) sum_(i=4,6) (exp(k2 <I_i bar - 1>^2) - 1)"
    shear_modulus: ClassVar[str] = "mu"
    source: ClassVar[str] = "Holzapfel, Gasser and Ogden 2000"
    isotropic: ClassVar[bool] = False
    families: ClassVar[int] = 2

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (*REINFORCED, *DIRECTIONS)

    def isochoric(self, p: Constants, strain: Strain) -> Float[Either, "..."]:
        fibres = sum(family(p, strain, 0.0, angle) for angle in self.angles(p))
        return 0.5 * p["mu"] * (strain.I1 - 3) + fibres

    def initial_shear_modulus(self, p: Constants) -> Float[Either, ""]:
        return p["mu"]

    def angles(self, p: Constants) -> tuple[Either, ...]:
        """Direction of each family from axis 1 to 2, rad."""
        return directions(p)

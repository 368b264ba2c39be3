"""What every strain energy is: parameters as data and one function, the energy itself."""

import abc
from typing import ClassVar

import equinox as eqx
from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.strain import Strain
from tissuejax.parameters import Constants, Parameter


class Energy(eqx.Module):
    """A strain energy per reference volume. Stresses and tangents are its derivatives (`stress.py`)."""

    name: ClassVar[str]
    formula: ClassVar[str]
    isotropic: ClassVar[bool] = True
    families: ClassVar[int] = 0  # of fibres
    shear_modulus: ClassVar[str]  # at rest, as a formula in the parameters
    source: ClassVar[str]
    valid: ClassVar[str] = "all stretches"

    @property
    @abc.abstractmethod
    def parameters(self) -> tuple[Parameter, ...]:
        """Declared parameters, in order."""

    @abc.abstractmethod
    def isochoric(self, p: Constants, strain: Strain) -> Float[Either, "..."]:
        """Isochoric energy psi_iso in J/m^3 = Pa; zero at rest."""

    @abc.abstractmethod
    def initial_shear_modulus(self, p: Constants) -> Float[Either, ""]:
        """Shear modulus at rest, Pa."""

    def margin(self, p: Constants, strain: Strain) -> Float[Either, "..."]:
        """Positive inside the valid range of strains; energies that end somewhere say where."""
        return 1.0 + 0.0 * strain.J

    def angles(self, p: Constants) -> tuple[Either, ...]:
        """Direction of each family of fibres from axis 1 to 2, rad; none without fibres."""
        return ()

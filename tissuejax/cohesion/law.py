"""What every traction-separation law is: parameters as data, and an envelope that softens to nothing.

A law is given by its strength tau (Pa), the energy G that parting costs per area (J/m^2, the area under the curve) and,
where it has one, a shape. The initial stiffness K (Pa/m) belongs to the mesh, not to the tissue: it is what an unbroken
face gives way by (`tled/seam.py` chooses it). Memory, unloading and energies are the same for all laws: `engine.py`.
Source: Lister 2012, 3.1.1 (three parameters, two of which suffice); the irreversible form: Camacho & Ortiz 1996.
"""

import abc
from typing import ClassVar

import equinox as eqx
from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.parameters import Constants, Parameter

STRENGTH = Parameter("strength", "Pa", 4000.0, lower=0.0, meaning="greatest traction before a face parts", scale=1000.0)
ENERGY = Parameter("energy", "J/m^2", 2.0, lower=0.0, meaning="toughness: energy lost per area parted", scale=1.0)


class Law(eqx.Module):
    """An envelope T(d): traction over opening for a face that has never been opened further.

    Class data:
        name: as on the command line.
        formula: in words of the field.
        source: where it comes from.
        shaped: what the parameter `shape` means, and its default; None for a law without.
    """

    name: ClassVar[str]
    formula: ClassVar[str]
    source: ClassVar[str]
    shaped: ClassVar[tuple[str, float] | None] = None

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Declared parameters: strength, energy and, where there is one, shape."""
        if self.shaped is None:
            return STRENGTH, ENERGY
        meaning, default = self.shaped
        return STRENGTH, ENERGY, Parameter("shape", "1", default, 0.0, 1.0, meaning, frozen=True)

    @abc.abstractmethod
    def initial(self, p: Constants, K: Float[Either, "..."]) -> Float[Either, "..."]:
        """Stiffness of an unopened face, Pa/m; K is the mesh's."""

    @abc.abstractmethod
    def onset(self, p: Constants, K: Float[Either, "..."]) -> Float[Either, "..."]:
        """Opening up to which nothing is lost, m."""

    @abc.abstractmethod
    def end(self, p: Constants, K: Float[Either, "..."]) -> Float[Either, "..."]:
        """Opening at which a face counts as parted, m: nothing is carried beyond, or less than 1 % of G is left."""

    @abc.abstractmethod
    def secant(self, p: Constants, K: Float[Either, "..."], opening: Float[Either, "..."]) -> Float[Either, "..."]:
        """T(d) / d on the envelope, Pa/m; finite at d = 0, never rising with d."""

    @abc.abstractmethod
    def work(self, p: Constants, K: Float[Either, "..."], opening: Float[Either, "..."]) -> Float[Either, "..."]:
        """Area under the envelope from 0 to d, J/m^2."""

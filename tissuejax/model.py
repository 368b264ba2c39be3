"""A Model: a strain energy plus the effects that are switched on."""

from collections.abc import Mapping

import equinox as eqx
from jaxtyping import Array

from tissuejax.effects.effect import Effect
from tissuejax.energies.energy import Energy
from tissuejax.energies.volumetric import Volumetric
from tissuejax.parameters import Parameter, prefixed, under


class Model(eqx.Module):
    """Strain energy, volumetric energy (None = incompressible) and effects, in the order in which they were added.

    Dotted paths: `energy.mu`, `volumetric.K`, `effects.friction.coefficient`.
    """

    energy: Energy
    volumetric: Volumetric | None = None
    effects: tuple[Effect, ...] = ()

    @property
    def parameters(self) -> dict[str, Parameter]:
        """All declared parameters by dotted path."""
        declared = prefixed("energy", self.energy.parameters)
        if self.volumetric is not None:
            declared |= prefixed("volumetric", self.volumetric.parameters)
        for effect in self.effects:
            declared |= prefixed(f"effects.{effect.name}", effect.parameters)
        return declared

    @property
    def defaults(self) -> dict[str, float]:
        """Default values: the energy's own, every effect neutral."""
        return {path: declared.default for path, declared in self.parameters.items()}

    def with_effects(self, *effects: Effect) -> "Model":
        """The same base with further effects."""
        return Model(self.energy, self.volumetric, (*self.effects, *effects))

    def effect_values(self, values: Mapping[str, Array], effect: Effect) -> dict[str, Array]:
        """The values that belong to `effect`, by their own names."""
        return under(f"effects.{effect.name}", values)

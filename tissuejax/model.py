"""A Model: a strain energy plus the effects that are switched on."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import equinox as eqx
from jaxtyping import Array

from tissuejax.cohesion.law import Law
from tissuejax.effects.effect import Effect
from tissuejax.energies.energy import Energy
from tissuejax.energies.volumetric import Volumetric
from tissuejax.errors import InputError
from tissuejax.parameters import Constants, Parameter, prefixed, under


class Model(eqx.Module):
    """Strain energy, volumetric energy (None = incompressible), effects, and for cuts the law by which tissue parts.

    Dotted paths: `energy.mu`, `volumetric.K`, `effects.friction.coefficient`. A parameter that every recording has
    for itself ends in the recording, `effects.drift.offset.r1`, once the model knows the recordings.
    """

    energy: Energy
    volumetric: Volumetric | None = None
    effects: tuple[Effect, ...] = ()
    recordings: tuple[str, ...] = ()
    cohesion: Law | None = None

    def __check_init__(self):
        names = [effect.name for effect in self.effects]
        if len(set(names)) < len(names):
            raise InputError(f"effects {', '.join(names)}: one is listed twice; each can be added once")

    @property
    def declared(self) -> dict[str, Parameter]:
        """All declared parameters by dotted path, before any is multiplied over recordings."""
        declared = prefixed("energy", self.energy.parameters)
        if self.volumetric is not None:
            declared |= prefixed("volumetric", self.volumetric.parameters)
        if self.cohesion is not None:
            declared |= prefixed("cohesion", self.cohesion.parameters)
        for effect in self.effects:
            declared |= prefixed(f"effects.{effect.name}", effect.parameters)
        return declared

    @property
    def parameters(self) -> dict[str, Parameter]:
        """All parameters by dotted path, those with `each` once for every recording that the model knows."""
        found = {}
        for path, parameter in self.declared.items():
            several = parameter.each and self.recordings
            found |= {f"{path}.{r}": parameter for r in self.recordings} if several else {path: parameter}
        return found

    @property
    def defaults(self) -> dict[str, float]:
        """Default values: the energy's own, every effect neutral."""
        return {path: declared.default for path, declared in self.parameters.items()}

    @property
    def ordered(self) -> tuple[Effect, ...]:
        """Effects from the rig inwards; the order in which they were added doesn't matter."""
        return tuple(sorted(self.effects, key=lambda effect: (effect.order, effect.name)))

    @property
    def isotropic(self) -> bool:
        """False if the strain energy knows a direction."""
        return all(part.isotropic for part in (self.energy, *self.effects))

    def active(self, values: Constants, wanted: Collection[str] = ()) -> "Model":
        """Without effects whose amplitudes are all exactly zero: they change no bit, and so cost nothing.

        Args:
            values: a number for every path of `declared`.
            wanted: paths whose effects stay even so, as their derivative is asked for.
        """
        kept = tuple(
            effect
            for effect in self.effects
            if any(values[f"effects.{effect.name}.{a}"] != 0 for a in effect.amplitudes)
            or any(path.startswith(f"effects.{effect.name}.") for path in wanted)
        )
        return replace(self, effects=kept)

    def with_effects(self, *effects: Effect) -> "Model":
        """The same base with further effects."""
        return replace(self, effects=(*self.effects, *effects))

    def across(self, recordings: Sequence[str]) -> "Model":
        """The same model for these recordings, or for one nameless recording if there are none."""
        return replace(self, recordings=tuple(recordings))

    def effect_values(self, values: Mapping[str, Array], effect: Effect) -> dict[str, Array]:
        """The values that belong to `effect`, by their own names."""
        return under(f"effects.{effect.name}", values)

    def source_of(self, path: str, recording: str) -> tuple[str, ...]:
        """Paths that may hold the value of declared `path` in `recording`, the first found counts."""
        return (f"{path}.{recording}", path) if self.declared[path].each else (path,)

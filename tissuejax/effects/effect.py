"""What every effect is: data about itself, parameters with a neutral value, and hooks that default to nothing.

The same file serves as known physics in a simulation, as something to fit, and as a candidate in a diagnosis.
At its neutral value an effect reproduces the Model without it to the last bit, and the derivative there exists.
"""

import abc
from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from tissuejax.energies.strain import Strain
from tissuejax.parameters import Parameter


class Effect(eqx.Module):
    """One physical or sensor effect.

    Class data:
        name: as on the command line.
        kinds: which experiments it can act in, of {"homogeneous", "probing"}.
        reveals: what in a recording shows it.
        blind: experiments (or protocols) that can't show it.
        amplitudes: parameters that are 0 at neutral; the others ("shapes") vanish with the effect.
        grid: for each shape parameter, the values that a diagnosis scans.

    Hooks, in the order in which a material test applies them; each is the identity unless overridden:
        `stretch` (rig: what the specimen really saw), `energy` (added strain energy), `memory` (isochoric stress with
        history), `stress` (rig and sensor: what the cell reports). Probing: `scene` (the physical set-up: probe
        path, support, stiffness field, contact law, memory...), `channels` (sensors).
    """

    name: ClassVar[str]
    kinds: ClassVar[frozenset[str]]
    reveals: ClassVar[str]
    blind: ClassVar[str]
    source: ClassVar[str]
    amplitudes: ClassVar[tuple[str, ...]]
    grid: ClassVar[Mapping[str, tuple[float, ...]]] = {}

    @property
    @abc.abstractmethod
    def parameters(self) -> tuple[Parameter, ...]:
        """Declared parameters; an amplitude has default 0 (neutral)."""

    @property
    def neutral(self) -> dict[str, float]:
        """The values at which the effect is exactly off."""
        return {d.name: 0.0 if d.name in self.amplitudes else d.default for d in self.parameters}

    def stretch(self, p: Mapping[str, Array], test: Any, stretch: Float[Array, "n ..."]) -> Float[Array, "n ..."]:
        """Kinematic variable the specimen saw, from the one that was recorded."""
        return stretch

    def energy(self, p: Mapping[str, Array], strain: Strain, test: Any) -> Float[Array, "..."] | float:
        """Strain energy added to the base energy, Pa."""
        return 0.0

    def memory(self, p: Mapping[str, Array], test: Any, state: Any) -> Any:
        """Isochoric PK2 stress with history, from the elastic one (see `experiments/homogeneous.py`)."""
        return state

    def stress(self, p: Mapping[str, Array], test: Any, stress: Float[Array, "n ..."]) -> Float[Array, "n ..."]:
        """Nominal stress as reported, from the specimen's own."""
        return stress

    def scene(self, p: Mapping[str, Array], scene: Any) -> Any:
        """The probing scene with this effect in it (see `tled/scene.py`)."""
        return scene

    def channels(self, p: Mapping[str, Array], channels: Mapping[str, Any]) -> Mapping[str, Any]:
        """Probing channels as the sensors report them."""
        return channels

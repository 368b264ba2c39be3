"""A blade that dulls as it cuts."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array

from tissuejax.effects.cutting_test import Cut
from tissuejax.effects.effect import Effect
from tissuejax.parameters import Parameter


class Dulling(Effect):
    """The work of parting grows by 1 + growth * length cut. Neutral: 0.

    Reveals: a force that grows along the cut while that of the return stroke does not, and from cut to cut with one
    blade. Blind: a single short cut, where tissue that gets tougher along the path looks alike.
    """

    name: ClassVar[str] = "dulling"
    kinds: ClassVar[frozenset[str]] = frozenset({"cutting"})
    reveals: ClassVar[str] = "force that grows along the cut, and from cut to cut"
    blind: ClassVar[str] = "a single short cut"
    words: ClassVar[tuple[str, ...]] = ("the blade dulls by {growth:%} a metre",)
    source: ClassVar[str] = "McCarthy, Annaidh & Gilchrist 2010, Eng. Fract. Mech. 77"
    amplitudes: ClassVar[tuple[str, ...]] = ("growth",)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("growth", "1/m", 0.0, 0.0, 100.0, "relative growth of toughness per length", scale=2.0),)

    def cut(self, p: Mapping[str, Array], cut: Cut) -> Cut:
        return cut.with_(energy=cut.energy * (1 + jnp.asarray(p["growth"]) * cut.at))

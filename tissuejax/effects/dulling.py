"""A blade that dulls as it cuts."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array

from tissuejax.effects.cutting_test import Cut
from tissuejax.effects.effect import Effect
from tissuejax.parameters import Parameter


class Dulling(Effect):
    """The work of parting grows by 1 + growth * wearing (1 - exp(-length cut / wearing)). Neutral: growth 0.

    It grows by `growth` a metre to begin with, and levels off after some lengths of `wearing`, as the bluntness of a
    blade does once its first edge is gone.

    Reveals: a force that grows along the cut while that of the return stroke does not, and from cut to cut with one
    blade. Blind: a single short cut, where tissue that gets tougher along the path looks alike.
    """

    name: ClassVar[str] = "dulling"
    kinds: ClassVar[frozenset[str]] = frozenset({"cutting"})
    reveals: ClassVar[str] = "force that grows along the cut, and from cut to cut"
    blind: ClassVar[str] = "a single short cut"
    words: ClassVar[tuple[str, ...]] = (
        "the blade dulls by {growth:%} a metre at first, and levels off after {wearing}",
    )
    source: ClassVar[str] = "McCarthy, Annaidh & Gilchrist 2010, Eng. Fract. Mech. 77"
    amplitudes: ClassVar[tuple[str, ...]] = ("growth",)
    grid: ClassVar[Mapping[str, tuple[float, ...]]] = {"wearing": (0.01, 0.03, 0.3)}

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("growth", "1/m", 0.0, 0.0, 1e3, "relative growth of toughness per length, at first", scale=2.0),
            Parameter("wearing", "m", 1.0, 1e-3, 10.0, "length cut over which it levels off", frozen=True),
        )

    def cut(self, p: Mapping[str, Array], cut: Cut) -> Cut:
        worn = -p["wearing"] * jnp.expm1(-cut.at / p["wearing"])
        return cut.with_(energy=cut.energy * (1 + jnp.asarray(p["growth"]) * worn))

"""A wrong depth of the cut."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array

from tissuejax.effects.cutting_test import Cut
from tissuejax.effects.effect import Effect
from tissuejax.parameters import Parameter


class DepthError(Effect):
    """The blade cuts in depth + offset + tilt * distance. Neutral: 0.

    Reveals: forces out of proportion to the depth that was recorded, or one that grows along the cut. Blind: one depth
    (an offset passes for toughness).
    """

    name: ClassVar[str] = "depth-error"
    kinds: ClassVar[frozenset[str]] = frozenset({"cutting"})
    reveals: ClassVar[str] = "forces out of proportion to the recorded depth"
    blind: ClassVar[str] = "cuts of one depth"
    words: ClassVar[tuple[str, ...]] = ("the depth is {offset} off", "the surface rises by {tilt:%} along the path")
    source: ClassVar[str] = "Lister 2012, 3.1.2 (tissue levelled by hand)"
    amplitudes: ClassVar[tuple[str, ...]] = ("offset", "tilt")

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("offset", "m", 0.0, -0.02, 0.02, "added to the recorded depth", scale=5e-4),
            Parameter("tilt", "1", 0.0, -0.5, 0.5, "rise of the surface along the path", scale=0.02),
        )

    def cut(self, p: Mapping[str, Array], cut: Cut) -> Cut:
        deeper = cut.depth + jnp.asarray(p["offset"]) + jnp.asarray(p["tilt"]) * cut.at
        return cut.with_(depth=jnp.where(cut.depth > 0, jnp.maximum(deeper, 0.0), cut.depth))

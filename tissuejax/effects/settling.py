"""Tissue that settles while it is cut, so that the cut gets shallower."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array

from tissuejax.effects.cutting_test import Cut
from tissuejax.effects.effect import Effect
from tissuejax.parameters import Parameter


class Settling(Effect):
    """Depth falls by 1 - amount (1 - exp(-t / time)). Neutral: amount 0.

    Reveals: a force that falls with time, whatever the length cut. Blind: one speed, where it looks like a surface that
    slopes.
    """

    name: ClassVar[str] = "settling"
    kinds: ClassVar[frozenset[str]] = frozenset({"cutting"})
    reveals: ClassVar[str] = "force that falls with time at every place"
    blind: ClassVar[str] = "one speed and no rest"
    words: ClassVar[tuple[str, ...]] = ("{amount:%} of the depth is lost while the tissue settles",)
    source: ClassVar[str] = "Lister 2012, 3.1.3 (settling hides the crack's width)"
    amplitudes: ClassVar[tuple[str, ...]] = ("amount",)
    grid: ClassVar[Mapping[str, tuple[float, ...]]] = {"time": (3.0, 15.0)}

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("amount", "1", 0.0, 0.0, 0.9, "share of the depth lost in the end", scale=0.05),
            Parameter("time", "s", 8.0, 0.1, 1e3, "relaxation time", frozen=True),
        )

    def cut(self, p: Mapping[str, Array], cut: Cut) -> Cut:
        gone = 1 - jnp.exp(-jnp.maximum(cut.elapsed, 0.0) / p["time"])
        return cut.with_(depth=cut.depth * (1 - jnp.asarray(p["amount"]) * gone))

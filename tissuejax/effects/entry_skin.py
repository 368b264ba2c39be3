"""A capsule that is tougher than the tissue below, met where the blade enters."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array

from tissuejax.effects.cutting_test import Cut
from tissuejax.effects.effect import Effect
from tissuejax.parameters import Parameter


class EntrySkin(Effect):
    """G grows by 1 + gain exp(-(distance / reach)^edge) at the entry. Neutral: gain 0.

    With `edge` 1 the skin fades into what lies below, with 4 it is a layer that ends there.

    Reveals: a peak at the entry that the strength alone does not make. Blind: records that start in the cut.
    """

    name: ClassVar[str] = "entry-skin"
    kinds: ClassVar[frozenset[str]] = frozenset({"cutting"})
    reveals: ClassVar[str] = "a peak of force at the entry"
    blind: ClassVar[str] = "records that start in the cut"
    words: ClassVar[tuple[str, ...]] = ("the skin is {gain:%} tougher than what lies below",)
    source: ClassVar[str] = "Glisson's capsule: Hollenstein et al. 2006; Azar & Hayward 2008"
    amplitudes: ClassVar[tuple[str, ...]] = ("gain",)
    grid: ClassVar[Mapping[str, tuple[float, ...]]] = {"reach": (1e-3, 3e-3), "edge": (1.0, 4.0)}

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("gain", "1", 0.0, 0.0, 50.0, "relative toughness of the skin", scale=0.5),
            Parameter("reach", "m", 1.5e-3, 2e-4, 2e-2, "how deep it reaches", frozen=True),
            Parameter("edge", "1", 1.0, 0.5, 10.0, "how sharply it ends", frozen=True),
        )

    def cut(self, p: Mapping[str, Array], cut: Cut) -> Cut:
        way = cut.at / p["reach"]
        some = way > 0
        fallen = jnp.where(some, jnp.where(some, way, 1.0) ** p["edge"], 0.0)
        return cut.with_(energy=cut.energy * (1 + jnp.asarray(p["gain"]) * jnp.exp(-fallen)))

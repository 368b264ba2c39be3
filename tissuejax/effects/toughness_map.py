"""Toughness that varies along the path."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array

from tissuejax.effects.cutting_test import Cut
from tissuejax.effects.effect import Effect
from tissuejax.effects.form import OWN, Form, Offer
from tissuejax.parameters import Parameter


class ToughnessMap(Effect):
    """G = G0 (1 + sum_k m_k hat_k(share of the path)), `knots` hats evenly spaced. Neutral: all 0.

    Reveals: a force that rises and falls at the same places in every pass through fresh tissue. Blind: a path shorter
    than the distance of the knots.
    """

    name: ClassVar[str] = "toughness-map"
    kinds: ClassVar[frozenset[str]] = frozenset({"cutting"})
    reveals: ClassVar[str] = "force that varies along the path, at no regular period"
    blind: ClassVar[str] = "paths shorter than the knots' distance"
    words: ClassVar[tuple[str, ...]] = ("toughness changes along the path",)
    source: ClassVar[str] = "Lister 2012, 3.1.3 (strength and energy by segment)"
    knots: int = 6

    @classmethod
    def in_cuts(cls) -> Offer:
        """See `Effect.in_cuts`: one map for all strokes, or each its own, which is what any law leaves, far larger."""
        alike = cls(knots=12)
        return Offer(alike, (Form("", alike.amplitudes), Form(OWN, (), widens={"law": 0.15})))

    @property
    def amplitudes(self) -> tuple[str, ...]:
        """One a knot."""
        return tuple(f"m{k}" for k in range(1, self.knots + 1))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return tuple(
            Parameter(name, "1", 0.0, -0.95, 10.0, f"relative toughness at knot {name[1:]}", scale=0.1)
            for name in self.amplitudes
        )

    def cut(self, p: Mapping[str, Array], cut: Cut) -> Cut:
        place = cut.share * (self.knots - 1)
        more = sum(jnp.asarray(p[m]) * jnp.maximum(0.0, 1 - jnp.abs(place - k)) for k, m in enumerate(self.amplitudes))
        return cut.with_(energy=cut.energy * (1 + more))

"""Toughness that depends on speed."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array

from tissuejax.effects.cutting_test import Cut
from tissuejax.effects.effect import Effect
from tissuejax.parameters import Parameter


class RateToughness(Effect):
    """G = G0 (1 + gain (v / 10 mm/s)^exponent). Neutral: gain 0.

    Where toughness grows and strength does not, the faces let go at a wider opening, and beside the flats of a blade
    not much thicker than that they hold on: in a balance of energies what squeezes the blade, on the return stroke and
    in a second pass too, grows by (G / G0)^held (0 for a blade that parts them; for an exponential law the thickness
    over the opening at its peak, less one). A simulation has its own faces and takes no notice of `held`.

    Reveals: unlike mean forces at unlike speeds. Blind: one speed.
    """

    name: ClassVar[str] = "rate-toughness"
    kinds: ClassVar[frozenset[str]] = frozenset({"cutting"})
    reveals: ClassVar[str] = "unlike forces at unlike speeds"
    blind: ClassVar[str] = "one speed"
    words: ClassVar[tuple[str, ...]] = ("toughness is {gain:%} higher at 10 mm/s",)
    source: ClassVar[str] = "Mahvash & Dupont 2010, IEEE Trans. Biomed. Eng. 57 (power of the needle's speed)"
    amplitudes: ClassVar[tuple[str, ...]] = ("gain",)
    grid: ClassVar[Mapping[str, tuple[float, ...]]] = {"exponent": (0.3, 0.6), "held": (0.0, 3.0)}

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("gain", "1", 0.0, 0.0, 20.0, "relative rise of toughness at 10 mm/s", scale=0.2),
            Parameter("exponent", "1", 0.4, 0.05, 1.5, "of the speed", frozen=True),
            Parameter("held", "1", 0.0, 0.0, 8.0, "power of the toughness by which faces hold on", frozen=True),
        )

    def cut(self, p: Mapping[str, Array], cut: Cut) -> Cut:
        speed = jnp.maximum(jnp.abs(cut.pace) / 0.01, 1e-6)
        more = 1 + jnp.asarray(p["gain"]) * speed ** p["exponent"]
        return cut.with_(energy=cut.energy * more, squeezing=cut.squeezing * more ** p["held"])

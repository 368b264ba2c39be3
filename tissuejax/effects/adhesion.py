"""Adhesion: the tissue sticks to the probe and pulls on retraction."""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Form, Offer, Probed
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.tled.scene import Scene


class Adhesion(Effect):
    """A pull of up to `strength` across a gap of `reach` (see `tled/contact.py`). Neutral: strength 0.

    Reveals: force of the other sign while the probe leaves, and contact that ends above the height at which it began.
    Blind: recordings that stop at depth.
    """

    name: ClassVar[str] = "adhesion"
    kinds: ClassVar[frozenset[str]] = frozenset({"probing"})
    group: ClassVar[str] = "contact"
    reveals: ClassVar[str] = "pulling force at the end of the retraction"
    blind: ClassVar[str] = "recordings without a retraction; material tests"
    words: ClassVar[tuple[str, ...]] = ("the tissue sticks to the probe with up to {strength}",)
    source: ClassVar[str] = "cohesive traction over a gap, as in Lister 2012, 3.2.1"
    amplitudes: ClassVar[tuple[str, ...]] = ("strength",)
    grid: ClassVar[Mapping[str, tuple[float, ...]]] = {"reach": (1e-4, 3e-4)}

    @classmethod
    def in_probings(cls, sizes: Probed) -> Offer:
        """See `Effect.in_probings`."""
        return Offer(cls(), (Form("", ("strength", "reach"), {"reach": (1e-4, 3e-4, 8e-4)}),))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("strength", "Pa", 0.0, 0.0, 2e4, "greatest pull per area", scale=200.0),
            Parameter("reach", "m", 2e-4, 2e-5, 2e-3, "gap at which the pull is greatest"),
        )

    def scene(self, p: Mapping[str, Array], test: ProbingTest, scene: Scene) -> Scene:
        return scene.put({"probe.adhesion": p["strength"], "probe.reach": p["reach"]})

"""Drift of the force that a cut is recorded with."""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import OWN, Form, Offer
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.recordings.recording import Channel


class CuttingDrift(Effect):
    """Reported cutting force = force + offset + rate t, t the time since the recording began.

    Revealed by force where the blade touches nothing. Blind: cuts recorded from the first contact on; a wrong gain is
    never seen. Source: linear sensor model.
    """

    name: ClassVar[str] = "cutting-drift"
    kinds: ClassVar[frozenset[str]] = frozenset({"cutting"})
    reveals: ClassVar[str] = "force on a blade that touches nothing, growing in time"
    blind: ClassVar[str] = "cuts recorded from the first contact on; a wrong gain is never seen"
    words: ClassVar[tuple[str, ...]] = ("the force sensor's zero is off by {offset}", "it drifts by {rate}")
    source: ClassVar[str] = "linear sensor model"
    order: ClassVar[int] = 0
    amplitudes: ClassVar[tuple[str, ...]] = ("offset", "rate")
    separate: bool = False

    @classmethod
    def in_cuts(cls) -> Offer:
        """See `Effect.in_cuts`: one for all strokes, or each its own."""
        both = cls.amplitudes
        return Offer(cls(separate=True), (Form("", both), Form(OWN, both, each=both)))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        each = self.separate
        return (
            Parameter("offset", "N", 0.0, scale=3e-3, each=each, meaning="zero error of the force"),
            Parameter("rate", "N/s", 0.0, scale=3e-4, each=each, meaning="drift of the force"),
        )

    def channels(
        self, p: Mapping[str, Array], test: ProbingTest, channels: Mapping[str, Channel]
    ) -> Mapping[str, Channel]:
        seen = channels["cutting_force"]
        force = seen.values + p["offset"] + p["rate"] * (seen.time - seen.time[0])
        return {**channels, "cutting_force": Channel(seen.time, force, seen.unit, seen.noise_std)}

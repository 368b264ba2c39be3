"""Markers and force on different clocks."""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array

from tissuejax.effects.effect import Effect
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.recordings.recording import Channel


class ClockLag(Effect):
    """A marker frame stamped t shows the tissue at t - lag. Neutral: 0.

    Reveals: marker residuals in proportion to marker velocity while the force fits. Blind: recordings without
    markers, or at rest.
    """

    name: ClassVar[str] = "clock-lag"
    kinds: ClassVar[frozenset[str]] = frozenset({"probing"})
    reveals: ClassVar[str] = "marker residuals proportional to marker velocity, none in holds"
    blind: ClassVar[str] = "recordings without markers; holds; material tests"
    words: ClassVar[tuple[str, ...]] = ("the markers' clock is {lag} late",)
    source: ClassVar[str] = "Lister 2012, 2.2.1 (force at 62.5 Hz and cameras at 15 Hz on separate clocks)"
    amplitudes: ClassVar[tuple[str, ...]] = ("lag",)
    order: ClassVar[int] = 0

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("lag", "s", 0.0, -1.0, 1.0, "how late the marker clock is", scale=0.05),)

    def channels(
        self, p: Mapping[str, Array], test: ProbingTest, channels: Mapping[str, Channel]
    ) -> Mapping[str, Channel]:
        if "markers" not in channels:
            return channels
        seen = channels["markers"]
        return {**channels, "markers": Channel(seen.time + p["lag"], seen.values, seen.unit, seen.noise_std)}

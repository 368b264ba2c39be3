"""Hum: a periodic disturbance of a probe's force alone, as mains, a motor or an amplifier makes it."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Form, Offer, Probed
from tissuejax.effects.periodic import CYCLES
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.recordings.recording import Channel

FINEST = 4.0  # samples of the force in a period


class ForceHum(Effect):
    """Reported force along z = force + sin a(t) `sin` + cos a(t) `cos`, a = 2 pi frequency t; markers feel nothing.

    Along x and y `beside_x` and `beside_y` times that: what wires pick up is in phase. Every recording has a strength
    and a phase of its own, t counted from its beginning. A frequency above half the sampling rate is reported at its
    alias.

    Revealed by a line in the periodogram of the force that markers lack, as strong out of contact. Blind: recordings of
    fewer than 2.5 periods, fewer than 4 samples a period; what comes more than some thirty times in a recording goes
    from the block means that a diagnosis weighs, and is noise; without markers and always in contact it may be a
    support that moves. Source: harmonic model, Lomb 1976, Astrophys. Space Sci. 39.
    """

    name: ClassVar[str] = "force-hum"
    kinds: ClassVar[frozenset[str]] = frozenset({"probing"})
    remembers: ClassVar[bool] = False
    added: ClassVar[bool] = True
    reveals: ClassVar[str] = "a line in the periodogram of the force, also out of contact, that markers lack"
    blind: ClassVar[str] = "fewer than 2.5 periods in a recording, or fewer than 4 samples of the force in a period"
    words: ClassVar[tuple[str, ...]] = ("the force carries a hum with parts of {sin} and {cos} at {frequency}",)
    needs: ClassVar[Mapping[str, str]] = {"probing": "sampled"}
    source: ClassVar[str] = "Lomb 1976"
    order: ClassVar[int] = 0
    amplitudes: ClassVar[tuple[str, ...]] = ("sin", "cos")

    @classmethod
    def in_probings(cls, sizes: Probed) -> Offer:
        """See `Effect.in_probings`."""
        waves = cls.amplitudes
        free = (*waves, "beside_x", "beside_y", "frequency")
        lower = CYCLES / sizes.recording
        upper = max(1 / (FINEST * sizes.step), 2 * lower)
        form = Form("", free, each=waves, spectral=("frequency", 3), heard="force")
        return Offer(cls(), (form,), ranges={"frequency": (lower, upper, 2 * lower)})

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("sin", "N", 0.0, scale=3e-3, each=True, meaning="sine part of the hum along z"),
            Parameter("cos", "N", 0.0, scale=3e-3, each=True, meaning="cosine part of that"),
            Parameter("beside_x", "1", 0.0, -10.0, 10.0, "hum along x over that along z", scale=0.2),
            Parameter("beside_y", "1", 0.0, -10.0, 10.0, "hum along y over that along z", scale=0.2),
            Parameter("frequency", "1/s", 0.25, lower=1e-4, upper=1e4, meaning="of the hum"),
        )

    def channels(
        self, p: Mapping[str, Array], test: ProbingTest, channels: Mapping[str, Channel]
    ) -> Mapping[str, Channel]:
        seen = channels["force"]
        angle = 2 * jnp.pi * p["frequency"] * seen.time
        hum = p["sin"] * jnp.sin(angle) + p["cos"] * jnp.cos(angle)
        axes = jnp.stack([p["beside_x"] * hum, p["beside_y"] * hum, hum], -1)
        return {**channels, "force": Channel(seen.time, seen.values + axes, seen.unit, seen.noise_std)}

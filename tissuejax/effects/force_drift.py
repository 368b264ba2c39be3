"""Drift of a probe's force sensor: an offset and a slow drift of each axis."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Form, Offer, Probed
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.recordings.recording import Channel


class ForceDrift(Effect):
    """Reported force = force + offset + rate t along x, y and z, t the time since the recording began.

    One offset and one rate an axis for all recordings, or with `separate` of their own for each.

    Revealed by force out of contact, before the press and after it. Blind: probings that begin in contact; a wrong gain
    is never seen. Source: linear sensor model.
    """

    name: ClassVar[str] = "force-drift"
    kinds: ClassVar[frozenset[str]] = frozenset({"probing"})
    group: ClassVar[str] = "rig"
    added: ClassVar[bool] = True
    reveals: ClassVar[str] = "force out of contact, growing in time"
    blind: ClassVar[str] = "probings that begin in contact; a wrong gain is never seen"
    words: ClassVar[tuple[str, ...]] = (
        "the force sensor's zero is off by {offset_x}, {offset_y}, {offset_z}",
        "it drifts by {rate_x}, {rate_y}, {rate_z}",
    )
    source: ClassVar[str] = "linear sensor model"
    order: ClassVar[int] = 0
    amplitudes: ClassVar[tuple[str, ...]] = tuple(f"{a}_{c}" for a in ("offset", "rate") for c in "xyz")
    separate: bool = False

    @classmethod
    def in_probings(cls, sizes: Probed) -> Offer:
        """See `Effect.in_probings`."""
        axes = cls.amplitudes
        return Offer(cls(separate=True), (Form("", axes), Form("each recording", axes, each=axes)))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        sizes = {"offset": ("N", 3e-3, "zero error of the force"), "rate": ("N/s", 3e-4, "drift of the force")}
        return tuple(
            Parameter(f"{name}_{c}", unit, 0.0, scale=scale, each=self.separate, meaning=f"{meaning} along {c}")
            for name, (unit, scale, meaning) in sizes.items()
            for c in "xyz"
        )

    def channels(
        self, p: Mapping[str, Array], test: ProbingTest, channels: Mapping[str, Channel]
    ) -> Mapping[str, Channel]:
        seen = channels["force"]
        offset, rate = (jnp.stack([jnp.asarray(p[f"{name}_{c}"]) for c in "xyz"]) for name in ("offset", "rate"))
        force = seen.values + offset + rate * seen.time[:, None]
        return {**channels, "force": Channel(seen.time, force, seen.unit, seen.noise_std)}

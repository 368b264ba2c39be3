"""Drift: offset and slow drift of the force channel."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.effects.effect import Effect
from tissuejax.effects.history import dying
from tissuejax.effects.material_test import MaterialTest
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.recordings.recording import Channel


class Drift(Effect):
    """Reported stress = stress + offset + rate t, t the time since the recording began.

    One offset and one rate for all recordings, or with `separate` of their own for each; with `kind` "probing" for
    each axis of the force. A gain of the sensor is NOT
    here: it can't be told from a stiffness scale by any data of one sample.

    Revealed by stress at rest, before loading and after unloading. Blind: none that has samples at rest; without them
    the offset trades with the energy's form. Source: linear sensor model.
    """

    name: ClassVar[str] = "drift"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous", "probing", "cutting"})
    reveals: ClassVar[str] = "stress at rest, growing in time"
    blind: ClassVar[str] = "recordings without samples at rest; a wrong gain is never seen"
    words: ClassVar[tuple[str, ...]] = (
        "the load cell's zero is off by {offset}",
        "it drifts by {rate}",
        "the load cell's zero is off by {offset_x}, {offset_y}, {offset_z}",
        "it drifts by {rate_x}, {rate_y}, {rate_z}",
    )
    source: ClassVar[str] = "linear sensor model"
    order: ClassVar[int] = 0
    separate: bool = False
    kind: str = "homogeneous"

    @property
    def amplitudes(self) -> tuple[str, ...]:
        """Offset and rate; of each axis of the force in a probing."""
        return (
            ("offset", "rate")
            if self.kind != "probing"
            else tuple(f"{a}_{c}" for a in ("offset", "rate") for c in "xyz")
        )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        each = self.separate
        if self.kind == "probing":
            sizes = {"offset": ("N", 3e-3, "zero error of the force"), "rate": ("N/s", 3e-4, "drift of the force")}
            return tuple(
                Parameter(f"{name}_{c}", unit, 0.0, scale=scale, each=each, meaning=f"{meaning} along {c}")
                for name, (unit, scale, meaning) in sizes.items()
                for c in "xyz"
            )
        if self.kind == "cutting":
            return (
                Parameter("offset", "N", 0.0, scale=3e-3, each=each, meaning="zero error of the force"),
                Parameter("rate", "N/s", 0.0, scale=3e-4, each=each, meaning="drift of the force"),
            )
        return (
            Parameter("offset", "Pa", 0.0, scale=10.0, each=each, meaning="zero error of the load cell"),
            Parameter("rate", "Pa/s", 0.0, scale=1.0, each=each, meaning="drift of the load cell"),
            Parameter("settling", "1/s", 0.0, lower=0.0, upper=10.0, scale=0.1, frozen=True, meaning="dying out of it"),
        )

    def stress(
        self, p: Mapping[str, Array], test: MaterialTest, stress: Float[Array, "n ..."]
    ) -> Float[Array, "n ..."]:
        drift = p["offset"] + p["rate"] * dying(test.elapsed, p["settling"])
        return stress + (drift if stress.ndim == 1 else drift[:, None])

    def channels(
        self, p: Mapping[str, Array], test: ProbingTest, channels: Mapping[str, Channel]
    ) -> Mapping[str, Channel]:
        if self.kind == "cutting":
            seen = channels["cutting_force"]
            force = seen.values + p["offset"] + p["rate"] * (seen.time - seen.time[0])
            return {**channels, "cutting_force": Channel(seen.time, force, seen.unit, seen.noise_std)}
        if self.kind != "probing":
            return channels
        seen = channels["force"]
        offset, rate = (jnp.stack([jnp.asarray(p[f"{name}_{c}"]) for c in "xyz"]) for name in ("offset", "rate"))
        force = seen.values + offset + rate * seen.time[:, None]
        return {**channels, "force": Channel(seen.time, force, seen.unit, seen.noise_std)}

"""Periodic load: breathing, pulse or mains hum in the force channel."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.effects.effect import Effect
from tissuejax.effects.material_test import MaterialTest
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.tled.scene import Scene


class Periodic(Effect):
    """Reported stress = stress + sin a(t) `sin` + cos a(t) `cos`, a = 2 pi frequency t.

    With `separate` (the default) every recording has its own phase and strength, t counted from its beginning;
    otherwise one oscillation runs through all recordings, t counted from the first (it needs `start`).

    With `kind` "probing" it is the support that moves (breathing): lift = sin a `sin` + cos a `cos` and the same at
    twice the frequency, and along x and y `lean_x`, `lean_y` times that; force and all markers feel it.

    Revealed by a line in the periodogram of the residual, also at rest. Blind: recordings shorter than a period. The
    grid is one frequency a decade fraction; a periodogram of the residual is the better start.
    Source: harmonic model; Lomb 1976, Astrophys. Space Sci. 39.
    """

    name: ClassVar[str] = "periodic"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous", "probing"})
    reveals: ClassVar[str] = "a line in the periodogram of the residual"
    blind: ClassVar[str] = "recordings shorter than a period"
    words: ClassVar[tuple[str, ...]] = ("a load with parts of {sin} and {cos} comes back at {frequency}",)
    source: ClassVar[str] = "Lomb 1976"
    order: ClassVar[int] = 0
    grid: ClassVar[Mapping[str, tuple[float, ...]]] = {
        "frequency": tuple(float(f) for f in np.concatenate([np.arange(0.06, 0.6, 0.02), np.arange(0.6, 3.0, 0.04)]))
    }
    separate: bool = True
    kind: str = "homogeneous"

    @property
    def amplitudes(self) -> tuple[str, ...]:
        """Sine and cosine part, and those of twice the frequency."""
        return ("sin", "cos", "sin2", "cos2")

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        each = self.separate
        if self.kind == "probing":
            names = {"sin": "sine", "cos": "cosine", "sin2": "sine of twice the frequency", "cos2": "cosine of that"}
            lift = (
                Parameter(n, "m", 0.0, -0.02, 0.02, f"{words} of the support's lift", scale=3e-4, each=each)
                for n, words in names.items()
            )
            lean = (Parameter(f"lean_{c}", "1", 0.0, -2.0, 2.0, f"motion along {c} over lift", scale=0.1) for c in "xy")
            return (*lift, *lean, Parameter("frequency", "1/s", 0.25, lower=1e-4, upper=1e4, meaning="of the motion"))
        return (
            Parameter("sin", "Pa", 0.0, scale=10.0, each=each, meaning="sine part of the load"),
            Parameter("cos", "Pa", 0.0, scale=10.0, each=each, meaning="cosine part of the load"),
            Parameter("sin2", "Pa", 0.0, scale=10.0, each=each, meaning="sine of twice the frequency"),
            Parameter("cos2", "Pa", 0.0, scale=10.0, each=each, meaning="cosine of that"),
            Parameter("frequency", "1/s", 0.25, lower=1e-4, upper=1e4, meaning="of the load"),
        )

    def stress(
        self, p: Mapping[str, Array], test: MaterialTest, stress: Float[Array, "n ..."]
    ) -> Float[Array, "n ..."]:
        angle = 2 * jnp.pi * p["frequency"] * (test.elapsed if self.separate else test.start + test.elapsed)
        load = p["sin"] * jnp.sin(angle) + p["cos"] * jnp.cos(angle)
        load = load + p["sin2"] * jnp.sin(2 * angle) + p["cos2"] * jnp.cos(2 * angle)
        return stress + (load if stress.ndim == 1 else load[:, None])

    def scene(self, p: Mapping[str, Array], test: ProbingTest, scene: Scene) -> Scene:
        if self.kind != "probing":
            return scene
        time = scene.probe.time
        angle = 2 * jnp.pi * p["frequency"] * (time if self.separate else test.start + time)
        lift = p["sin"] * jnp.sin(angle) + p["cos"] * jnp.cos(angle)
        lift = lift + p["sin2"] * jnp.sin(2 * angle) + p["cos2"] * jnp.cos(2 * angle)
        motion = jnp.stack([p["lean_x"] * lift, p["lean_y"] * lift, lift], -1)
        already = scene.support.displacement
        return scene.put(
            {"support.time": time, "support.displacement": motion if already is None else already + motion}
        )

"""Support motion: tissue that is lifted and lowered under the probe, by breathing or pulse."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Form, Offer, Probed
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.tled.scene import Scene


class SupportMotion(Effect):
    """The support's lift = sin a(t) `sin` + cos a(t) `cos` + the same at twice the frequency, a = 2 pi frequency t.

    Along x and y it moves by `lean_x` and `lean_y` times that; force and all markers feel it. With `separate` (the
    default) every recording has its own phase and strength, t counted from its beginning; otherwise one motion runs
    through all recordings, t counted from the first (it needs `start`).

    Revealed by a line in the periodogram of markers and force, also out of contact. Blind: recordings shorter than a
    period. Source: harmonic model; Lomb 1976, Astrophys. Space Sci. 39.
    """

    name: ClassVar[str] = "support-motion"
    kinds: ClassVar[frozenset[str]] = frozenset({"probing"})
    group: ClassVar[str] = "rig"
    displaces: ClassVar[tuple[str, ...]] = ("sin", "cos", "sin2", "cos2", "lean_x", "lean_y", "frequency")
    reveals: ClassVar[str] = "a line in the periodogram of markers and force, also out of contact"
    blind: ClassVar[str] = "recordings shorter than a period"
    words: ClassVar[tuple[str, ...]] = (
        "the support is lifted periodically, with parts of {sin} and {cos} at {frequency}",
    )
    source: ClassVar[str] = "Lomb 1976"
    order: ClassVar[int] = 0
    remembers: ClassVar[bool] = False
    amplitudes: ClassVar[tuple[str, ...]] = ("sin", "cos", "sin2", "cos2")
    separate: bool = True

    @classmethod
    def in_probings(cls, sizes: Probed) -> Offer:
        """See `Effect.in_probings`."""
        waves = cls.amplitudes
        form = Form("", (*waves, "lean_x", "lean_y", "frequency"), each=waves, spectral=("frequency", 1))
        return Offer(cls(), (form,))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        names = {"sin": "sine", "cos": "cosine", "sin2": "sine of twice the frequency", "cos2": "cosine of that"}
        lift = (
            Parameter(n, "m", 0.0, -0.02, 0.02, f"{words} of the support's lift", scale=3e-4, each=self.separate)
            for n, words in names.items()
        )
        lean = (Parameter(f"lean_{c}", "1", 0.0, -2.0, 2.0, f"motion along {c} over lift", scale=0.1) for c in "xy")
        return (*lift, *lean, Parameter("frequency", "1/s", 0.25, lower=1e-4, upper=1e4, meaning="of the motion"))

    def scene(self, p: Mapping[str, Array], test: ProbingTest, scene: Scene) -> Scene:
        time = scene.pressed.time
        angle = 2 * jnp.pi * p["frequency"] * (time if self.separate else test.start + time)
        lift = p["sin"] * jnp.sin(angle) + p["cos"] * jnp.cos(angle)
        lift = lift + p["sin2"] * jnp.sin(2 * angle) + p["cos2"] * jnp.cos(2 * angle)
        motion = jnp.stack([p["lean_x"] * lift, p["lean_y"] * lift, lift], -1)
        already = scene.support.displacement
        return scene.put(
            {"support.time": time, "support.displacement": motion if already is None else already + motion}
        )

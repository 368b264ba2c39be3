"""First touch misjudged: the probe is really lower than recorded, or its clock is late."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Form, Offer, Probed
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.tled.scene import Scene


class ContactOffset(Effect):
    """z_true(t) = z_recorded(t - delay) - depth. Neutral: both 0.

    One depth for all recordings (a probe of another length), or with `separate` one for each (touch was judged anew).
    Reveals: force that starts before or after the recorded first touch, by the same shift on the way in and out; a
    delay also shifts the corners of the path. Blind: a single approach at one speed mixes depth and delay.
    """

    name: ClassVar[str] = "contact-offset"
    kinds: ClassVar[frozenset[str]] = frozenset({"probing"})
    group: ClassVar[str] = "rig"
    displaces: ClassVar[tuple[str, ...]] = ("depth", "delay")
    remembers: ClassVar[bool] = False
    misjudged: ClassVar[Mapping[str, float]] = {"depth": 7e-4, "delay": 0.1}
    reveals: ClassVar[str] = "force begins too early or too late, by the same depth on the way in and out"
    blind: ClassVar[str] = "one approach at one speed can't tell depth from delay; material tests"
    words: ClassVar[tuple[str, ...]] = ("the probe was {depth} deeper than recorded", "its clock is {delay} late")
    source: ClassVar[str] = "Lister 2012, 2.2.1 (contact circuit)"
    amplitudes: ClassVar[tuple[str, ...]] = ("depth", "delay")
    order: ClassVar[int] = 0
    separate: bool = False

    @classmethod
    def in_probings(cls, sizes: Probed) -> Offer:
        """See `Effect.in_probings`."""
        each = Form("each recording", ("depth",), each=("depth",))
        return Offer(cls(separate=True), (Form("delay", ("delay",)), Form("depth", ("depth",)), each))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        lower = "how much lower the probe really was"
        return (
            Parameter("depth", "m", 0.0, -3e-3, 3e-3, lower, scale=3e-4, each=self.separate),
            Parameter("delay", "s", 0.0, -0.5, 0.5, "how late the probe's clock is", scale=0.03),
        )

    def scene(self, p: Mapping[str, Array], test: ProbingTest, scene: Scene) -> Scene:
        down = jnp.array([0.0, 0.0, -1.0]) * p["depth"]
        offset = down if scene.pressed.offset is None else scene.pressed.offset + down
        return scene.put({"probe.offset": offset, "probe.time": scene.pressed.time + p["delay"]})

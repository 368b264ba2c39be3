"""Probe, tissue and cameras registered to each other with an error: offset, turn, wrong radius or thickness."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Form, Offer, Probed
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.recordings.recording import Channel
from tissuejax.tled.scene import Scene


class Registration(Effect):
    """The probe is off sideways by (dx, dy), its radius by `radius`, the thickness by the share `thickness`, and the
    cameras see displacements turned about z by `turn`. Neutral: all 0.

    Reveals: lateral force and markers as if another place had been pressed, alike at all sites; a turn shows in
    markers alone. Blind: a level surface far from markers (dx, dy); one depth (radius against stiffness). How deep the
    probe was is the contact offset's.
    """

    name: ClassVar[str] = "registration"
    kinds: ClassVar[frozenset[str]] = frozenset({"probing"})
    group: ClassVar[str] = "rig"
    displaces: ClassVar[tuple[str, ...]] = ("dx", "dy")
    sensed: ClassVar[tuple[str, ...]] = ("turn",)
    remembers: ClassVar[bool] = False
    misjudged: ClassVar[Mapping[str, float]] = {
        "dx": 7e-4,
        "dy": 7e-4,
        "radius": 3e-4,
        "thickness": 0.05,
        "turn": 0.1,
    }
    reveals: ClassVar[str] = "lateral forces and marker patterns that belong to a place beside the recorded one"
    blind: ClassVar[str] = "a level surface without markers; material tests"
    words: ClassVar[tuple[str, ...]] = (
        "the probe was {dx} farther along x and {dy} along y",
        "the probe's radius is {radius} off",
        "the tissue is {thickness:%} off in thickness",
        "the cameras are turned by {turn}",
    )
    source: ClassVar[str] = "Lister 2012, 2.2.4 (registration of robot and cameras)"
    amplitudes: ClassVar[tuple[str, ...]] = ("dx", "dy", "radius", "thickness", "turn")
    order: ClassVar[int] = 0

    @classmethod
    def in_probings(cls, sizes: Probed) -> Offer:
        """See `Effect.in_probings`."""
        alone = (Form(name, (name,)) for name in ("turn", "radius", "thickness"))
        return Offer(cls(), (Form("place", ("dx", "dy")), *alone))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("dx", "m", 0.0, -5e-3, 5e-3, "probe really farther along x", scale=5e-4),
            Parameter("dy", "m", 0.0, -5e-3, 5e-3, "probe really farther along y", scale=5e-4),
            Parameter("radius", "m", 0.0, -2e-3, 2e-3, "real radius less the recorded one", scale=2e-4),
            Parameter("thickness", "1", 0.0, -0.5, 0.5, "real thickness over the recorded one, less 1", scale=0.05),
            Parameter("turn", "rad", 0.0, -0.5, 0.5, "turn of the cameras about z", scale=0.05),
        )

    def scene(self, p: Mapping[str, Array], test: ProbingTest, scene: Scene) -> Scene:
        zero = jnp.zeros((), test.centres.dtype)
        aside = jnp.stack([zero + p["dx"], zero + p["dy"], zero])
        offset = aside if scene.pressed.offset is None else scene.pressed.offset + aside
        # the top stays where it was measured, everything below it moves down with the support
        points = scene.body.points.at[:, 2].add((-test.below_top * p["thickness"]).astype(scene.body.points.dtype))
        radius = getattr(scene.pressed.shape, "radius", 0.0) + p["radius"]  # `put` refuses a shape without one
        return scene.put({"probe.offset": offset, "probe.shape.radius": radius, "body.points": points})

    def channels(
        self, p: Mapping[str, Array], test: ProbingTest, channels: Mapping[str, Channel]
    ) -> Mapping[str, Channel]:
        if "markers" not in channels:
            return channels
        seen = channels["markers"]
        c, s = jnp.cos(p["turn"]), jnp.sin(p["turn"])
        x, y, z = (seen.values[..., i] for i in range(3))
        dx, dy = x - test.rest[:, 0], y - test.rest[:, 1]  # displacements turn, rest positions are measured
        turned = jnp.stack([x + (c - 1.0) * dx - s * dy, y + s * dx + (c - 1.0) * dy, z], -1)
        return {**channels, "markers": Channel(seen.time, turned, seen.unit, seen.noise_std)}

"""Gravity: the organ was measured as it lay there, so its settled shape already carries stress."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array

from tissuejax.effects.effect import Effect
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.tled.gravity import stress_free
from tissuejax.tled.scene import Scene


class Gravity(Effect):
    """Weight along -z of the density times `acceleration`, on a stress-free shape that settles to the measured one.

    The shape is solved for again whenever a value changes, in double precision. Neutral: 0. Usually known (9.81), and
    then added with that value fixed; fitted, it tells whether the measured shape was the loaded one.
    Reveals: force and lateral force that change with height over the support as if the tissue were stiffer below.
    Blind: small or stiff samples, whose sag (density g height^2 / (2 E)) is far below the depth of the probe.
    """

    name: ClassVar[str] = "gravity"
    kinds: ClassVar[frozenset[str]] = frozenset({"probing"})
    remembers: ClassVar[bool] = False
    candidate: ClassVar[bool] = False
    standard: ClassVar[Mapping[str, float]] = {"acceleration": 9.81}
    reveals: ClassVar[str] = "tissue that seems stiffer towards the support and softer at its free sides"
    blind: ClassVar[str] = "samples whose sag is small against the depth; material tests"
    words: ClassVar[tuple[str, ...]] = ("it weighs with {acceleration}",)
    source: ClassVar[str] = "Lister 2012, 2.2.4, with the stress-free shape solved for"
    amplitudes: ClassVar[tuple[str, ...]] = ("acceleration",)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("acceleration", "m/s^2", 0.0, 0.0, 50.0, "of gravity, downwards", scale=9.81),)

    def scene(self, p: Mapping[str, Array], test: ProbingTest, scene: Scene) -> Scene:
        dtype = scene.body.points.dtype
        weight = jnp.array([0.0, 0.0, -1.0]) * p["acceleration"]
        return stress_free(scene.put({"gravity": weight}).cast(jnp.float64)).scene.cast(dtype)

"""The capsule: a thin stiff membrane on the surface of the organ."""

from collections.abc import Mapping
from typing import ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array

from tissuejax.effects.effect import Effect
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.tled.capsule import ballast
from tissuejax.tled.scene import Scene


class Capsule(Effect):
    """A neo-Hookean membrane of `stiffness` (shear modulus times thickness) on all boundary facets. Neutral: 0.

    Reveals: force that is too large at small depth and markers that move farther from the probe than a bulk allows.
    Blind: one site and no markers, where it passes for a stiffer tissue.
    """

    name: ClassVar[str] = "capsule"
    kinds: ClassVar[frozenset[str]] = frozenset({"probing"})
    group: ClassVar[str] = "base"
    remembers: ClassVar[bool] = False
    reveals: ClassVar[str] = "surface dips too wide for the depth: markers far from the probe move too much"
    blind: ClassVar[str] = "force alone at one depth; material tests (the specimen is cut from inside)"
    words: ClassVar[tuple[str, ...]] = ("a capsule of {stiffness} covers the tissue",)
    source: ClassVar[str] = "membrane of Glisson's capsule; Hollenstein et al. 2006"
    amplitudes: ClassVar[tuple[str, ...]] = ("stiffness",)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("stiffness", "N/m", 0.0, 0.0, 1e4, "shear modulus times thickness", scale=2.0),)

    def scene(self, p: Mapping[str, Array], test: ProbingTest, scene: Scene) -> Scene:
        held = ballast(scene.body, jax.lax.stop_gradient(jnp.asarray(p["stiffness"])), scene.clock.step)
        return scene.put({"tissue.capsule": p["stiffness"], "probe.mass": scene.pressed.mass + held})

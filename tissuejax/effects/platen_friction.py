"""Platen friction: a compressed cylinder sticks to its platens, barrels, and feels stiffer than it is."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Form, Offer, Sizes
from tissuejax.effects.material_test import MaterialTest
from tissuejax.parameters import Parameter


class PlatenFriction(Effect):
    """Compressive stress is raised by 1 + friction d/(3 h), d and h the current diameter and height.

    With incompressibility d/h = (d0/h0) l^(-3/2). Acts in uniaxial compression only. An unknown diameter (and area) or
    height counts as d0 = h0.

    Revealed by compression that is stiffer than tension allows, the more the flatter the specimen. Blind: tension,
    shear; compression of one aspect ratio alone (it is then part of the energy).
    Source: Siebel 1923; Hill 1950, The Mathematical Theory of Plasticity, ch. 10: p = Y (1 + mu d/(3 h)).
    """

    name: ClassVar[str] = "platen-friction"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous"})
    reveals: ClassVar[str] = "compression stiffer than tension allows, the more the flatter the specimen"
    blind: ClassVar[str] = "tension, planar, biaxial and shear tests"
    words: ClassVar[tuple[str, ...]] = ("the platens rub with a coefficient of {friction}",)
    source: ClassVar[str] = "Siebel 1923; Hill 1950, ch. 10"
    order: ClassVar[int] = 0
    amplitudes: ClassVar[tuple[str, ...]] = ("friction",)

    @classmethod
    def in_material_tests(cls, sizes: Sizes) -> Offer:
        """See `Effect.in_material_tests`."""
        other = Form("another aspect", ("friction", "flattening"), {"flattening": (0.0,)}, nominated=False)
        return Offer(cls(), (Form("", ("friction",)), other))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        meaning = "coefficient between platen and tissue"
        power = "power of 1/stretch with which the aspect grows: 1.5 keeps the volume"
        return (
            Parameter("friction", "1", 0.0, lower=0.0, upper=2.0, scale=0.1, meaning=meaning),
            Parameter("flattening", "1", 1.5, lower=-1.0, upper=5.0, scale=0.5, frozen=True, meaning=power),
        )

    def stress(
        self, p: Mapping[str, Array], test: MaterialTest, stress: Float[Array, "n ..."]
    ) -> Float[Array, "n ..."]:
        if test.mode != "extension":
            return stress
        aspect = test.diameter / test.height
        aspect = jnp.where(jnp.isnan(aspect), 1.0, aspect)
        squeezed = (test.drive < 1) * 2 * test.swell  # swell is 1/2 where the sides are free, else 0
        return stress * (1 + squeezed * p["friction"] * aspect * test.drive ** -p["flattening"] / 3)

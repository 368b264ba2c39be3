"""Compressibility: the tissue gives way to pressure, at once or as fluid drains out of it."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Form, Offer, Price, Probed, Sizes
from tissuejax.effects.history import fading
from tissuejax.effects.material_test import MaterialTest
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.tled.history import Prony
from tissuejax.tled.scene import Scene


class Compressibility(Effect):
    """ln J = immediate s + drained (s - h), s = sigma_m J^power, h the past of s fading with `time`.

    sigma_m is the mean Cauchy stress, `immediate` is 1/K at once, `drained` the further compressibility once the
    fluid has come to rest (one exponential: the slowest mode of consolidation). It adds to the base's own volumetric
    energy. `power` says of which law: -1/2 (the default) is K/2 (J - 1)^2 up to (ln J)^3/24, 1 is K/2 (ln J)^2.

    Revealed by uniaxial and planar tests that disagree, and by relaxation in tests with free sides that is missing in
    shear. Blind: simple shear of an energy in I1 alone, and uniaxial tests alone (1/K is then taken up by the
    stiffness).
    Source: Mow et al. 1980, J. Biomech. Eng. 102 (biphasic relaxation), here in one mode; Holzapfel 2000, sec. 6.4.
    """

    name: ClassVar[str] = "compressibility"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous", "probing"})
    searches: ClassVar[bool] = True
    price: ClassVar[Price] = Price(3.0, memory=8.0)
    group: ClassVar[str] = "history"
    reveals: ClassVar[str] = "disagreement between tests of unlike constraint, relaxation that is absent in shear"
    blind: ClassVar[str] = "simple shear; uniaxial tests alone"
    words: ClassVar[tuple[str, ...]] = (
        "volume is lost at once (1/K {immediate})",
        "volume is lost by draining (1/K {drained} in {time})",
    )
    needs: ClassVar[Mapping[str, str]] = {"homogeneous": "constraints"}
    source: ClassVar[str] = "Mow et al. 1980; Holzapfel 2000, sec. 6.4"
    amplitudes: ClassVar[tuple[str, ...]] = ("immediate", "drained")
    timed: ClassVar[tuple[str, ...]] = ("drained", "time")
    slow: ClassVar[tuple[str, ...]] = ("drained", "time")
    grid: ClassVar[Mapping[str, tuple[float, ...]]] = {"time": (1.0, 5.0, 25.0)}

    @classmethod
    def in_material_tests(cls, sizes: Sizes) -> Offer:
        """See `Effect.in_material_tests`."""
        free = ("immediate", "drained", "time")
        other = Form("another volumetric law", (*free, "power"), {"power": (1.0,)}, nominated=False)
        return Offer(cls(), (Form("", free, dict(cls.grid)), other))

    @classmethod
    def in_probings(cls, sizes: Probed) -> Offer:
        """See `Effect.in_probings`."""
        return Offer(cls(), (Form("draining", ("drained", "time"), {"time": (4.0,)}),))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("immediate", "1/Pa", 0.0, lower=0.0, upper=1.0, scale=1e-5, meaning="1/K at once"),
            Parameter("drained", "1/Pa", 0.0, lower=0.0, upper=1.0, scale=1e-5, meaning="further 1/K after draining"),
            Parameter("time", "s", 10.0, lower=1e-3, upper=1e6, meaning="time of draining"),
            Parameter("power", "1", -0.5, -0.5, 1.0, "of J: -1/2 quadratic in J, 1 in ln J", scale=0.5, frozen=True),
        )

    def volume(
        self, p: Mapping[str, Array], test: MaterialTest, mean: Float[Array, " n"], ln_J: Float[Array, " n"]
    ) -> Float[Array, " n"]:
        felt = mean * jnp.exp(p["power"] * ln_J)
        undrained = fading(test.time, felt[:, None], p["time"])[:, 0]
        return p["immediate"] * felt + p["drained"] * (felt - undrained)

    def scene(self, p: Mapping[str, Array], test: ProbingTest, scene: Scene) -> Scene:
        # a held strain relaxes by g = 1 - 1/(1 + K drained), faster than a stress creeps: time / (1 + K drained)
        values = scene.tissue.volumetric_values
        K = scene.tissue.volumetric.bulk_modulus(values)
        softer = 1.0 / (1.0 + K * p["immediate"])
        scaled = {k: v / softer if k.startswith("D") else v * softer for k, v in values.items()}
        more = K * softer * p["drained"]
        drain = Prony(jnp.atleast_1d(more / (1.0 + more)), jnp.atleast_1d(p["time"] / (1.0 + more)))
        return scene.put({"tissue.volumetric_values": scaled, "tissue.drain": drain})

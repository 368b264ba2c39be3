"""Machine compliance: the rig between sensor and tissue gives way under load."""

from collections.abc import Mapping
from typing import ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.effects.cutting_test import Cut
from tissuejax.effects.effect import Effect, Respond
from tissuejax.effects.form import Form, Offer, Price, Probed, Sizes
from tissuejax.effects.material_test import MaterialTest
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.tled.scene import Scene


class MachineCompliance(Effect):
    """Specimen's stretch x solves x + compliance (area/height) P(x) = recorded stretch, P its nominal stress.

    Force is P area and the rig's displacement compliance times force, a share of the height. Solved by four Newton
    steps with the slope of P under a shift of the whole history (exact for an elastic specimen). An unknown area or
    height counts as a cube of 1 cm edge. In a cut the blade stands compliance * force behind where it was driven to,
    along the cut. Neutral: compliance 0.

    Revealed by stiffness that falls with load, alike in tension and compression, and by specimens of unlike size that
    disagree; in cuts by a deeper one that sets in later. Blind: one specimen in one mode: it then looks like another
    energy (or slack); cuts of one depth, where it is a longer way to set in.
    Source: Kalidindi, Abusafieh and El-Danaf 1997, Exp. Mech. 37 (compliance of test machines).
    """

    name: ClassVar[str] = "machine-compliance"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous", "probing", "cutting"})
    searches: ClassVar[bool] = True
    price: ClassVar[Price] = Price(5.0, memory=8.0, fibres=8.0)
    group: ClassVar[str] = "rig"
    displaces: ClassVar[tuple[str, ...]] = ("compliance",)
    remembers: ClassVar[bool] = False
    reveals: ClassVar[str] = (
        "apparent stiffness that falls with load; specimens of unlike size disagree; deeper cuts set in later"
    )
    blind: ClassVar[str] = "one specimen in one mode; cuts of one depth"
    words: ClassVar[tuple[str, ...]] = ("the rig gives way by {compliance}",)
    needs: ClassVar[Mapping[str, str]] = {"homogeneous": "unlike"}
    source: ClassVar[str] = "Kalidindi, Abusafieh and El-Danaf 1997"
    order: ClassVar[int] = 0
    amplitudes: ClassVar[tuple[str, ...]] = ("compliance",)

    @classmethod
    def in_material_tests(cls, sizes: Sizes) -> Offer:
        """See `Effect.in_material_tests`."""
        stiffening = Form("stiffening", ("compliance", "bend"), {"bend": (3 / sizes.force,)}, nominated=False)
        return Offer(cls(), (Form("", ("compliance",)), stiffening))

    @classmethod
    def in_probings(cls, sizes: Probed) -> Offer:
        """See `Effect.in_probings`."""
        return Offer(cls(), (Form("", ("compliance",)),))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        meaning = "displacement of the rig a newton"
        bend = "rig that stiffens: asinh(bend F)/bend gives way in place of F"
        return (
            Parameter("compliance", "m/N", 0.0, lower=0.0, upper=10.0, scale=1e-3, meaning=meaning),
            Parameter("bend", "1/N", 0.0, lower=0.0, upper=1e4, scale=1.0, frozen=True, meaning=bend),
        )

    def stretch(
        self, p: Mapping[str, Array], test: MaterialTest, drive: Float[Array, "n ..."], respond: Respond
    ) -> Float[Array, "n ..."]:
        ratio = test.area / test.height
        ratio = jnp.where(jnp.isnan(ratio), 0.01, ratio)
        share = p["compliance"] * ratio
        area = jnp.where(jnp.isnan(test.area), 1e-4, test.area)
        bent = p["bend"] > 0
        bend = jnp.where(bent, p["bend"], 1.0) * area  # of the nominal stress

        def newton(x: Array, _: None) -> tuple[Array, None]:
            stress, slope = jax.jvp(respond, (x,), (jnp.ones_like(x),))
            given = jnp.where(bent, jnp.arcsinh(bend * stress) / bend, stress)
            slope = jnp.where(bent, slope / jnp.sqrt(1 + (bend * stress) ** 2), slope)
            return x - (x + share * given - drive) / (1 + share * slope), None

        return jax.lax.scan(newton, drive, None, length=4)[0]

    def scene(self, p: Mapping[str, Array], test: ProbingTest, scene: Scene) -> Scene:
        return scene.put({"probe.compliance": p["compliance"]})

    def cut(self, p: Mapping[str, Array], cut: Cut) -> Cut:
        return cut.with_(compliance=jnp.asarray(p["compliance"]))

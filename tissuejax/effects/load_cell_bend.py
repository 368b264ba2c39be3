"""A load cell whose reading bends with the load."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.effects.effect import Effect
from tissuejax.effects.material_test import MaterialTest
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.recordings.recording import Channel


class LoadCellBend(Effect):
    """Reported force = F + bend F |F|, each axis by itself: the second-order error of a calibration by one gain.

    Of a material test F is stress times area; an unknown area counts as 1 cm^2.

    Revealed by stiffness that grows with the force itself, alike in tension and compression, in small and large
    specimens, at all rates. Blind: one specimen in one mode: it then looks like another energy.
    Source: non-linearity of force-proving instruments, ISO 376:2011, 8.4 (second-order interpolation).
    """

    name: ClassVar[str] = "load-cell-bend"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous", "probing"})
    remembers: ClassVar[bool] = False
    reveals: ClassVar[str] = "a gain that grows with the force itself, in every mode and at every rate"
    blind: ClassVar[str] = "one specimen in one mode; one depth"
    words: ClassVar[tuple[str, ...]] = ("the load cell reads {bend} more for every newton",)
    needs: ClassVar[Mapping[str, str]] = {"homogeneous": "unlike"}
    source: ClassVar[str] = "ISO 376:2011, 8.4"
    order: ClassVar[int] = 0
    amplitudes: ClassVar[tuple[str, ...]] = ("bend",)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("bend", "1/N", 0.0, lower=-10.0, upper=10.0, scale=0.1, meaning="gain gained a newton"),)

    def stress(
        self, p: Mapping[str, Array], test: MaterialTest, stress: Float[Array, "n ..."]
    ) -> Float[Array, "n ..."]:
        area = jnp.where(jnp.isnan(test.area), 1e-4, test.area)
        return stress + p["bend"] * area * stress * jnp.abs(stress)

    def channels(
        self, p: Mapping[str, Array], test: ProbingTest, channels: Mapping[str, Channel]
    ) -> Mapping[str, Channel]:
        seen = channels["force"]
        force = seen.values + p["bend"] * seen.values * jnp.abs(seen.values)
        return {**channels, "force": Channel(seen.time, force, seen.unit, seen.noise_std)}

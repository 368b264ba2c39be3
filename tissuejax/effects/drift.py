"""Drift: offset and slow drift of the load cell of a material test."""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Form, Offer, Sizes
from tissuejax.effects.history import dying
from tissuejax.effects.material_test import MaterialTest
from tissuejax.parameters import Parameter


class Drift(Effect):
    """Reported stress = stress + offset + rate t, t the time since the recording began.

    One offset and one rate for all recordings, or with `separate` of their own for each. A gain of the sensor is NOT
    here: it can't be told from a stiffness scale by any data of one sample. The force of a probing drifts in three
    axes: `force-drift`.

    Revealed by stress at rest, before loading and after unloading. Blind: none that has samples at rest; without them
    the offset trades with the energy's form. Source: linear sensor model.
    """

    name: ClassVar[str] = "drift"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous"})
    added: ClassVar[bool] = True
    reveals: ClassVar[str] = "stress at rest, growing in time"
    blind: ClassVar[str] = "recordings without samples at rest; a wrong gain is never seen"
    words: ClassVar[tuple[str, ...]] = ("the load cell's zero is off by {offset}", "it drifts by {rate}")
    source: ClassVar[str] = "linear sensor model"
    order: ClassVar[int] = 0
    amplitudes: ClassVar[tuple[str, ...]] = ("offset", "rate")
    timed: ClassVar[tuple[str, ...]] = ("rate", "settling")
    slow: ClassVar[tuple[str, ...]] = ("rate", "settling")
    separate: bool = False

    @classmethod
    def in_material_tests(cls, sizes: Sizes) -> Offer:
        """See `Effect.in_material_tests`."""
        forms = (
            Form("offset", ("offset",)),
            Form("offset and rate", ("offset", "rate")),
            Form("each recording", ("offset", "rate"), each=("offset", "rate")),
            Form("dying", ("offset", "rate", "settling"), {"settling": (4 / sizes.recording,)}, nominated=False),
        )
        return Offer(cls(separate=True), forms)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        each = self.separate
        return (
            Parameter("offset", "Pa", 0.0, scale=10.0, each=each, meaning="zero error of the load cell"),
            Parameter("rate", "Pa/s", 0.0, scale=1.0, each=each, meaning="drift of the load cell"),
            Parameter("settling", "1/s", 0.0, lower=0.0, upper=10.0, scale=0.1, frozen=True, meaning="dying out of it"),
        )

    def stress(
        self, p: Mapping[str, Array], test: MaterialTest, stress: Float[Array, "n ..."]
    ) -> Float[Array, "n ..."]:
        drift = p["offset"] + p["rate"] * dying(test.elapsed, p["settling"])
        return stress + (drift if stress.ndim == 1 else drift[:, None])

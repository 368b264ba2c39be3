"""Slack: the specimen's strain begins later than the recorded one, or began before it."""

from collections.abc import Mapping
from typing import ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.effects.effect import Effect, Respond
from tissuejax.effects.form import Form, Offer, Sizes
from tissuejax.effects.material_test import MaterialTest
from tissuejax.parameters import Parameter

CORNERS = (0.01, 0.02, 0.04, 0.08, 0.15, 0.3)  # of the largest strain: where a gap may end


class Slack(Effect):
    """Specimen's strain is the recorded one short of `gap`, and zero inside the gap; or it is ahead of it by `preload`.

    strain is stretch - 1 or shear; play acts to the side of its sign, in tension and in compression alike. With
    `roundness` rho > 0 the onset is gradual: gap (1 - exp(-(|strain|/gap)^(1/rho)))^rho is lost, a toe region of
    exponential form at 1.

    The other way round, a recording that is set to zero at a threshold of force begins with a specimen that is loaded:
    of length 1 + `preload` (1 - `preload` where it is pressed) times that at rest, which multiplies every stretch.

    Revealed by no load around rest and a sharp onset, or by load at the recorded rest that bends with the law. Blind:
    recordings that start beyond the gap (it is then an offset of the stretch). Source: ASTM D882, toe compensation.
    """

    name: ClassVar[str] = "slack"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous"})
    reveals: ClassVar[str] = "no load around rest, then a sharp onset; or load at the recorded rest"
    blind: ClassVar[str] = "recordings that start beyond the gap"
    words: ClassVar[tuple[str, ...]] = (
        "the first {gap:%} of the strain is slack",
        "the specimen was strained by {preload:%} already where the recording has its zero",
    )
    source: ClassVar[str] = "ASTM D882, toe compensation"
    order: ClassVar[int] = 0
    amplitudes: ClassVar[tuple[str, ...]] = ("gap", "preload")

    @classmethod
    def in_material_tests(cls, sizes: Sizes) -> Offer:
        """See `Effect.in_material_tests`."""
        forms = (
            Form("", ("gap",), corners={"gap": tuple(s * sizes.strain for s in CORNERS)}),
            Form("rounded", ("gap", "roundness"), {"roundness": (0.4, 1.0)}, nominated=False),
            Form("loaded before", ("preload",)),
        )
        return Offer(cls(), forms)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        meaning = "strain before the specimen is loaded"
        return (
            Parameter("gap", "1", 0.0, lower=0.0, upper=0.5, scale=0.01, meaning=meaning),
            Parameter("roundness", "1", 0.0, lower=0.0, upper=2.0, scale=0.2, frozen=True, meaning="of the onset"),
            Parameter("preload", "1", 0.0, lower=0.0, upper=0.3, scale=0.01, frozen=True, meaning="strain at its zero"),
        )

    def stretch(
        self, p: Mapping[str, Array], test: MaterialTest, drive: Float[Array, "n ..."], respond: Respond
    ) -> Float[Array, "n ..."]:
        drive = self.loaded(p["preload"], test, drive)
        strain = drive - test.rest
        # Subtracted from the drive, not added to rest, so that no gap changes no bit.
        size, gap = jnp.abs(strain), p["gap"]

        def rounded(roundness: Array) -> Array:
            power = 1 / roundness
            far = jnp.minimum((jnp.maximum(size, 1e-12) / jnp.maximum(gap, 1e-12)) ** power, 50.0)
            return gap * (-jnp.expm1(-far)) ** (1 / power)

        # powers cost as much as all the rest of a prediction, and few slacks are rounded
        lost = jax.lax.cond(p["roundness"] > 0, rounded, lambda _: jnp.minimum(size, gap), p["roundness"])
        return drive - jnp.sign(strain) * lost

    @staticmethod
    def loaded(preload: Float[Array, ""], test: MaterialTest, drive: Float[Array, "n ..."]) -> Float[Array, "n ..."]:
        """The drive of a specimen strained by `preload` at its recorded zero, to the side that it is loaded to."""
        farthest = jnp.argmax(jnp.abs(drive - test.rest), axis=0, keepdims=True)
        more = jnp.sign(jnp.take_along_axis(drive, farthest, axis=0) - test.rest) * preload
        return drive + more * (1.0 if test.mode == "shear" else drive)

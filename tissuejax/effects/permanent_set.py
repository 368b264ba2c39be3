"""Permanent set: tissue that has been strained stays a little longer (or shorter) than it was."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.effects.effect import Effect, Respond
from tissuejax.effects.form import Form, Offer, Sizes
from tissuejax.effects.history import running_peak
from tissuejax.effects.material_test import MaterialTest
from tissuejax.parameters import Parameter


class PermanentSet(Effect):
    """Elastic strain = strain - amount (largest + smallest strain so far), strain being stretch - 1 or shear.

    The stress-free length follows the extremes of the past, in tension and in compression alike. Strain below
    `threshold` leaves nothing behind (0 unless named). Strain is (l^m - 1)/m of stretch l, m being `measure`: 1 unless
    named, 0 the logarithm (a set that multiplies the length in place of adding to it).

    Revealed by stress of the opposite sign when the specimen is brought back to its first length, and by a shifted
    origin in later cycles. Blind: monotonic loading (the amount is then taken up by the stiffness).
    Source: Seth 1964 (family of strain measures); Mullins 1969, Rubber Chem. Technol. 42; Diani, Fayolle and Gilormini
    2009, Eur. Polym. J. 45, sec. 2.
    """

    name: ClassVar[str] = "permanent-set"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous"})
    reveals: ClassVar[str] = "stress of the opposite sign at the first length, shifted origin in later cycles"
    blind: ClassVar[str] = "monotonic loading"
    words: ClassVar[tuple[str, ...]] = ("{amount:%} of the largest strain stays",)
    needs: ClassVar[Mapping[str, str]] = {"homogeneous": "reversed"}
    source: ClassVar[str] = "Mullins 1969; Diani, Fayolle and Gilormini 2009"
    amplitudes: ClassVar[tuple[str, ...]] = ("amount",)

    @classmethod
    def in_material_tests(cls, sizes: Sizes) -> Offer:
        """See `Effect.in_material_tests`."""
        grid = {"threshold": (0.0, 0.2 * sizes.strain), "measure": (0.1,)}
        later = Form("with threshold", ("amount", "threshold", "measure"), grid, nominated=False)
        return Offer(cls(), (Form("", ("amount",)), later))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        meaning = "share of the largest past strain that stays"
        least = "strain that leaves nothing behind"
        return (
            Parameter("amount", "1", 0.0, lower=0.0, upper=0.9, scale=0.05, meaning=meaning),
            Parameter("threshold", "1", 0.0, lower=0.0, upper=0.5, scale=0.02, frozen=True, meaning=least),
            Parameter("measure", "1", 1.0, lower=-4.0, upper=4.0, scale=0.5, frozen=True, meaning="measure of strain"),
        )

    def stretch(
        self, p: Mapping[str, Array], test: MaterialTest, drive: Float[Array, "n ..."], respond: Respond
    ) -> Float[Array, "n ..."]:
        least, m = p["threshold"], p["measure"]
        m = jnp.where(jnp.abs(m) < 1e-3, 1e-3, m)  # the logarithm to a thousandth
        shear = test.mode == "shear"
        strain = drive if shear else (drive**m - 1) / m
        both = jnp.stack([strain - least, -strain - least], axis=-1)
        pulled, pushed = jnp.moveaxis(running_peak(jnp.maximum(both, 0.0)), -1, 0)
        extremes = pulled - pushed
        if shear:
            return drive - p["amount"] * extremes
        kept = -m * p["amount"] * extremes * drive**-m
        return drive * jnp.exp(jnp.log1p(jnp.maximum(kept, -0.99)) / m)

"""Anisotropy: one family of fibres, or two alike, in a direction that is not known beforehand."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Form, Offer, Probed, Sizes
from tissuejax.energies.barrier import expm1
from tissuejax.energies.strain import Strain
from tissuejax.parameters import Parameter


class Anisotropy(Effect):
    """psi = k1/(2 k2) (exp(k2 E^2) - 1), E = I4bar - 1, I4bar the squared isochoric stretch of the fibres.

    Direction in the sample's frame: `angle` from x towards y, `elevation` from that plane towards z. Shortened fibres
    carry the share `compression` of what they would (0: tension only, the usual assumption; not fitted unless named).
    With two `families` half of them lie at angle + `spread`, half at angle - `spread`: psi is the mean of the two.
    `crimped` fibres bear nothing until they are straight: E = I4bar - 1 - `onset` then, where that is positive.

    Revealed by different stiffness of specimens cut, or stretched, along different directions. Blind: recordings in one
    direction, or without a `direction`, unless biaxial.
    Source: Holzapfel, Gasser and Ogden 2000, J. Elasticity 61, eq. 65; crimp: Lanir 1983, J. Biomech. 16, 1-12.
    """

    name: ClassVar[str] = "anisotropy"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous", "probing"})
    group: ClassVar[str] = "law"
    remembers: ClassVar[bool] = False
    reveals: ClassVar[str] = "stiffness that differs between directions"
    blind: ClassVar[str] = "uniaxial recordings in a single direction"
    words: ClassVar[tuple[str, ...]] = ("fibres of {k1} run at {angle} to x", "stiffening with k2 {k2}")
    needs: ClassVar[Mapping[str, str]] = {"homogeneous": "directions"}
    source: ClassVar[str] = "Holzapfel, Gasser and Ogden 2000, eq. 65"
    isotropic: ClassVar[bool] = False
    amplitudes: ClassVar[tuple[str, ...]] = ("k1",)
    grid: ClassVar[Mapping[str, tuple[float, ...]]] = {
        "k2": (1.0,),
        "angle": (0.0, np.pi / 4, np.pi / 2, 3 * np.pi / 4),
        "elevation": (0.0, np.pi / 4, np.pi / 2),
    }

    families: int = 1
    crimped: bool = False

    @classmethod
    def in_material_tests(cls, sizes: Sizes) -> Offer:
        """See `Effect.in_material_tests`."""
        stretched = sizes.stretched
        steepest = 10 / stretched**2  # e^10 at the largest stretch
        # steep fibres don't show that they are crimped: nothing is left of them
        mild = {"k2": (min(1.0, steepest / 10),)}
        most, fibre = {"k2": steepest}, ("k1", "k2", "angle")
        # along an axis of the test an angle has no slope to leave it by
        plane = {"angle": tuple(0.15 + np.arange(4) * np.pi / 4), **mild}
        # one family may lie along an axis, and two alike about it
        aside = {"spread": (0.4,), "angle": (0.4, 1.2, 2.0, 2.7)}
        crimped = {"onset": (0.1 * stretched, 0.4 * stretched), **mild}
        both = {"onset": (0.05 * stretched,), "spread": (0.05, 0.4), **mild}
        further = (
            ("any direction", ("elevation",), {"elevation": (0.3, -0.8)}),
            ("two families", ("spread",), aside),
            ("crimped", ("onset",), crimped),
            ("crimped, two families", ("spread", "onset"), both),
        )
        forms = (
            Form("in the xy plane", fibre, plane, most=most),
            *(Form(n, (*fibre, *more), grid, nominated=False, most=most) for n, more, grid in further),
        )
        return Offer(cls(families=2, crimped=True), forms, simple=cls())  # a second family costs half as much again

    @classmethod
    def in_probings(cls, sizes: Probed) -> Offer:
        """See `Effect.in_probings`."""
        return Offer(cls(), (Form("", ("k1", "angle"), {"angle": tuple(np.arange(4) * np.pi / 4)}),))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        spread = Parameter(
            "spread", "rad", 0.0, 0.0, np.pi / 2, "half the angle of two families", scale=0.3, frozen=True
        )
        meaning = "squared stretch less 1 from which crimped fibres bear load"
        onset = Parameter("onset", "1", 0.0, 0.0, 2.0, meaning, scale=0.05, frozen=True)
        return (
            Parameter("k1", "Pa", 0.0, lower=0.0, scale=100.0, meaning="stiffness of the fibres"),
            Parameter("k2", "1", 1.0, lower=1e-3, upper=1e3, meaning="stiffening of the fibres"),
            Parameter("angle", "rad", 0.0, lower=-7.0, upper=7.0, scale=0.3, meaning="of the fibres, from x to y"),
            Parameter("elevation", "rad", 0.0, lower=-7.0, upper=7.0, scale=0.3, meaning="of the fibres, towards z"),
            *([spread] if self.families == 2 else []),
            *([onset] if self.crimped else []),
            Parameter("compression", "1", 0.0, lower=0.0, upper=1.0, frozen=True, meaning="share when shortened"),
        )

    def energy(self, p: Mapping[str, Array], strain: Strain) -> Float[Array, "..."]:
        if self.families == 1:
            return self._family(p, strain, p["angle"])
        spread = p["spread"]
        return 0.5 * (self._family(p, strain, p["angle"] + spread) + self._family(p, strain, p["angle"] - spread))

    @staticmethod
    def _family(p: Mapping[str, Array], strain: Strain, angle: Array) -> Float[Array, "..."]:
        C, level = strain.C, jnp.cos(p["elevation"])
        x, y, z = level * jnp.cos(angle), level * jnp.sin(angle), jnp.sin(p["elevation"])
        along = x * x * C.xx + y * y * C.yy + z * z * C.zz + 2 * (x * y * C.xy + x * z * C.xz + y * z * C.yz)
        E = strain.J ** (-2 / 3) * along - 1 - p.get("onset", 0.0)
        squared = jnp.where(E > 0, E * E, p["compression"] * E * E)
        return 0.5 * p["k1"] / p["k2"] * expm1(p["k2"] * squared)

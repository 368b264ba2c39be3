"""Inertia of what moves between the load cell and the specimen."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.effects.effect import Effect
from tissuejax.effects.history import acceleration
from tissuejax.effects.material_test import MaterialTest
from tissuejax.parameters import Parameter


class GripInertia(Effect):
    """Reported force = F + mass x'': a grip that hangs on the load cell is moved with the crosshead, and the cell
    feels what it takes to do so.

    x is the recorded stretch (or shear) times the specimen's height; an unknown height counts as 1 cm, an unknown area
    as 1 cm^2. Of a biaxial test each axis has its own motion and the same mass.

    Revealed by a force that jumps where the crosshead starts, turns or stops, for as long as that takes, against the
    motion before a turn. Blind: recordings too coarse for that; sines of one period, where it is a stiffness.
    Source: Newton's second law; ISO 4965-1:2012, which limits this error in dynamic tests.
    """

    name: ClassVar[str] = "grip-inertia"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous"})
    reveals: ClassVar[str] = "a force that jumps where the crosshead starts, turns or stops"
    blind: ClassVar[str] = "samples too far apart for a start or a turn; sines of one period"
    words: ClassVar[tuple[str, ...]] = ("the load cell carries {mass} that move with the crosshead",)
    needs: ClassVar[Mapping[str, str]] = {"homogeneous": "rates"}
    timed: ClassVar[tuple[str, ...]] = ("mass",)
    source: ClassVar[str] = "ISO 4965-1:2012"
    order: ClassVar[int] = 0
    brief: ClassVar[bool] = True
    amplitudes: ClassVar[tuple[str, ...]] = ("mass",)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("mass", "kg", 0.0, lower=0.0, upper=100.0, scale=0.1, meaning="mass on the load cell"),)

    def stress(
        self, p: Mapping[str, Array], test: MaterialTest, stress: Float[Array, "n ..."]
    ) -> Float[Array, "n ..."]:
        height, area = (jnp.where(jnp.isnan(a), b, a) for a, b in ((test.height, 1e-2), (test.area, 1e-4)))
        return stress + p["mass"] * height / area * acceleration(test.time, test.drive)

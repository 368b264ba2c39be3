"""Friction of the blade on the faces of the cut."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array

from tissuejax.effects.cutting_test import Cut
from tissuejax.effects.effect import Effect
from tissuejax.parameters import Parameter


class BladeFriction(Effect):
    """Coulomb friction `coefficient` on both flats of the blade. Neutral: 0.

    Reveals: a force that grows with the length cut, and one against the motion on the way back and in a second pass.
    Blind: a short cut in one direction, where it passes for toughness.
    """

    name: ClassVar[str] = "blade-friction"
    kinds: ClassVar[frozenset[str]] = frozenset({"cutting"})
    reveals: ClassVar[str] = "force that grows with the length in contact; force on the return stroke"
    blind: ClassVar[str] = "a short cut in one direction"
    words: ClassVar[tuple[str, ...]] = ("the blade rubs with a coefficient of {coefficient}",)
    source: ClassVar[str] = "Spagnoli et al. 2019, Int. J. Mech. Sci. 161; Gokgol et al. 2012"
    amplitudes: ClassVar[tuple[str, ...]] = ("coefficient",)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("coefficient", "1", 0.0, 0.0, 2.0, "friction over normal force", scale=0.1),)

    def cut(self, p: Mapping[str, Array], cut: Cut) -> Cut:
        return cut.with_(friction=cut.friction + jnp.asarray(p["coefficient"]))

"""How the force of a cut sets in at the entry, in a balance of energies."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array

from tissuejax.effects.cutting_test import Cut
from tissuejax.effects.effect import Effect
from tissuejax.parameters import Parameter


class Onset(Effect):
    """The force sets in over ONSET + `longer`; the simulation has its own entry and takes no notice. Neutral: 0.

    Reveals: where the record is still rising. Blind: records that start in the cut.
    """

    name: ClassVar[str] = "onset"
    kinds: ClassVar[frozenset[str]] = frozenset({"cutting"})
    reveals: ClassVar[str] = "a force that is still rising some way after the entry"
    blind: ClassVar[str] = "records that start in the cut"
    words: ClassVar[tuple[str, ...]] = ("the force takes {longer} more than 2 mm to rise",)
    source: ClassVar[str] = "Mahvash & Hayward 2001 (deformation before rupture)"
    amplitudes: ClassVar[tuple[str, ...]] = ("longer",)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("longer", "m", 0.0, -1.8e-3, 2e-2, "over 2 mm, the length of the rise", scale=1e-3),)

    def cut(self, p: Mapping[str, Array], cut: Cut) -> Cut:
        return cut.with_(onset=cut.onset + jnp.asarray(p["longer"]))

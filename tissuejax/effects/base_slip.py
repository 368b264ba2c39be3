"""The support does not hold the tissue: its base gives way or slides."""

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

from jaxtyping import Array

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Offer, Probed
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.tled.scene import Scene


class BaseSlip(Effect):
    """Tangential slip of the base: `compliance` times traction at once, plus `fluidity` times traction per second.

    Neutral: both 0 (bonded). Reveals: markers that spread sideways, also far from the probe; with fluidity, creep of
    markers and a residual shift afterwards. Blind: thick tissue over shallow probing, where the base feels nothing.
    There is no Coulomb limit: the slip is proportional to the traction at any load, so a base that holds up to a
    threshold and then slides is only met on average.
    """

    name: ClassVar[str] = "base-slip"
    kinds: ClassVar[frozenset[str]] = frozenset({"probing"})
    group: ClassVar[str] = "base"
    reveals: ClassVar[str] = "markers spread sideways more than a bonded base allows"
    blind: ClassVar[str] = "depths small against the thickness; material tests"
    words: ClassVar[tuple[str, ...]] = ("the base slips by {compliance} under shear", "and creeps by {fluidity}")
    source: ClassVar[str] = "Newtonian or elastic interlayer; the source fixes the base (Lister 2012, 2.2.4)"
    amplitudes: ClassVar[tuple[str, ...]] = ("compliance", "fluidity")

    @classmethod
    def in_probings(cls, sizes: Probed) -> Offer:
        """See `Effect.in_probings`.

        A base gives way by as much as the tissue over it: no fixed length a pascal is small for soft and stiff alike.
        """
        soft = sizes.height / sizes.modulus
        return replace(Offer.whole(cls()), scales={"compliance": 0.2 * soft, "fluidity": 0.04 * soft})

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("compliance", "m/Pa", 0.0, 0.0, 1e-3, "slip per shear traction", scale=1e-6),
            Parameter("fluidity", "m/(s Pa)", 0.0, 0.0, 1e-3, "rate of slip per shear traction", scale=3e-7),
        )

    def scene(self, p: Mapping[str, Array], test: ProbingTest, scene: Scene) -> Scene:
        return scene.put({"support.compliance": p["compliance"], "support.fluidity": p["fluidity"]})

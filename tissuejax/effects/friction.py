"""Coulomb friction between probe and tissue."""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Form, Offer, Probed
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.tled.scene import Scene


class Friction(Effect):
    """Tangential traction up to `coefficient` times the contact pressure, against sliding. Neutral: 0.

    A sticking point moves by `give` times its traction before it slides (a film of fluid, roughness that bends). Where
    friction is strong most of the surface sticks: a straight press then tells the give, and the coefficient only where
    the probe is drawn sideways.

    Reveals: lateral force and hysteresis wherever the probe slides or the surface slips under it, markers near the
    probe dragged along. Blind: a shallow straight press, where the surface hardly slides.
    """

    name: ClassVar[str] = "friction"
    kinds: ClassVar[frozenset[str]] = frozenset({"probing"})
    group: ClassVar[str] = "contact"
    reveals: ClassVar[str] = "lateral force against sliding, and its sign change on the way back"
    blind: ClassVar[str] = "a shallow straight press on a level surface; material tests"
    words: ClassVar[tuple[str, ...]] = ("the tissue rubs on the probe with a coefficient of {coefficient}",)
    source: ClassVar[str] = (
        "Coulomb; Lister 2012, 2.2.4 assumes 0.1; the give before sliding: Dahl 1968, Aerospace report TOR-0158"
    )
    amplitudes: ClassVar[tuple[str, ...]] = ("coefficient",)

    @classmethod
    def in_probings(cls, sizes: Probed) -> Offer:
        """See `Effect.in_probings`."""
        # where the surface sticks, a rigid stick of weak friction passes for a giving one of strong friction
        grid = {"coefficient": (0.45,), "give": (2e-8,)}  # m/Pa: 500 Pa move by 10 micrometres
        giving = Form("giving", ("coefficient", "give"), grid, nominated=False)
        return Offer(cls(), (Form("", ("coefficient",)), giving))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("coefficient", "1", 0.0, 0.0, 2.0, "friction over normal force", scale=0.1),
            Parameter("give", "m/Pa", 0.0, 0.0, 3e-7, "way before sliding per traction", scale=1e-8),
        )

    def scene(self, p: Mapping[str, Array], test: ProbingTest, scene: Scene) -> Scene:
        already = scene.pressed.friction
        rubbing = p["coefficient"] if already is None else already + p["coefficient"]
        return scene.put({"probe.friction": rubbing, "probe.give": scene.pressed.give + p["give"]})

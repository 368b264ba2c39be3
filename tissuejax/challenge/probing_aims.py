"""Probing cases that are aimed at: effects drawn to a size where it is open whether they can be told."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tissuejax.challenge.material import Ingredient
from tissuejax.challenge.probing_menu import CATALOGUED, Course
from tissuejax.challenge.strengths import reach
from tissuejax.errors import NotConverged

Sizes = Callable[[Ingredient], tuple[float, float]]
COARSE = (12, 12, 4)  # hexes on which an amount is sought; its sizes are then measured on the mesh of the case
INNER = 0.15  # of the logarithm of a range, left free at its ends when a size is drawn

# Amounts that are tried, over C10 where the effect is a stiffness; that of a slipping base falls as it stiffens.
TRIED = {
    "base-slip": (2.0, 4000.0),
    "registration": (3e-5, 3e-3),
    "energy-form": (0.2, 40.0),
    "friction": (0.02, 0.7),
    "drift": (1e-3, 8e-2),
}
STIFF = ("base-slip", "energy-form")


@dataclass(frozen=True)
class Aim:
    """What a case is drawn for.

    Attributes:
        name: as its key has it.
        effects: what is concealed, in order.
        least, most: of the size of every effect alone, over the noise.
        markers: least size in the markers, over their noise; where it is set, `least` and `most` are of the force.
    """

    name: str
    effects: tuple[str, ...]
    least: float
    most: float
    markers: float | None = None

    @property
    def courses(self) -> list[Course]:
        """Its effects on the menu."""
        return [c for n in self.effects for c in CATALOGUED if c.name == n]

    def size(self, force: float, markers: float) -> float:
        """The size that is aimed at, of sizes over the noise of force and of markers."""
        return max(force, markers) if self.markers is None else force

    def met(self, force: float, markers: float) -> bool:
        """Whether one of its effects, alone, has the sizes asked for."""
        inside = self.least <= self.size(force, markers) <= self.most
        return inside and (self.markers is None or markers >= self.markers)

    def sized(self, rng: np.random.Generator, drawn: Ingredient, C10: float, sizes: Sizes) -> Ingredient:
        """`drawn` with the amount whose size, as `sizes` (force, markers) finds it, is one drawn from the range."""
        low, high = (x * (C10 if drawn.name in STIFF else 1.0) for x in TRIED[drawn.name])
        sign = -1.0 if drawn.name == "base-slip" else 1.0
        ends = sorted((low**sign, high**sign))
        width = np.log(self.most / self.least)
        target = self.least * float(np.exp(width * rng.uniform(INNER, 1 - INNER)))
        found, _ = reach(lambda x: self.size(*sizes(replace(drawn, amount=x**sign))), target, *ends)
        return replace(drawn, amount=found**sign)

    def check(self, sizes: dict[str, tuple[float, float]]) -> None:
        """Pass where every effect is as large as asked for.

        Raises:
            NotConverged: one is not; the case is to be drawn again.
        """
        for name, (force, markers) in sizes.items():
            if not self.met(force, markers):
                raise NotConverged(
                    f"{self.name}: {name} has {force:.2g} times the noise in the force, {markers:.2g} in the markers"
                )


AIMS = (
    # two times their noise was asked for first; one case drawn on the coarse mesh had 2.2 beside 0.5 in the force
    Aim("a base slip that the markers alone show", ("base-slip",), 0.2, 0.9, markers=1.5),
    Aim("a registration near the noise", ("registration",), 0.7, 1.5),
    Aim("an energy form beside friction", ("energy-form", "friction"), 3.0, 12.0),
    Aim("an energy form beside drift", ("energy-form", "drift"), 3.0, 12.0),
)
TURNS = (0, 1, 2, 0, 1, 3)  # friction and drift share a turn


def aim(index: int) -> Aim:
    """The aim of the case with this number."""
    return AIMS[TURNS[index % len(TURNS)]]

"""The effects of probing cases: which numbers they have and how these are drawn."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tissuejax.challenge.material import Ingredient

Draw = Callable[[np.random.Generator, float], tuple[float, dict]]


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _turn(rng: np.random.Generator) -> list[float]:
    angle = rng.uniform(0, 2 * np.pi)
    return [float(np.cos(angle)), float(np.sin(angle))]


def _moment(rng: np.random.Generator) -> dict:
    """Something happens in one of the two recordings that are fitted, at a share of its time."""
    return {"number": int(rng.integers(2)), "where": float(rng.uniform(0.25, 0.6))}


@dataclass(frozen=True)
class Course:
    """One effect on the menu.

    Attributes:
        name: as in the catalogue, or a name of its own outside it.
        draw: (rng, C10) to (amount, other numbers).
        history: the body has to be followed in time.
        solved: it changes the equilibrium; otherwise it is a matter of paths, clocks and sensors.
        strength: of an amount; the larger, the further from a body without the effect.
    """

    name: str
    draw: Draw
    history: bool = False
    solved: bool = False
    strength: Callable[[float], float] = abs

    def ingredient(self, rng: np.random.Generator, C10: float, draws: int = 1) -> Ingredient:
        """One drawn effect: the strongest of some draws."""
        drawn = [self.draw(rng, C10) for _ in range(draws)]
        amount, shape = max(drawn, key=lambda one: self.strength(one[0]))
        return Ingredient(self.name, "", amount, shape)


CATALOGUED = (
    Course(
        "viscoelasticity",
        lambda r, c: (
            _log(r, 0.08, 0.45),
            {"split": float(r.uniform(0.4, 0.65)), "tau": [_log(r, 0.3, 1), _log(r, 4, 10)]},
        ),
        history=True,
        solved=True,
    ),
    Course(
        "periodic", lambda r, c: (_log(r, 1e-4, 9e-4), {"period": float(r.uniform(2.2, 5)), "second": 0.3}), solved=True
    ),
    Course(
        "inclusion",
        lambda r, c: (
            _log(r, 2.5, 12) if r.random() < 0.75 else _log(r, 0.08, 0.35),
            {
                "under": int(r.integers(2)),
                "axes": [_log(r, 5e-3, 7.5e-3), _log(r, 5e-3, 7.5e-3), _log(r, 3e-3, 4.5e-3)],
                "depth": float(r.uniform(6.5e-3, 9.5e-3)),
                "aside": [float(r.uniform(-2e-3, 2e-3)) for _ in range(2)],
            },
        ),
        solved=True,
        strength=lambda factor: abs(np.log(factor)),
    ),
    Course(
        "contact-offset",
        lambda r, c: (_log(r, 5e-5, 5e-4), {"signs": r.choice([-1.0, -0.4, 0.5, 1.0], 3).tolist()}),
        solved=True,
    ),
    Course("friction", lambda r, c: (_log(r, 0.06, 0.5), {}), history=True, solved=True),
    Course("registration", lambda r, c: (_log(r, 4e-4, 2e-3), {"way": _turn(r)}), solved=True),
    Course(
        "softening", lambda r, c: (_log(r, 0.08, 0.5), {"energy": c * _log(r, 0.02, 0.1)}), history=True, solved=True
    ),
    Course(
        "drift",
        lambda r, c: (_log(r, 4e-3, 3e-2), {"mix": _turn(r)}),
    ),
    Course("capsule", lambda r, c: (_log(r, 1, 15) * c * 1e-2, {}), solved=True),
    Course("adhesion", lambda r, c: (_log(r, 300, 3000), {"range": _log(r, 2e-4, 5e-4)}), history=True, solved=True),
    Course("machine-compliance", lambda r, c: (_log(r, 3e-4, 3e-3), {})),
    Course(
        "base-slip",
        lambda r, c: (_log(r, 0.15, 3.0) * c / 1e-2, {}),
        solved=True,
        strength=lambda stiffness: -stiffness,
    ),
    Course("clock-lag", lambda r, c: (_log(r, 0.04, 0.25) * r.choice([-1.0, 1.0]), {})),
    Course("aging", lambda r, c: (_log(r, 0.03, 0.3) * r.choice([-1.0, 1.0]), {})),
    Course("anisotropy", lambda r, c: (_log(r, 0.5, 6) * c, {"along": [*_turn(r), 0.0]}), solved=True),
    Course("energy-form", lambda r, c: (_log(r, 1, 10) * c, {}), solved=True),
)

# What no catalogue has: the support lets go, links form while held, tissue tears once, the cell is warmed at once and
# cools, the tip turns under its load, a tracker slides to a neighbour of its marker.
STRAY = (
    Course(
        "tissue-slip",
        lambda r, c: (_log(r, 4e-4, 1.5e-3), {"way": [*_turn(r), -0.3], "where": float(r.uniform(0.3, 0.7))}),
        solved=True,
    ),
    Course("cured", lambda r, c: (_log(r, 0.05, 0.4), {"time": float(r.uniform(0.8, 2.5))})),
    Course("torn", lambda r, c: (_log(r, 0.04, 0.3), _moment(r))),
    Course("shock", lambda r, c: (_log(r, 8e-3, 5e-2), {**_moment(r), "time": _log(r, 0.4, 1.5)})),
    Course("rolls", lambda r, c: (_log(r, 0.04, 0.4), {"axis": _turn(r)})),
    Course("marker-jump", lambda r, c: (_log(r, 0.05, 0.5), {**_moment(r), "which": float(r.random())})),
)

NAMES = tuple(c.name for c in CATALOGUED)

# The rest stayed below three times the noise in two sets of strong effects; for a rig that gives way the measure of
# size is blind (the recorded path moves, force and markers don't).
LOUD = tuple(
    c
    for c in CATALOGUED
    if c.name not in ("registration", "capsule", "machine-compliance", "clock-lag", "aging", "anisotropy")
)

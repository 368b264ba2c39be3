"""The effects a challenge case can hold: for each a few laws, how their numbers are drawn, and how strong they may be.

A law is "plain" if the catalogue of effects plausibly has one like it, and "other" if it was meant to differ from it.
Most of the others have become exact members of the catalogue's forms since (`MEMBERS`): a rate over them says nothing
of laws that the catalogue lacks. Truly other are the few that are neither plain nor members.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from tissuejax.challenge.material import Ingredient
from tissuejax.challenge.specimen import Trial, gradient
from tissuejax.challenge.strain_laws import Body

Draw = Callable[[np.random.Generator, "Setting"], dict]

# marked other, and yet the same function as a form of the catalogue (compared side by side to 5e-5 or better)
MEMBERS = frozenset(
    {
        ("slack", "toe"),
        ("machine-compliance", "stiffening"),
        ("platen-friction", "reference"),
        ("aging", "linear"),
        ("drift", "warming"),
        ("permanent-set", "threshold"),
        ("softening", "discontinuous"),
        ("anisotropy", "late"),
        ("energy-form", "ogden"),
        ("periodic", "pulse"),
        ("periodic", "free"),
    }
)


@dataclass(frozen=True)
class Setting:
    """What the drawing of an effect may look at: body, recordings, noise (Pa) and the largest stress (Pa)."""

    body: Body
    trials: list[Trial]
    noise: float
    top: float

    @property
    def energy(self) -> float:
        """Strain energy of the base at the largest stretch of the first recording, Pa."""
        drive = self.trials[0].drive
        F = gradient(self.trials[0].kind, drive[[np.argmax(np.abs(drive - 1))]], np.zeros(1), np.zeros(1))
        return float(self.body.law(np.eye(3))(F @ F)[0][0])


@dataclass(frozen=True)
class Choice:
    """One law of one effect.

    Attributes:
        name, law: as in `Ingredient`.
        least, most: range of its amount (in units of `unit`).
        draw: its other numbers.
        unit: "1", "noise" (Pa) or "spring" (m/N that gives the specimen's own strain at the largest force).
        plain: a law like the catalogue's.
    """

    name: str
    law: str
    least: float
    most: float
    draw: Draw = field(default=lambda rng, s: {})
    unit: str = "1"
    plain: bool = True

    @property
    def member(self) -> bool:
        """Whether the catalogue has this very law among its forms."""
        return self.plain or (self.name, self.law) in MEMBERS

    def ingredient(self, rng: np.random.Generator, setting: Setting) -> tuple[Ingredient, float, float]:
        """An ingredient with its amount at the most, and the range of the amount in SI units."""
        first = setting.trials[0]
        scale = {"1": 1.0, "noise": setting.noise, "spring": 0.25 * first.height / (setting.top * first.area)}[
            self.unit
        ]
        made = Ingredient(self.name, self.law, self.most * scale, self.draw(rng, setting))
        return made, self.least * scale, self.most * scale


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def _prony(rng, s):
    if rng.random() < 0.4:
        return {"shares": [1.0], "tau": [_log(rng, 0.4, 8.0)]}
    share = float(rng.uniform(0.35, 0.65))
    return {"shares": [share, 1 - share], "tau": [_log(rng, 0.3, 1.2), _log(rng, 4.0, 12.0)]}


def _fibre(rng, s):
    angle = rng.uniform(0, np.pi)
    families = [angle] if rng.random() < 0.7 else [angle, angle + rng.uniform(0.5, 1.2)]
    return {"shape": _log(rng, 0.3, 5.0), "along": [[math.cos(a), math.sin(a), 0.0] for a in families]}


def _energies(low: float, high: float) -> Draw:
    return lambda rng, s: {"m": s.energy * _log(rng, low, high)}


def _session(rng, s):
    return {"time": s.trials[-1].start + s.trials[-1].time[-1]}


def _strays(low: float, high: float, key: str) -> Draw:
    return lambda rng, s: {key: float(rng.uniform(low, high))}


def _knee(rng, s):
    return {"knee": 0.3 * s.top * s.trials[0].area}


def _cycle(rng, s):
    return {"period": float(rng.uniform(1.2, 7.0)), "phase": float(rng.uniform(0, 2 * np.pi)), "second": 0.4}


def _mix(rng, s):
    angle = rng.uniform(0, 2 * np.pi)
    return {"mix": [math.cos(angle), math.sin(angle) / 10.0]}


def _moment(rng, s):
    """A moment in the loaded part of one of the recordings that are fitted, s after the first began."""
    trial = s.trials[int(rng.integers(max(len(s.trials) - 1, 1)))]
    return {"at": float(trial.start + rng.uniform(0.25, 0.6) * trial.time[-1])}


CATALOGUED: tuple[Choice, ...] = (
    Choice("viscoelasticity", "pk2", 0.003, 0.7, _prony),
    Choice("viscoelasticity", "nominal", 0.003, 0.7, _prony),
    Choice(
        "viscoelasticity",
        "spectrum",
        0.003,
        0.8,
        lambda rng, s: {"fastest": 0.05, "slowest": _log(rng, 20, 200), "exponent": float(rng.uniform(-0.3, 0.1))},
        plain=False,
    ),
    Choice(
        "viscoelasticity",
        "strained",
        0.003,
        0.7,
        lambda rng, s: {**_prony(rng, s), "b": rng.uniform(-4, 4)},
        plain=False,
    ),
    Choice("softening", "tanh", 0.005, 0.75, _energies(0.05, 0.6)),
    Choice("softening", "erf", 0.005, 0.75, _energies(0.05, 0.6)),
    Choice("softening", "discontinuous", 0.005, 0.75, _energies(0.1, 0.8), plain=False),
    Choice("softening", "stretch", 0.005, 0.75, lambda rng, s: {"m": _log(rng, 0.03, 0.2)}, plain=False),
    Choice("permanent-set", "share", 0.001, 0.4, lambda rng, s: {"threshold": 0.0}),
    Choice("permanent-set", "threshold", 0.001, 0.5, lambda rng, s: {"threshold": 0.06}, plain=False),
    Choice("anisotropy", "exponential", 0.005, 20.0, _fibre),
    Choice("anisotropy", "quadratic", 0.005, 20.0, _fibre),
    Choice("anisotropy", "late", 0.01, 40.0, _fibre, plain=False),
    Choice("energy-form", "c30", 0.005, 10.0),
    Choice("energy-form", "c01", 0.005, 1.5),
    Choice("energy-form", "exponential", 0.01, 3.0, lambda rng, s: {"b": float(rng.uniform(3, 9))}),
    Choice(
        "energy-form", "ogden", 0.005, 1.0, lambda rng, s: {"alpha": [float(rng.choice([-9, -6, 9, 14]))]}, plain=False
    ),
    Choice("compressibility", "bulk", 0.003, 0.35),
    Choice("compressibility", "drained", 0.003, 0.35, lambda rng, s: {"tau": _log(rng, 2.0, 10.0)}),
    Choice("aging", "linear", 0.003, 0.9, _session, plain=False),
    Choice("aging", "exponential", 0.003, 0.9, _session),
    Choice("aging", "settling", 0.003, 0.9, lambda rng, s: {"time": 0.3 * s.trials[-1].start}, plain=False),
    Choice("drift", "linear", 0.1, 60.0, _mix, "noise"),
    Choice("drift", "warming", 0.1, 60.0, _mix, "noise", plain=False),
    Choice("periodic", "triggered", 0.3, 60.0, _cycle, "noise"),
    Choice("periodic", "pulse", 0.3, 60.0, _cycle, "noise", plain=False),
    Choice("periodic", "free", 0.3, 60.0, _cycle, "noise", plain=False),
    Choice("machine-compliance", "linear", 0.003, 1.0, _knee, "spring"),
    Choice("machine-compliance", "stiffening", 0.003, 1.0, _knee, "spring", plain=False),
    Choice("slack", "sharp", 0.0005, 0.06),
    Choice("slack", "smooth", 0.0005, 0.06, plain=False),
    Choice("slack", "toe", 0.0005, 0.06, plain=False),
    Choice("platen-friction", "mean", 0.005, 0.7),
    Choice("platen-friction", "slab", 0.005, 0.7),
    Choice("platen-friction", "reference", 0.005, 0.7, plain=False),
)

STRAY: tuple[Choice, ...] = (
    Choice("slip-event", "", 0.001, 0.08, _strays(0.2, 0.8, "where"), plain=False),
    Choice("torn", "", 0.005, 0.6, _moment, plain=False),
    Choice("stepped", "", 1.0, 25.0, unit="noise", plain=False),
    Choice(
        "shock", "", 0.5, 80.0, lambda rng, s: {**_moment(rng, s), "time": _log(rng, 0.6, 4.0)}, "noise", plain=False
    ),
    Choice("frozen", "", 0.1, 6.0, _strays(0.1, 0.8, "where"), plain=False),
    Choice("cured", "", 0.005, 0.8, lambda rng, s: {"time": _log(rng, 1.0, 5.0)}, plain=False),
    Choice("skipped", "", 0.05, 2.0, _strays(0.2, 0.7, "where"), plain=False),
    Choice("flicker", "", 0.005, 0.6, lambda rng, s: {"seed": int(rng.integers(1 << 30))}, plain=False),
    Choice("stick-slip", "", 0.5, 40.0, _strays(0.01, 0.05, "travel"), "noise", plain=False),
    Choice(
        "spikes",
        "",
        2.0,
        80.0,
        lambda rng, s: {"share": 0.02, "seed": int(rng.integers(1 << 30))},
        "noise",
        plain=False,
    ),
    Choice("slew", "", 0.05, 20.0, plain=False),
    Choice(
        "bumped", "", 0.5, 80.0, lambda rng, s: {**_moment(rng, s), "period": _log(rng, 0.5, 2.0)}, "noise", plain=False
    ),
)

NAMES = tuple(dict.fromkeys(c.name for c in CATALOGUED))

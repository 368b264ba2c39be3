"""What an effect offers a diagnosis: the forms in which it is tried.

Most effects are one candidate. Some come in forms, from simple to full (one relaxation time, two, three; one offset for
all recordings or one each), all under one name: a simple form is nominated, and where it stands it is tried with its
richer and its poorer neighbour, so that a law that differs from ours bends the effect's own form before another
effect is called to help.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from tissuejax.effects.effect import Effect

OWN = "of each stroke's own"  # form of a cut, beside that which is alike in all
Placed = Callable[[Mapping[str, np.ndarray], Mapping[str, float]], Sequence[Mapping[str, float]]]


@dataclass(frozen=True)
class Form:
    """Which parameters of an effect are free in one form of it.

    Attributes:
        name: of the form; "" for the only one.
        free: parameter names, amplitudes and shapes.
        grid: shapes to scan.
        nominated: False for forms that are only reached from a neighbour.
        each: parameters with a value of their own in every recording.
        reach: how many times beyond the values scanned (or the default) a positive shape may go.
        most: limits of exponents, which run away where the fitted recordings hardly reach them.
        beside: names of forms that it is tried beside, whatever the order.
        spectral: a frequency that is read from the residual's periodogram, and how many of its lines are tried; of a
            probing's markers where it has any.
        corners: sizes of amplitudes at which what they do is scored as a whole: a corner moves with them, and no slope
            at neutral says what they do.
        placed: of probings: shapes that are scanned by where the probe went deepest: of these places by recording, m,
            and the tissue's height there, m, settings of the shapes.
        heard: of probings: the channel whose periodogram `spectral` reads; "" for markers where it has any.
        widens: families of the discrepancy that are far larger where this acts, with the standard deviation of their
            prior, a share of what is measured; a form that widens has no parameters.
        lacking: by property of the protocol, what it widens too where the protocol lacks that.
    """

    name: str
    free: tuple[str, ...]
    grid: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    nominated: bool = True
    each: tuple[str, ...] = ()
    reach: float = 10.0
    most: Mapping[str, float] = field(default_factory=dict)
    beside: tuple[str, ...] = ()
    spectral: tuple[str, int] | None = None
    corners: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    placed: Placed | None = None
    heard: str = ""
    widens: Mapping[str, float] = field(default_factory=dict)
    lacking: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Price:
    """How many times longer a prediction of a material test takes where an effect makes a search of it; measured.

    Attributes:
        alone, memory, fibres: beside nothing else; beside stress with a history; beside an energy with directions.
    """

    alone: float = 1.0
    memory: float = 1.0
    fibres: float = 1.0


@dataclass(frozen=True)
class Sizes:
    """What a sample's recordings are like, so that shapes are scanned where they can be seen.

    Attributes:
        energy: typical strain energy, Pa: damage scales are scanned around it.
        strain: largest |ln stretch|: exponents of exponential terms bend within it.
        force: largest force, N: a rig stiffens within it.
        session: time from the first recording to the last, s: drifts die out within it.
        recording: duration of the longest, s.
        step: between samples, the longest, s: faster than that nothing is seen in some recording.
        finest: between samples of the most finely sampled one, s: faster than that nothing is seen in any.
    """

    energy: float
    strain: float
    force: float
    session: float
    recording: float
    step: float = 0.1
    finest: float = 0.0

    @property
    def stretched(self) -> float:
        """The largest squared stretch less 1."""
        return math.expm1(2 * self.strain)


@dataclass(frozen=True)
class Probed:
    """The same of probings.

    Attributes:
        modulus: shear modulus of the tissue, as its force says, Pa.
        height: of the tissue, m.
        session: from the first recording to the end of the last, s.
        recording: duration of the longest, s.
        step: between samples of the force, the longest, s.
        finest: between samples of the most finely sampled one, s: faster than that nothing is seen in any.
    """

    modulus: float
    height: float
    session: float
    recording: float = 10.0
    step: float = 0.05
    finest: float = 0.0

    @property
    def energy(self) -> float:
        """Typical strain energy under the probe, Pa."""
        return 0.1 * self.modulus


@dataclass(frozen=True)
class Offer:
    """An effect as a diagnosis tries it.

    Attributes:
        effect: with all that any of its forms needs.
        forms: simple to full.
        title: the name under which it is reported; its own by default.
        simple: the effect without what makes every prediction a search, for sets that don't use that.
        scales: by parameter, a step that is plainly visible here, where that is not the declared one.
        priors: by parameter, mean and standard deviation of what it may be here.
        ranges: by parameter, (lower, upper, start) of what can be seen here.
        quickest: the shortest of its times (`Effect.times`) that can be seen here, s.
    """

    effect: "Effect"
    forms: tuple[Form, ...]
    title: str = ""
    simple: "Effect | None" = None
    scales: Mapping[str, float] = field(default_factory=dict)
    priors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    ranges: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    quickest: float = 0.0

    @classmethod
    def whole(cls, effect: "Effect") -> "Offer":
        """In one form: all its parameters and the shapes of its grid."""
        free = tuple(p.name for p in effect.parameters if not p.frozen)
        each = tuple(p.name for p in effect.parameters if p.each)
        return cls(effect, (Form("", free, dict(effect.grid), each=each),))

    @classmethod
    def scanned(cls, effect: "Effect") -> "Offer":
        """In one form: its amplitudes and the shapes of its grid, frozen in a fit or not."""
        return cls(effect, (Form("", (*effect.amplitudes, *effect.grid), dict(effect.grid)),))

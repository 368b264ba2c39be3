"""The lengths and times over which a discrepancy is smooth, with unit, meaning and ground of each."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Smoothness:
    """Over which lengths and times what a model leaves of real recordings is smooth.

    Attributes:
        law: correlation lengths of what a law lacks, shares of the range of strain (probings: of the depth). Ground:
            half of the range is a bend of the whole curve, as one term more of a series would make it; an eighth a toe
            or a knee. Lengths between are mixtures of the two.
        turning: correlation length of hysteresis, a share of the range of strain. Ground: a loop's width changes along
            a cycle a few times at most.
        states: path over which the loading state turns where a drive turns round, shares of the range. Ground: a step
            (friction of the rig), rounded loops of tissue, and such as never close; a factor of five apart.
        slow: correlation times of what wanders, shares of a recording's duration. Ground: from a drift of the whole
            recording to what a twentieth of it is needed to see; quicker is scatter.
        begun: share of a recording's duration up to which time is counted, beyond it its logarithm. Ground: laws of
            relaxation err over decades, and fewer than two lie within a recording of some hundred samples.
        waning: correlation time of a gain, a share of a recording's duration. Ground: stiffness that comes and goes
            does so once in a recording; quicker is what wanders.
        band: tremble of a drive that is no turn, a share of its range. Ground: a drive under control is held to that.
        clock: by what share of a recording's duration a clock jumps where the stress would by its peak. Ground: a
            third is as far as a recorder skips unnoticed.
        jump: share of a recording's duration from which on a clock is asked how far it jumped. Ground: of less means of
            samples show the slope alone.
        farther: by which factor the next jump that is asked is larger. Ground: a straight line reaches halfway.
        edge: means of samples at either end of a recording that show no step. Ground: fewer than three can't be told
            from noise.
        moments: times in a recording that are asked whether something happened there, at most. Ground: cost; one in
            two means of samples.
        followed: moments that are asked by how much the clock jumped, at most. Ground: cost; the moment of a jump is
            among the first few by its slope, step and gain.
    """

    law: Mapping[str, float] = field(default_factory=lambda: {"law": 0.5, "fine law": 0.12})
    turning: float = 0.4
    states: Mapping[str, float] = field(default_factory=lambda: {"step": 0.01, "narrow": 0.06, "wide": 0.3})
    slow: Mapping[str, float] = field(default_factory=lambda: {"quick": 0.05, "slow": 0.25, "lasting": 1.5})
    begun: float = 0.01
    waning: float = 0.5
    band: float = 0.005
    clock: float = 0.3
    jump: float = 0.01
    farther: float = 1.6
    edge: int = 3
    moments: int = 40
    followed: int = 10

    @property
    def jumps(self) -> tuple[float, ...]:
        """By which shares of a recording's duration a clock is asked whether it jumped, on and back."""
        count = 1 + int(np.log(self.clock / self.jump) / np.log(self.farther))
        return tuple(x * self.jump * self.farther**k for k in range(count) for x in (1, -1))


USUAL = Smoothness()

"""Which steps of a descent are taken, how the next is damped, and when it is at its end."""

import abc
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from tissuejax.estimation.ending import Ending

CREEP = 40  # evaluations after which a start that lags behind another is watched
ROUNDED = 1e-26  # a misfit of this much a sample is rounding
UNSEEN = 1e-9  # share of the largest singular value below which a direction promises nothing
HOPELESS = 2e-3  # of what exceeds noise: a fit that leaves much is not polished
FREE = 1e-4  # damping below which a step of a true Jacobian that gains nothing is the end


@dataclass(frozen=True)
class Damping:
    """How much steps are held back, in shares of each coordinate's own curvature (Marquardt).

    Attributes:
        first: at the start.
        taken: share of its promise that a step has to gain.
        trusted: share above which the next step is held back less, by `falls` but not below `least`; else `doubted`
            multiplies. None: any step that was taken.
        rises, from_rise: factor after a step that was not taken, and the least that it then is.
        of_start: whether curvatures are those of the start throughout.
    """

    first: float
    taken: float
    trusted: float | None
    falls: float
    least: float
    doubted: float
    rises: float
    from_rise: float
    of_start: bool = False

    def takes(self, drop: float, promised: float) -> bool:
        """Whether a step is taken that lowers the cost by `drop`."""
        return drop > self.taken * promised

    def after(self, held: float, drop: float, promised: float) -> float:
        """The damping after a step that was taken."""
        if self.trusted is None or drop > self.trusted * promised:
            return max(held / self.falls, self.least)
        return held * self.doubted

    def raised(self, held: float) -> float:
        """The damping after one that was not."""
        return max(held * self.rises, self.from_rise)


def sizes(jacobian: Float[np.ndarray, "n p"], scale: Float[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
    """Length of every column; of one that vanishes a little, so that its coordinate stays."""
    size = np.linalg.norm(jacobian, axis=0)
    return np.maximum(size, 1e-9 * np.max(size, initial=0.0) + 1e-6 / scale)


@dataclass(frozen=True)
class Proposal:
    """A step that may be tried.

    Attributes:
        cost: half the sum of squares where it starts; promised: by how much a straight line lowers it.
        errors: its length in standard errors, those that the misfit speaks for.
        length: its longest coordinate over the coordinate's size.
        whole: whether it is all but the Gauss-Newton step.
        lacking: whether the Jacobian may lack columns.
        runs: residuals computed so far.
    """

    cost: float
    promised: float
    errors: float
    length: float
    whole: bool
    lacking: bool
    runs: int


class Rule(abc.ABC):
    """When a descent ends.

    Attributes:
        shortest: a step that was not taken and was shorter than this (`Proposal.length`) ends the descent, and so does
            the last of all tries from one point, as `stuck` says.
    """

    shortest: ClassVar[float]
    stuck: ClassVar[Ending]

    @abc.abstractmethod
    def here(
        self, cost: float, r: Float[np.ndarray, " n"], jacobian: Float[np.ndarray, "n p"], size: Float[np.ndarray, " p"]
    ) -> Ending | None:
        """The end at a point, before any step from it; `size` of the Jacobian's columns."""

    @abc.abstractmethod
    def before(self, step: Proposal, trace: Sequence[tuple[float, np.ndarray]]) -> Ending | None:
        """The end before a step is tried."""

    @abc.abstractmethod
    def little(self, drop: float, cost: float, n: int, step: Proposal) -> bool:
        """Whether a step of n residuals that lowered the cost by `drop` to `cost` gained too little to go on for."""

    @abc.abstractmethod
    def after(self, quiet: int, drop: float, held: float) -> Ending | None:
        """The end after `quiet` such steps in a row, the last under the damping `held`."""


@dataclass(frozen=True)
class Precise(Rule):
    """To the last digits: the Gauss-Newton step promises less than a share of the misfit, or three steps gained that.

    Attributes:
        tolerance: that share.
        runs: residuals computed at most.
        to_beat: cost that another start reached; a descent that creeps well above it is given up.
    """

    shortest: ClassVar[float] = 1e-14
    stuck: ClassVar[Ending] = Ending.CONVERGED  # steps have shrunk below rounding: nothing nearby is better
    tolerance: float
    runs: int
    to_beat: float = np.inf

    def here(self, cost, r, jacobian, size):
        """See `Rule.here`."""
        upper = np.asarray(np.linalg.qr(np.column_stack([jacobian / size, r]), mode="r"))
        u, s, _ = np.linalg.svd(upper[:, :-1], full_matrices=False)
        seen = s > UNSEEN * (s[0] if len(s) and s[0] > 0 else 1.0)
        promised = 0.5 * float(np.sum((u[:, seen].T @ upper[:, -1]) ** 2))
        return Ending.CONVERGED if promised <= self.tolerance * cost or cost < ROUNDED * len(r) else None

    def before(self, step, trace):
        """See `Rule.before`."""
        n = step.runs
        if n >= CREEP and n % 10 == 0 and step.cost > 1.01 * self.to_beat:
            earlier = trace[-CREEP // 2][0] if len(trace) > CREEP // 2 else np.inf
            if step.cost > 0.9 * earlier or len(trace) < CREEP // 3:
                return Ending.BEHIND
        return Ending.SPENT if n >= self.runs else None

    def little(self, drop, cost, n, step):
        """See `Rule.little`."""
        return drop <= self.tolerance * cost

    def after(self, quiet, drop, held):
        """See `Rule.after`."""
        return Ending.CONVERGED if quiet >= 3 else None


@dataclass(frozen=True)
class InErrors(Rule):
    """In standard errors: the last digits of a simulation are numerical noise and not worth a run each.

    Attributes:
        fraction: the end once the next step is shorter than this many.
        last: after a step shorter than this a further one would be shorter by far.
    """

    shortest: ClassVar[float] = 0.0
    stuck: ClassVar[Ending] = Ending.NOTHING_BETTER
    fraction: float
    last: float

    def here(self, cost, r, jacobian, size):
        """Never: a point is judged by the step from it."""
        return

    def before(self, step, trace):
        """See `Rule.before`."""
        short = step.whole and (step.errors < self.fraction or step.promised < 1e-9 * step.cost)
        return Ending.CONVERGED if short else None

    def little(self, drop, cost, n, step):
        """See `Rule.little`."""
        return step.whole and step.errors < self.last and self.fraction >= 0.1

    def after(self, quiet, drop, held):
        """See `Rule.after`."""
        return Ending.CONVERGED


@dataclass(frozen=True)
class InChiSquare(Rule):
    """In chi-square: two steps in a row lower it by less than is worth telling sets apart by.

    Attributes:
        tolerance: that much, or `HOPELESS` of what exceeds noise.
        costly: whether no prediction is made for a step that promises less.
    """

    shortest: ClassVar[float] = 1e-9
    stuck: ClassVar[Ending] = Ending.CONVERGED
    tolerance: float
    costly: bool = False

    def here(self, cost, r, jacobian, size):
        """Never: a point is judged by the step from it."""
        return

    def before(self, step, trace):
        """See `Rule.before`."""
        idle = self.costly and 2 * step.promised < self.tolerance and not step.lacking
        return Ending.CONVERGED if idle else None

    def little(self, drop, cost, n, step):
        """See `Rule.little`."""
        return 2 * drop < max(self.tolerance, HOPELESS * (2 * cost - n))

    def after(self, quiet, drop, held):
        """See `Rule.after`."""
        end = quiet >= 2 or 2 * drop < 1e-3 * self.tolerance or held < FREE
        return Ending.CONVERGED if end else None

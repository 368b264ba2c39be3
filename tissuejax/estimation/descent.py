"""Levenberg-Marquardt, once, made of named parts.

Half the sum of squares of residuals r(y) is made small by damped linear steps. What tells one descent from another is
five parts, and a method is a choice of them:

| method (`methods`) | derivatives | reach of a step | damped by | a step is taken from | end |
|---|---|---|---|---|---|
| `trust_region` | at every trial | anywhere | curvature at first | 1e-3 of its promise | `Precise` |
| `marquardt` | where accepted | one unit a coordinate | curvature | 1e-3 of its promise | `InErrors` |
| `broyden` | corrected on the way | bounds, angles | curvature | any gain | `InChiSquare` |

The first serves fits of material tests, the second fits of probings, the third refits of a diagnosis. Three ways of
making a misfit small are no descents of this kind and stay beside it: variable projection wraps `trust_region` and
solves for the moduli at every trial (`fitting.separable`); the chord steps at the end of a probing's fit keep one
Jacobian while the simulation changes (`fitting.closing`); Adam and L-BFGS know first derivatives only
(`fitting.gradient_descent`).

Sources: Levenberg 1944, Q. Appl. Math. 2:164; Marquardt 1963, J. SIAM 11:431; steps in a box by active sets, Stark and
Parker 1995, Comput. Stat. 10:129.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from tissuejax.errors import UnstableSimulation
from tissuejax.estimation.derivatives import KEPT, Derivatives
from tissuejax.estimation.ending import Ending
from tissuejax.estimation.posed import LeastSquares, half_square
from tissuejax.estimation.reach import Reach
from tissuejax.estimation.rules import Damping, Proposal, Rule, sizes

OnAccept = Callable[[int, float, Float[np.ndarray, " p"]], None]


@dataclass(frozen=True)
class Method:
    """A descent's parts.

    Attributes:
        derivatives: where the Jacobian comes from.
        reach: how far a step may go.
        damping: how much steps are held back, and which are taken.
        rule: when it ends.
        points: places from which steps are made, at most.
        tries: steps from one of them, at most.
    """

    derivatives: Callable[[LeastSquares], Derivatives]
    reach: Reach
    damping: Damping
    rule: Rule
    points: int
    tries: int


@dataclass(frozen=True)
class Ended:
    """How a descent went.

    Attributes:
        y: where it ended.
        cost: half the sum of squares there; infinite where nothing could be predicted.
        ending: why.
        residuals, jacobian: the last ones known, which nobody should have to compute again.
        runs, jacobians: how many were computed.
        trace: (cost, y) of every accepted point.
    """

    y: Float[np.ndarray, " p"]
    cost: float
    ending: Ending
    residuals: Float[np.ndarray, " n"]
    jacobian: Float[np.ndarray, "n p"]
    runs: int
    jacobians: int
    trace: list[tuple[float, np.ndarray]] = field(default_factory=list)

    @property
    def converged(self) -> bool:
        """Whether it ended where the data ask for an end."""
        return self.ending is Ending.CONVERGED

    @property
    def reason(self) -> str:
        """The ending as a sentence."""
        return f"{self.ending} after {self.runs} evaluations" if self.ending is Ending.SPENT else str(self.ending)


def descend(
    problem: LeastSquares, y: Float[np.ndarray, " p"], method: Method, on_accept: OnAccept | None = None
) -> Ended:
    """Make the residuals of `problem` small from `y`.

    Args:
        on_accept: called with residuals computed so far, cost and point of every accepted point, the start included.

    Raises:
        UnstableSimulation: the start itself can't be simulated.
    """
    reach, damping, rule, source = method.reach, method.damping, method.rule, method.derivatives(problem)
    y = np.asarray(y, float)
    r = problem.residuals(y)
    cost, runs, quiet, held, trace = half_square(r), 1, 0, damping.first, []
    jacobian, size = np.full((len(r), len(y)), np.nan), None

    def ended(why: Ending) -> Ended:
        return Ended(y, cost, why, r, jacobian, runs, source.count, trace)

    def arrived() -> None:
        if not trace or trace[-1][1] is not y:
            trace.append((cost, y))
            if on_accept is not None:
                on_accept(runs, cost, y)

    if not np.isfinite(cost):
        return ended(Ending.NO_PREDICTION)
    for _ in range(method.points):
        arrived()
        jacobian, seen = source.at(y, reach.scale)
        if not np.isfinite(jacobian).all():
            return ended(Ending.NO_DERIVATIVE)
        size = sizes(jacobian, reach.scale) if size is None or not damping.of_start else size
        if why := rule.here(cost, r, jacobian, size):
            return ended(why)
        q, triangle = np.linalg.qr(seen)
        aim, taken, found = -(q.T @ r), False, r
        for attempt in range(method.tries):
            trial = reach.trial(triangle, aim, np.sqrt(held) * size, y, attempt)
            step = trial - y
            foretold = r + jacobian @ step
            proposed = _proposal(y, step, r, cost, foretold, held, reach, source.lacking, runs)
            if why := rule.before(proposed, trace):
                break
            found, runs = _residuals(problem, trial), runs + 1
            drop = cost - half_square(found)
            taken = damping.takes(drop, proposed.promised)
            if taken or source.corrected:
                break
            held = damping.raised(held)
            if proposed.length < rule.shortest:
                return ended(rule.stuck)
        if not taken and (why or not source.corrected):
            if source.renewed(attempt):
                continue
            return ended(why or rule.stuck)
        if not taken:  # a corrected Jacobian failed: take a true one
            source.forget()
            continue
        exact = source.exact
        source.moved(step, found - foretold, drop > KEPT * proposed.promised)
        held = damping.after(held, drop, proposed.promised)
        y, r, cost = trial, found, half_square(found)
        little = rule.little(drop, cost, len(r), proposed)
        if little and not exact:  # a Jacobian of somewhere else tells of no end
            source.forget()
            continue
        quiet = quiet + 1 if little else 0
        if little and (why := rule.after(quiet, drop, held)):
            arrived()
            return ended(why)
    return ended(Ending.SPENT)


def _proposal(y, step, r, cost, foretold, held, reach: Reach, lacking: bool, runs: int) -> Proposal:
    variance = max(2 * cost / max(len(r) - len(y), 1), 1e-300)
    return Proposal(
        cost=cost,
        promised=cost - half_square(foretold),
        errors=float(np.linalg.norm(foretold - r)) / variance**0.5,
        length=float(np.max(np.abs(step) / np.maximum(reach.scale, np.abs(y)), initial=0.0)),
        whole=held <= 1e-3 and bool((np.abs(step) < 0.99 * reach.longest).all()),
        lacking=lacking,
        runs=runs,
    )


def _residuals(problem: LeastSquares, y: Float[np.ndarray, " p"]) -> Float[np.ndarray, " n"]:
    """Infinite ones where a simulation breaks down: such a step is not taken."""
    try:
        return problem.residuals(y)
    except UnstableSimulation:
        return np.full(1, np.inf)

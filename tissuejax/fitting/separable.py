"""Variable projection: where stress is linear in the moduli they are solved for, and only the rest is searched.

At every trial of the other parameters (exponents, limits, shares, times) the moduli follow from one linear
least-squares problem, bounds kept, so the search runs in fewer dimensions and past the long curved valleys in which a
modulus trades off against an exponent. The Jacobian of the projected residual is Kaufman's, (1 - P) J, P projecting
on the columns of the moduli: the full Jacobian at the solved moduli less what they can absorb. Source: Golub &
Pereyra 1973; Kaufman 1975, BIT 15. Linearity is not assumed but checked at every trial; where it fails,
`NotSeparable` hands over to the full search.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.optimize import lsq_linear

from tissuejax.estimation.descent import Ended, OnAccept, descend
from tissuejax.estimation.ending import Ending
from tissuejax.estimation.methods import trust_region
from tissuejax.estimation.posed import LeastSquares, half_square
from tissuejax.estimation.problem import Problem
from tissuejax.estimation.transforms import Box, chained

LINEAR = 1e-6  # how far, as a share of its norm, the residual may differ from the linear forecast
CUTOFF = 1e-12  # singular values below this share are not solved for


class NotSeparable(Exception):
    """The prediction is not linear in the moduli after all."""


def separable(problem: Problem) -> bool:
    """Whether projection is worth trying: plain squares, free moduli without priors, no stability rows."""
    return (
        problem.loss == "squares"
        and not problem.stiffness
        and bool(problem.moduli)
        and not any(path in problem.priors for path in problem.moduli)
    )


class Projection(LeastSquares):
    """Residual and Jacobian in the remaining parameters, the moduli solved for at each trial."""

    def __init__(self, problem: Problem, x: Float[np.ndarray, " p"]):
        self.problem = problem
        self.linear = np.array([path in problem.moduli for path in problem.free])
        self.x, self.best, self.n = x.copy(), np.inf, 0
        rest = [path for path in problem.free if path not in problem.moduli]
        ends = [problem.bound(path) for path in rest]
        scale = [problem.scale(path) for path in rest]
        self.box = Box([a for a, _ in ends], [b for _, b in ends], scale, sticks=problem.sticks(rest))
        self.low = np.array([problem.bound(path)[0] for path in problem.moduli])
        self.high = np.array([problem.bound(path)[1] for path in problem.moduli])
        self.points: dict[bytes, np.ndarray] = {}
        self.full, self.slope = np.zeros((0, len(x))), np.ones(0)  # at the best point: the whole Jacobian, and dx/dy

    def residuals(self, y: Float[np.ndarray, " q"]) -> Float[np.ndarray, " n"]:
        """Projected residual at y; as the straight line foretells it where the trial is worse than the best."""
        x, slope = self.x.copy(), np.ones(0)
        if len(y):
            x[~self.linear], slope = self.box.bounded(y)
        r, jacobian = self._linearised(x)
        if not _finite(r, jacobian):
            return np.full_like(r, np.inf)
        moduli, forecast, _ = self.solve(r, jacobian[:, self.linear], x[self.linear])
        x[self.linear] = moduli
        self.points[y.tobytes()] = x
        if forecast @ forecast > self.best:
            return forecast
        r, jacobian = self._linearised(x)
        if not _finite(r, jacobian):
            if not np.isfinite(self.best):  # a matrix of no stiffness may have no equilibrium beside its fibres
                raise NotSeparable
            return np.full_like(r, np.inf)
        if np.linalg.norm(r - forecast) > LINEAR * (np.linalg.norm(forecast) + 1e-3 * np.sqrt(len(r))):
            raise NotSeparable
        self.x, self.best, self.full, self.slope = x, float(r @ r), jacobian, slope
        return r

    def jacobian(self, y: Float[np.ndarray, " q"]) -> Float[np.ndarray, "n q"]:
        """Kaufman's, at the best point so far, which is where a descent asks for it."""
        return chained(self._projected(self.full, self.points[y.tobytes()]), self.slope)

    def solve(self, r, columns, now) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Moduli within bounds, the residual they give, and which are free of their bounds."""
        size = np.linalg.norm(columns, axis=0)
        size = np.where(size > 0, size, 1.0)
        target = columns @ now - r
        solved = np.linalg.lstsq(columns / size, target, rcond=CUTOFF)[0] / size
        inside = (solved >= self.low) & (solved <= self.high)
        if not inside.all():
            answer = lsq_linear(columns / size, target, (self.low * size, self.high * size), method="bvls")
            # where a bound holds it is that very number, which low * size / size need not be
            solved = np.where(answer.active_mask < 0, self.low, np.clip(answer.x / size, self.low, self.high))
            solved = np.where(answer.active_mask > 0, self.high, solved)
            inside = (solved > self.low) & (solved < self.high)
        return solved, r + columns @ (solved - now), inside

    def _projected(self, jacobian, x) -> np.ndarray:
        inside = (x[self.linear] > self.low) & (x[self.linear] < self.high)
        columns, rest = jacobian[:, self.linear][:, inside], jacobian[:, ~self.linear]
        size = np.linalg.norm(columns, axis=0)
        columns = columns[:, size > 0] / size[size > 0]
        if not columns.shape[1]:
            return rest
        u, s, _ = np.linalg.svd(columns, full_matrices=False)
        u = u[:, s > CUTOFF * s[0]]
        return rest - u @ (u.T @ rest)

    def _linearised(self, x):
        self.n += 1
        return self.problem.linearised(self.problem.values(x))


def projected_descent(
    problem: Problem,
    x: Float[np.ndarray, " p"],
    *,
    max_steps: int,
    tolerance: float,
    on_accept: OnAccept | None,
    to_beat: float,
) -> Ended:
    """Minimise from the free parameters `x` (not transformed); `Ended.y` are free parameters too.

    Raises:
        NotSeparable: the prediction is not linear in the moduli.
    """
    projection = Projection(problem, x)
    y = projection.box.free(x[~projection.linear]) if not projection.linear.all() else np.zeros(0)
    if not len(y):
        r = projection.residuals(y)
        cost, good = half_square(r), bool(np.isfinite(r).all())
        end, why = (projection.x, Ending.CONVERGED) if good else (x, Ending.NO_PREDICTION)
        if good and on_accept is not None:
            on_accept(projection.n, cost, end)
        return Ended(end, cost, why, r, np.zeros((len(r), 0)), projection.n, 0, [(cost, end)] if good else [])

    def accepted(_, cost, y):
        on_accept(projection.n, cost, projection.points[y.tobytes()])

    method = trust_region(len(y), max(1, max_steps // 2), tolerance, to_beat)
    found = descend(projection, y, method, accepted if on_accept is not None else None)
    if not found.trace:
        return replace(found, y=x, runs=projection.n)
    trace = [(cost, projection.points[y.tobytes()]) for cost, y in found.trace]
    return replace(found, y=projection.x, runs=projection.n, trace=trace)


def _finite(r: np.ndarray, jacobian: np.ndarray) -> bool:
    return bool(np.isfinite(half_square(r)) and np.isfinite(jacobian).all())

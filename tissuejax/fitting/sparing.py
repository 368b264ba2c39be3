"""Levenberg-Marquardt for predictions that cost a simulation: derivatives only where a step was accepted.

A trial point costs a forward run, a Jacobian (five times as much) follows only once the point is better; the end is
judged in standard errors, because the last digits of a simulation are numerical noise and not worth a run each.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.optimize import lsq_linear

from tissuejax.errors import UnstableSimulation
from tissuejax.fitting.levenberg_marquardt import Descent

Residuals = Callable[[Float[np.ndarray, " p"]], Float[np.ndarray, " n"]]
Jacobian = Callable[[Float[np.ndarray, " p"]], Float[np.ndarray, "n p"]]


class Ended(NamedTuple):
    """How a descent went, with the last residuals and Jacobian, which nobody should have to simulate again."""

    descent: Descent
    residuals: Float[np.ndarray, " n"]
    jacobian: Float[np.ndarray, "n p"]


def sparing(
    jacobian: Jacobian,
    residuals: Residuals,
    y: Float[np.ndarray, " p"],
    *,
    max_steps: int = 20,
    fraction: float = 0.1,
    longest: float = 1.0,
    last: float = 0.5,
    on_accept: Callable[[int, float, np.ndarray], None] | None = None,
) -> Ended:
    """Minimise half the sum of squares of the residuals from `y`.

    Args:
        jacobian: derivative of the residuals at y; a cheaper simulation's derivative serves as well.
        residuals: residuals at y; non-finite ones or an `UnstableSimulation` are a rejected step.
        y: start, in coordinates of order one (logarithms or scaled parameters).
        max_steps: Jacobians at most.
        fraction: converged once the next step is shorter than this many standard errors (scaled by the misfit).
        longest: no coordinate moves farther in a step.
        last: standard errors; after an accepted step shorter than this a further one would be shorter by far.
        on_accept: called with the number of runs, cost and point of every accepted step (progress, checkpoint).

    Raises:
        UnstableSimulation: the start itself can't be simulated.
    """
    y = np.asarray(y, float)
    r, n, damping, reason, trace = residuals(y), 1, 1e-4, "", []
    J = np.full((len(r), len(y)), np.nan)
    cost = 0.5 * float(r @ r)

    def ended(reason):
        return Ended(Descent(y, cost, reason == "converged", reason, n, trace), r, J)

    if not np.isfinite(r).all():
        return ended("the simulation has no finite prediction at the start")
    for _ in range(max_steps):
        trace.append((cost, y))
        if on_accept is not None:
            on_accept(n, cost, y)
        J = jacobian(y)
        n += 1
        if not np.isfinite(J).all():
            return ended("the simulation has no finite derivative here")
        gradient, normal = J.T @ r, J.T @ J
        size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        variance = max(2 * cost / max(len(r) - len(y), 1), 1e-300)
        accepted = False
        for _ in range(8):
            step, whole = _step(J, r, size, damping, longest)
            errors = np.sqrt(step @ normal @ step / variance)
            promised = -(gradient @ step + 0.5 * step @ normal @ step)
            if whole and (errors < fraction or promised < 1e-9 * cost):
                return ended("converged")
            new = _trial(residuals, y + step)
            n += 1
            after = 0.5 * float(new @ new) if new is not None else np.inf
            if cost - after > 1e-3 * promised:
                damping = max(damping / 10, 1e-8) if cost - after > 0.5 * promised else damping * 2
                y, r, cost, accepted = y + step, new, after, True
                break
            damping = max(10 * damping, 1e-3)
        if not accepted:
            reason = "no nearby point is better, though the derivatives promise one"
            break
        if whole and errors < last and fraction >= 0.1:
            trace.append((cost, y))
            if on_accept is not None:
                on_accept(n, cost, y)
            return ended("converged")
    return ended(reason or f"no convergence after {n} runs")


def _step(J, r, size, damping: float, longest: float):
    """Damped step in the box |step_i| <= longest, and whether it is all but the Gauss-Newton step.

    Damping is relative to the curvature of each coordinate (Marquardt). In a box, unlike a ball, one coordinate that
    wants to go far does not hold up the others.
    """
    upper = np.linalg.qr(np.column_stack([J, r]), mode="r")  # p + 1 rows with the same normal equations
    rows = np.vstack([upper[:, :-1], np.sqrt(damping) * np.diag(size)])
    target = -np.concatenate([upper[:, -1], np.zeros(len(size))])
    step = lsq_linear(rows, target, (-longest, longest)).x
    return step, damping <= 1e-3 and bool((np.abs(step) < 0.99 * longest).all())


def _trial(residuals: Residuals, y: Float[np.ndarray, " p"]) -> Float[np.ndarray, " n"] | None:
    try:
        r = residuals(y)
    except UnstableSimulation:
        return None
    return r if np.isfinite(r).all() else None

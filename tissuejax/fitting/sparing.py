"""Levenberg-Marquardt for predictions that cost a simulation: derivatives only where a step was accepted.

A trial point costs a forward run, a Jacobian (five times as much) follows only once the point is better; the end is
judged in standard errors, because the last digits of a simulation are numerical noise and not worth a run each.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from tissuejax.errors import UnstableSimulation
from tissuejax.fitting.levenberg_marquardt import Descent, Linearised

Residuals = Callable[[Float[np.ndarray, " p"]], Float[np.ndarray, " n"]]


def sparing(
    linearised: Linearised,
    residuals: Residuals,
    y: Float[np.ndarray, " p"],
    *,
    max_steps: int = 20,
    fraction: float = 0.1,
    longest: float = 1.0,
    on_accept: Callable[[int, float, np.ndarray], None] | None = None,
) -> Descent:
    """Minimise half the sum of squares of the residuals from `y`.

    Args:
        linearised: residuals and Jacobian at y.
        residuals: residuals alone; non-finite ones or an `UnstableSimulation` are a rejected step.
        y: start, in coordinates of order one (logarithms or scaled parameters).
        max_steps: Jacobians at most.
        fraction: converged once the next step is shorter than this many standard errors (scaled by the misfit).
        longest: steps are shortened so that no coordinate moves farther.
        on_accept: called with the number of evaluations, cost and point of every accepted step (progress, checkpoint).
    """
    y = np.asarray(y, float)
    damping, n, trace, reason = 1e-4, 0, [], ""

    def trial(at):
        try:
            r = residuals(at)
        except UnstableSimulation:
            return np.inf
        return 0.5 * float(r @ r) if np.isfinite(r).all() else np.inf

    cost = np.inf
    for _ in range(max_steps):
        r, J = linearised(y)
        n += 1
        if not (np.isfinite(r).all() and np.isfinite(J).all()):
            return Descent(y, cost, False, "the simulation has no finite prediction or derivative here", n, trace)
        cost = 0.5 * float(r @ r)
        trace.append((cost, y))
        if on_accept is not None:
            on_accept(n, cost, y)
        gradient, normal = J.T @ r, J.T @ J
        size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        variance = max(2 * cost / max(len(r) - len(y), 1), 1e-300)
        accepted = False
        for _ in range(8):
            # damping relative to the curvature of each coordinate: Marquardt's scaling
            step = -np.linalg.solve(normal + damping * np.diag(size**2), gradient)
            step *= min(1.0, longest / max(np.abs(step).max(), 1e-300))
            errors = np.sqrt(step @ normal @ step / variance)
            promised = -(gradient @ step + 0.5 * step @ normal @ step)
            if errors < fraction or promised < 1e-9 * cost:
                reason = "converged"
                break
            new = trial(y + step)
            n += 1
            if new < cost and cost - new > 1e-3 * promised:
                damping = max(damping / 10, 1e-8) if cost - new > 0.5 * promised else damping * 2
                y, accepted = y + step, True
                break
            damping = max(10 * damping, 1e-3)
        if reason:
            break
        if not accepted:
            reason = "no nearby point is better, though the derivatives promise one"
            break
    converged = reason == "converged"
    return Descent(trace[-1][1], trace[-1][0], converged, reason or f"no convergence after {n} runs", n, trace)

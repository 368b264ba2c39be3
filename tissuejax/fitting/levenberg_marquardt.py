"""Levenberg-Marquardt by optimistix, one evaluation of the model a step.

The model is evaluated outside (its own compiled forward mode, perhaps on several cores), giving residuals r and
Jacobian J at the point that the solver asked for. The solver itself only ever sees the affine function r + J (y -
y_eval), squeezed by a QR decomposition to p + 1 rows, which has the same norms, gradient and Gauss-Newton matrix. So
one compiled step serves every problem with the same number of parameters, whatever the model and however long the
recordings; a step costs about 0.2 ms beside the model, can be logged, shown and resumed.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Float

HUGE = 1e140  # residuals beyond are as good as infinite
CREEP = 40  # evaluations after which a start that lags behind another is watched
Linearised = Callable[[Float[np.ndarray, " p"]], tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n p"]]]
CONDITIONING = 100.0  # unit steps in scaled parameters: how much the first damping weighs against the data


@dataclass(frozen=True)
class Descent:
    """How a minimisation went.

    Attributes:
        y: where it ended.
        cost: half the sum of squares there.
        converged: whether it ended by its tolerance.
        reason: one phrase.
        n_evaluations: evaluations of residuals with derivatives.
        trace: (cost, y) of every accepted point.
    """

    y: Float[np.ndarray, " p"]
    cost: float
    converged: bool
    reason: str
    n_evaluations: int
    trace: list[tuple[float, np.ndarray]] = field(default_factory=list)


def _affine(y, args):
    y_eval, r, jacobian = args
    return r + jacobian @ (y - y_eval), None


@lru_cache(maxsize=64)
def _solver(p: int):
    """The compiled step for p parameters and its first state."""
    search = optx.ClassicalTrustRegion(high_cutoff=0.75, low_cutoff=1e-3, high_constant=6.0, low_constant=0.2)
    solver = eqx.tree_at(lambda s: s.search, optx.LevenbergMarquardt(rtol=1e-8, atol=1e-8), search)
    y, r = jnp.zeros(p), jnp.zeros(p + 1)
    args = (y, r, jnp.zeros((p + 1, p)))
    tags = frozenset()
    state = solver.init(_affine, y, args, {}, jax.eval_shape(lambda: r), None, tags)
    first, static = eqx.partition(state, eqx.is_array)

    @jax.jit
    def step(y, dynamic, y_eval, r, jacobian):
        state = eqx.tree_at(lambda s: s.y_eval, eqx.combine(dynamic, static), y_eval)
        y, state, _ = solver.step(_affine, y, (y_eval, r, jacobian), {}, state, tags)
        dynamic, _ = eqx.partition(state, eqx.is_array)
        return y, dynamic, state.y_eval

    return step, first


def squeezed(r: Float[np.ndarray, " n"], jacobian: Float[np.ndarray, "n p"]) -> tuple[np.ndarray, np.ndarray]:
    """Residual and Jacobian with p + 1 rows and the same J'J, J'r and r'r."""
    n, p = jacobian.shape
    rows = np.column_stack([jacobian, r])
    if n < p + 1:
        rows = np.vstack([rows, np.zeros((p + 1 - n, p + 1))])
    upper = np.linalg.qr(rows, mode="r")
    return upper[:, p], upper[:, :p]


def levenberg_marquardt(
    linearised: Linearised,
    y: Float[np.ndarray, " p"],
    *,
    max_steps: int = 200,
    tolerance: float = 1e-9,
    on_accept: Callable[[int, float, np.ndarray], None] | None = None,
    to_beat: float = np.inf,
) -> Descent:
    """Minimise half the sum of squares of the residuals from `y`.

    Args:
        linearised: residuals and Jacobian at y; a non-finite result is a rejected step.
        y: start.
        max_steps: evaluations at most.
        tolerance: stop once the Gauss-Newton model promises to lower the cost by less than this share.
        on_accept: called with the number of evaluations, cost and point of every accepted step (progress, checkpoint).
        to_beat: cost that another start reached; a search that creeps well above it is given up.
    """
    p, asked = len(y), np.asarray(y, float)
    step, state = _solver(p)
    r, jacobian = linearised(asked)
    if not (np.abs(r).max(initial=0) < HUGE and np.isfinite(jacobian).all()):
        return Descent(y, np.inf, False, "the model has no finite prediction at the start", 1)
    norms = np.linalg.norm(jacobian, axis=0)
    scale = np.maximum(norms, 1e-8 * (norms.max() or 1.0)) / CONDITIONING
    scale = np.where(scale > 0, scale, 1.0)
    z = z_eval = np.asarray(y * scale)
    cost, trace, n, reason, small = np.inf, [], 1, "", 0
    while True:
        trial = 0.5 * float(r @ r) if np.isfinite(jacobian).all() and np.abs(r).max(initial=0) < HUGE else np.inf
        if np.isfinite(trial):
            rs, js = squeezed(r, jacobian / scale)
        else:  # optimistix compares costs, so a huge one is a rejected step
            rs, js = np.full(p + 1, 1e150), np.zeros((p + 1, p))
        before = z
        z, state, z_next = step(z, state, z_eval, rs, js)
        z, z_next = np.asarray(z), np.asarray(z_next)
        if np.isfinite(trial) and (not trace or not np.array_equal(z, before)):
            drop = cost - trial
            small = small + 1 if drop <= tolerance * trial else 0
            cost, best = trial, asked
            trace.append((cost, best))
            gain = _promise(rs, js)
            if on_accept is not None:
                on_accept(n, cost, best)
            if gain <= tolerance * cost or cost < 1e-26 * len(r):
                reason = "converged"
        if small >= 3:
            reason = "converged"
        if not reason and np.linalg.norm(z_next - z) <= 1e-14 * (1 + np.linalg.norm(z)):
            reason = "converged"  # steps have shrunk below rounding: nothing nearby is better
        if not reason and n >= CREEP and n % 10 == 0 and cost > 1.01 * to_beat:
            before = trace[-CREEP // 2][0] if len(trace) > CREEP // 2 else np.inf
            if cost > 0.9 * before or len(trace) < CREEP // 3:
                reason = "given up: another start is better and this one creeps"
        if not reason and n >= max_steps:
            reason = f"no convergence after {n} evaluations"
        if reason:
            return Descent(best, cost, reason == "converged", reason, n, trace)
        z_eval = z_next
        asked = z_eval / scale
        r, jacobian = linearised(asked)
        n += 1


def _promise(r: np.ndarray, jacobian: np.ndarray) -> float:
    """Half the decrease of the sum of squares that a full Gauss-Newton step promises, ignoring directions unseen."""
    u, s, _ = np.linalg.svd(jacobian, full_matrices=False)
    seen = s > 1e-9 * (s[0] if len(s) and s[0] > 0 else 1.0)
    return 0.5 * float(np.sum((u[:, seen].T @ r) ** 2))

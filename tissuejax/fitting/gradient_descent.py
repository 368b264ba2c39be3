"""Descent by first derivatives, for problems with many parameters: Adam and L-BFGS of optax on the same misfit.

Reverse mode gives the gradient at the cost of a few predictions whatever the number of parameters. Variables, bounds,
priors and losses are those of the least squares (scaled so that one unit is a typical change).
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Float

from tissuejax.estimation.descent import Ended, OnAccept
from tissuejax.estimation.ending import Ending
from tissuejax.estimation.problem import Problem
from tissuejax.estimation.transforms import FAR

GRADIENT_METHODS = ("adam", "lbfgs")
RATE = 0.05  # of Adam, in scaled variables, falling to a hundredth by a cosine
QUIET = 20  # steps without the asked decrease before L-BFGS is called converged


def objective(problem: Problem) -> Callable[[Float[jax.Array, " p"]], Float[jax.Array, ""]]:
    """Half the sum of the losses as a JAX function of the free variables y."""
    box = problem.box
    keys = list(problem.seen)
    kept = [jnp.asarray(problem.seen[k]) for k in keys]
    measured = [jnp.asarray(problem.series.y[problem.rows[k]]) for k in keys]
    fixed = {path: jnp.asarray(float(v)) for path, v in problem.start.items()}

    def bounded(y):
        x = jnp.where(box.wide, box.small * jnp.sinh(jnp.clip(y, -FAR, FAR)), box.scale * y)
        x = jnp.where(box.only_lower, jnp.where(box.only_lower, box.lower, 0) + box.scale * jax.nn.softplus(y), x)
        x = jnp.where(box.only_upper, jnp.where(box.only_upper, box.upper, 0) - box.scale * jax.nn.softplus(-y), x)
        low = jnp.where(box.both, box.lower, 0)
        x = jnp.where(box.both, low + box.span * jax.nn.sigmoid(y), x)
        for group in box.sticks:
            left = group.whole
            for i in group.members:
                fraction = x[i]
                x = x.at[i].set(fraction * left)
                left = left * (1 - fraction)
        return x

    def loss(y):
        x = bounded(y)
        values = fixed | {path: x[i] for i, path in enumerate(problem.free)}
        predicted = problem.predictor.predict(values)
        total = 0.0
        for (recording, channel), rows, seen in zip(keys, kept, measured, strict=True):
            r = (predicted[recording].channels[channel].values.ravel()[rows] - seen) / problem.sigma(
                (recording, channel)
            )
            total += jnp.sum(_rho(problem.loss, r * r))
        for path, (mean, std) in problem.priors.items():
            total += _rho(problem.loss, ((values[path] - mean) / std) ** 2)
        return 0.5 * total

    return loss


def _rho(name: str, square):
    if name == "soft-l1":
        return 2 * (jnp.sqrt(1 + square) - 1)
    return jnp.log1p(square) if name == "cauchy" else square


def gradient_descent(
    problem: Problem,
    y: Float[np.ndarray, " p"],
    method: str,
    *,
    max_steps: int,
    tolerance: float,
    on_accept: OnAccept | None = None,
) -> Ended:
    """Minimise by "adam" (ten times `max_steps` steps) or "lbfgs" from the free variables `y`."""
    loss = objective(problem)
    steps = 10 * max_steps if method == "adam" else max_steps
    if method == "adam":
        optimiser = optax.adam(optax.cosine_decay_schedule(RATE, steps, alpha=0.01))
    else:
        optimiser = optax.lbfgs(memory_size=20)
    gradient = jax.value_and_grad(loss)
    known = optax.value_and_grad_from_state(loss)

    @jax.jit
    def step(y, state):
        if method == "adam":
            value, slope = gradient(y)
            updates, state = optimiser.update(slope, state, y)
        else:
            value, slope = known(y, state=state)
            updates, state = optimiser.update(slope, state, y, value=value, grad=slope, value_fn=loss)
        return optax.apply_updates(y, updates), state, value

    def ended(why: Ending, n: int) -> Ended:
        cost, at = best
        return Ended(at, cost, why, np.zeros(0), np.zeros((0, len(at))), n, 0, trace)

    y = jnp.asarray(y)
    state, best, trace, waited = optimiser.init(y), (np.inf, np.asarray(y)), [], 0
    for n in range(1, steps + 1):
        here = np.asarray(y)
        y, state, value = step(y, state)
        value = float(value)
        if not np.isfinite(value):
            return ended(Ending.NO_PREDICTION if n == 1 else Ending.BROKEN, n)
        enough = value < best[0] * (1 - tolerance)
        waited = 0 if enough else waited + 1
        if value < best[0]:
            best = (value, here)
            trace.append((value, here))
            if on_accept is not None:
                on_accept(n, value, here)
        if waited >= QUIET and (method == "lbfgs" or n > steps // 2):
            return ended(Ending.CONVERGED, n)
    # Adam's schedule has come to rest
    return ended(Ending.CONVERGED if method == "adam" else Ending.SPENT, steps)

"""The end of a probing's fit: from the swift simulation that led there to the fine one that counts.

A descent by swift runs ends where their own error puts it. The way from there is short, and their Jacobian is good
enough for it: a chord step with the residuals of the finer mesh at life's pace. What these will be is foretold from the
pace and the mesh changed one at a time, runs that the numerical error needs anyway, so that as a rule one run on the
finer mesh is enough. Everything that is wanted at one place is simulated in one go, on all cores.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from tissuejax.estimation.numerical import Changes
from tissuejax.estimation.problem import Problem
from tissuejax.fitting.simulated import Simulated

ROUNDS = 6  # chord steps at most
NEAR = 1.0  # standard errors: a chord step shorter than this is not worth a run
BELOW = 0.1  # nor is one shorter than this share of what mesh, step and penalty leave open
Derive = Callable[[Float[np.ndarray, " p"]], Float[np.ndarray, "n p"]]


class Closing(NamedTuple):
    """Where a fit ended, in the simulation that counts.

    Attributes:
        problem: with that simulation.
        x: free parameters.
        residuals: there.
        left: how far a further step would go, standard errors.
    """

    problem: Problem
    x: Float[np.ndarray, " p"]
    residuals: Float[np.ndarray, " n"]
    left: float


def close(
    problem: Problem,
    x: Float[np.ndarray, " p"],
    jacobian: Float[np.ndarray, "n p"],
    seen: Changes,
    simulated: Simulated,
    finer: bool,
    holdout: tuple[str, ...] = (),
    derive: Derive | None = None,
    on_accept: Callable[[Float[np.ndarray, " p"], float], None] | None = None,
) -> Closing:
    """Chord steps until a further one would be shorter than a standard error, or than a tenth of the numerical one.

    Where a step leaves more than a third of the way before it, the derivatives were those of too swift a simulation:
    they are taken again.

    Args:
        problem: with the settings of the descent's end.
        x: its end.
        jacobian: of the residuals to the free parameters, there or nearby, by any swift simulation.
        seen: the residuals there (`changes`).
        simulated: keeps the predictions.
        finer: end on the finer mesh.
        holdout: recordings to predict in the same go, for later.
        derive: the Jacobian at other parameters by a simulation nearer to the one that counts.
        on_accept: called with parameters and cost after every chord step that is the best so far.
    """
    settings = problem.predictor.settings
    final = problem if not finer else replace(problem, predictor=problem.predictor.with_settings(settings.finer))
    companions = [final.predictor.of(holdout)] if holdout else []
    lower, upper = (np.array(v) for v in zip(*(problem.bound(path) for path in problem.free), strict=True))
    at = Closing(final, x, seen.final, reach(jacobian, seen.final))
    best = None if finer else at
    unsure = np.linalg.norm([reach(jacobian, change, seen.final) for change in seen.left.values()])
    near = max(NEAR, BELOW * unsure)
    for _ in range(ROUNDS):
        if best is not None and at.left < near:
            break
        before = at
        step = np.linalg.lstsq(jacobian, at.residuals, rcond=None)[0]
        trial = np.clip(at.x - step, lower, upper)
        values = final.values(trial)
        r = final.misfit(simulated.all([final.predictor, *companions], values)[0], values)
        at = Closing(final, trial, r, reach(jacobian, r))
        worse = best is not None and r @ r >= best.residuals @ best.residuals
        best = best if worse else at
        if on_accept is not None and not worse:
            on_accept(at.x, 0.5 * float(r @ r))
        if at.left > max(near, before.left / 3) or worse:
            if derive is None:
                break
            jacobian = derive(best.x)
            at = best = best._replace(left=reach(jacobian, best.residuals))
    return best


def reach(
    jacobian: Float[np.ndarray, "n p"],
    residuals: Float[np.ndarray, " n"],
    misfit: Float[np.ndarray, " n"] | None = None,
) -> float:
    """Length of the Gauss-Newton step of some residuals in standard errors, those that the misfit (the residuals
    themselves where none is given) speaks for."""
    misfit = residuals if misfit is None else misfit
    promised = np.linalg.qr(jacobian)[0].T @ residuals
    n, p = jacobian.shape
    return float(np.sqrt(promised @ promised / max(misfit @ misfit / max(n - p, 1), 1e-300)))

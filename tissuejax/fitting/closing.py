"""The end of a probing's fit: from the swift simulation that led there to the fine one that counts.

A descent by swift runs ends where their own error puts it. The way from there is short, and their Jacobian is good
enough for it: a chord step with the residuals of the finer mesh at life's pace. What these will be is foretold from the
pace and the mesh changed one at a time, runs that the numerical error needs anyway, so that as a rule one run on the
finer mesh is enough. Everything that is wanted at one place is simulated in one go, on all cores.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from tissuejax.experiments.probing_predictor import ProbingPredictor, predict_all
from tissuejax.experiments.probing_settings import REFINED
from tissuejax.fitting.problem import Problem
from tissuejax.recordings.recording import Recording

# what is left to the limit, over the change seen last: the mesh error falls with h^2 and the final mesh is the finer
# one; inertia falls with the square of the compression and the drag of damping with its first power, which is the
# larger of the two, from 2 f to f; the error of a penalty falls with its inverse, doubled
REMAINS = {"mesh": 1 / (REFINED**2 - 1), "step": 1.0, "penalty": 2.0}
ROUNDS = 6  # chord steps at most
NEAR = 1.0  # standard errors: a chord step shorter than this is not worth a run
BELOW = 0.1  # nor is one shorter than this share of what mesh, step and penalty leave open
Derive = Callable[[Float[np.ndarray, " p"]], Float[np.ndarray, "n p"]]


class Simulated:
    """Predictions made so far, so that nothing is simulated twice."""

    def __init__(self):
        self.made: dict[tuple, Mapping[str, Recording]] = {}

    def all(self, predictors: Sequence[ProbingPredictor], values: Mapping[str, float]) -> list[Mapping[str, Recording]]:
        """What each predictor says at the same values; those not known yet are simulated side by side."""
        keys = [(p.settings, p.names, *sorted(values.items())) for p in predictors]
        new = {k: p for k, p in zip(keys, predictors, strict=True) if k not in self.made}
        self.made |= dict(zip(new, predict_all(list(new.values()), dict(values)), strict=True))
        return [self.made[k] for k in keys]

    def residuals(self, problem: Problem, values: Mapping[str, float]) -> Float[np.ndarray, " n"]:
        """Residuals of the fitted recordings."""
        return problem.misfit(self.all([problem.predictor], values)[0], values)

    @property
    def runs(self) -> int:
        """How many were simulated."""
        return len(self.made)


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


class Changes(NamedTuple):
    """What numerical choices do to the residuals at one place.

    Attributes:
        residuals: by the settings of the problem.
        final: by the finer mesh, as foretold; by the settings of the problem where no finer mesh is asked for.
        left: by choice ("mesh", "step", "penalty"), from there to the limit.
    """

    residuals: Float[np.ndarray, " n"]
    final: Float[np.ndarray, " n"]
    left: dict[str, Float[np.ndarray, " n"]]


def changes(
    problem: Problem, values: Mapping[str, float], simulated: Simulated, finer: bool, numerical: bool
) -> Changes:
    """Pace, mesh and penalty changed one at a time, in one batch; the last two in runs twice as fast.

    Args:
        problem: whose predictor's settings are varied.
        values: where.
        told: keeps the predictions.
        finer: foretell the residuals on the finer mesh.
        numerical: what mesh, step and penalty leave open.
    """
    base = problem.predictor.settings
    fast = base.coarse
    wanted = {"here": base}
    if finer or numerical:
        wanted |= {"fast": fast, "mesh": base.finer.changed(compression=fast.compression)}
    if numerical:
        wanted["penalty"] = fast.changed(penalty=2 * fast.penalty)
    order = sorted(wanted, key=lambda name: name != "mesh")  # the longest run first
    predicted = simulated.all([problem.predictor.with_settings(wanted[name]) for name in order], values)
    r = {name: problem.misfit(p, values) for name, p in zip(order, predicted, strict=True)}
    left = {}
    if numerical:
        moved = {"mesh": r["mesh"] - r["fast"], "step": r["here"] - r["fast"], "penalty": r["penalty"] - r["fast"]}
        left = {choice: REMAINS[choice] * change for choice, change in moved.items()}
    return Changes(r["here"], r["here"] + r["mesh"] - r["fast"] if finer else r["here"], left)


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
        told: keeps the predictions.
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


def shifts(
    problem: Problem, left: Mapping[str, Float[np.ndarray, " n"]], jacobian: Float[np.ndarray, "n p"]
) -> tuple[dict[str, dict[str, float]], dict[str, float]]:
    """How far mesh, step and penalty hold each estimate off its limit, and the predictions (rms by channel, SI).

    Data that stay while the prediction changes by d move the estimate by -(J'J)^-1 J'd.

    Args:
        problem: whose channels and free parameters are meant.
        left: changes of the residuals to the limit, by choice.
        jacobian: of the residuals to the free parameters.
    """
    moves, squares = {}, {}
    for choice, change in left.items():
        for key, rows in problem.rows.items():
            d = change[rows] * problem.sigma(key)
            squares["/".join(key)] = squares.get("/".join(key), 0.0) + float(np.mean(d**2))
        move = -np.linalg.lstsq(jacobian, change, rcond=None)[0]
        moves[choice] = dict(zip(problem.free, map(float, move), strict=True))
    return moves, {key: value**0.5 for key, value in squares.items()}

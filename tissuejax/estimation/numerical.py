"""Numerical error of simulated recordings: how far mesh, step and penalty hold a prediction off its limit.

A choice is changed, the prediction follows, and what is left to the limit is a multiple of that change, by the order at
which the error falls: of a length h refined f times, 1 / (f^p - 1) of the change (Richardson 1911, Phil. Trans. R. Soc.
A 210). A fit carries it into its standard errors (`shifts`); a diagnosis gives every set of effects the same known part
of the discrepancy (`diagnosis.probing_view`).
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, cast

import numpy as np
from jaxtyping import Float

from tissuejax.estimation.problem import Problem
from tissuejax.experiments.probing_predictor import ProbingPredictor
from tissuejax.experiments.probing_settings import REFINED
from tissuejax.recordings.recording import Recording

Predict = Callable[[Sequence[ProbingPredictor], Mapping[str, float]], list[Mapping[str, Recording]]]


def remaining(finer: float, order: float, seen_coarse: bool = False) -> float:
    """What is left to the limit, over the change that making a length `finer` times smaller makes.

    Args:
        order: power of the length that the error falls with.
        seen_coarse: what is left from the coarser side, the change included.
    """
    left = 1 / (finer**order - 1)
    return 1 + left if seen_coarse else left


# the final mesh is the finer one; inertia falls with the square of the compression and the drag of damping with its
# first power, which is the larger of the two, from 2 f to f; the error of a penalty falls with its inverse, and the one
# that counts is the softer of the two
REMAINS = {
    "mesh": remaining(REFINED, 2),
    "step": remaining(2.0, 1),
    "penalty": remaining(2.0, 1, seen_coarse=True),
}


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


def changes(problem: Problem, values: Mapping[str, float], predict: Predict, finer: bool, numerical: bool) -> Changes:
    """Pace, mesh and penalty changed one at a time, in one batch; the last two in runs twice as fast.

    Args:
        problem: whose predictor's settings are varied.
        values: where.
        predict: what several predictors say at the same values, side by side.
        finer: foretell the residuals on the finer mesh.
        numerical: what mesh, step and penalty leave open.
    """
    predictor = cast(ProbingPredictor, problem.predictor)
    base = predictor.settings
    fast = base.coarse
    wanted = {"here": base}
    if finer or numerical:
        wanted |= {"fast": fast, "mesh": base.finer.changed(compression=fast.compression)}
    if numerical:
        wanted["penalty"] = fast.changed(penalty=2 * fast.penalty)
    order = sorted(wanted, key=lambda name: name != "mesh")  # the longest run first
    predicted = predict([predictor.with_settings(wanted[name]) for name in order], values)
    r = {name: problem.misfit(p, values) for name, p in zip(order, predicted, strict=True)}
    left = {}
    if numerical:
        moved = {"mesh": r["mesh"] - r["fast"], "step": r["here"] - r["fast"], "penalty": r["penalty"] - r["fast"]}
        left = {choice: REMAINS[choice] * change for choice, change in moved.items()}
    return Changes(r["here"], r["here"] + r["mesh"] - r["fast"] if finer else r["here"], left)


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

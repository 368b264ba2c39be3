"""What another mesh says of a fitted cut.

A descent takes dozens of runs and is made on coarse elements; where it ends, a few runs on elements of half the size
take the estimate on: chord steps, which need the residual there and keep the coarse mesh's Jacobian. How far the two
meshes are apart is then the error of the finer one, if what a mesh does falls with the first power of its element
(what parts first is a point of the faces a share of an element behind the front). Where the finer mesh can't be run,
the estimate stays, and a coarser one says how far meshes are apart.

Source: Roache 1994, J. Fluids Eng. 116:405 (two meshes).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from tissuejax.estimation.problem import Problem
from tissuejax.experiments.cutting_predictor import CuttingPredictor
from tissuejax.experiments.cutting_run import Ran
from tissuejax.recordings.recording import Recording

FINER, COARSER = 0.5, 1.5  # of the fit's element
CHORDS = 2  # on the finer mesh
FARTHEST = 0.4  # logarithm of a value's change by one of them


@dataclass(frozen=True)
class Meshes:
    """An estimate and how far meshes are apart.

    Attributes:
        values: the estimate, on the finer mesh where that could be run.
        shift: by path, the change from the fit's mesh to the other one; infinite where no other could be run.
        residuals: there, over the noise.
        predicted, ran: the recordings there, and the simulations behind them.
        predictor: the mesh of the estimate.
        finer: whether that is the finer one.
    """

    values: dict[str, float]
    shift: dict[str, float]
    residuals: Float[np.ndarray, " n"]
    predicted: dict[str, Recording]
    ran: dict[str, Ran | None]
    predictor: CuttingPredictor
    finer: bool


def on_two_meshes(
    posed: Problem, values: Mapping[str, float], finer: CuttingPredictor, coarser: CuttingPredictor
) -> Meshes:
    """Take a fitted cut on to a finer mesh.

    Args:
        posed: the fit's problem. values: where it ended.
        finer, coarser: lenient predictors of the same recordings on other meshes.
    """
    _, jacobian = posed.linearised(values)
    at = dict(values)
    for n in range(CHORDS + 1):
        found = _at(posed, finer.prepared(at), at)
        if not np.isfinite(found.residuals).all():
            break
        if n < CHORDS:
            at = _moved(posed, at, _step(jacobian, -found.residuals))
    else:
        return replace(found, shift={p: abs(at[p] - values[p]) for p in posed.free}, finer=True)
    found = _at(posed, posed.predictor, values)
    apart = found.residuals - replace(posed, predictor=coarser).residuals(values)
    step = _step(jacobian, apart) if np.isfinite(apart).all() else np.full(len(posed.free), np.inf)
    return replace(found, shift=dict(zip(posed.free, np.abs(step).tolist(), strict=True)))


def on_one_mesh(posed: Problem, values: Mapping[str, float]) -> Meshes:
    """The fit's own mesh, and nothing of any other."""
    return _at(posed, posed.predictor, values)


def _at(posed: Problem, predictor: CuttingPredictor, values: Mapping[str, float]) -> Meshes:
    predicted, ran = predictor.simulated(values)
    r = posed.misfit(predicted, values)
    return Meshes(dict(values), dict.fromkeys(posed.free, 0.0), r, predicted, ran, predictor, False)


def _step(jacobian, r) -> Float[np.ndarray, " p"]:
    return np.linalg.lstsq(jacobian, r, rcond=None)[0]


def _moved(posed: Problem, values: Mapping[str, float], step) -> dict[str, float]:
    """After a step, of the logarithm where values are positive by nature, inside the declared bounds."""
    declared, out = posed.predictor.model.parameters, dict(values)
    for path, s in zip(posed.free, step, strict=True):
        ratio = float(np.clip(s / max(abs(values[path]), declared[path].typical * 1e-3), -FARTHEST, FARTHEST))
        out[path] = float(np.clip(values[path] * np.exp(ratio), declared[path].lower, declared[path].upper))
    return out

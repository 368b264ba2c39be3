"""Fit of probings: few simulations, coarse derivatives under fine residuals, and errors that include the numerical one.

The derivatives come from a run twice as fast (half the steps), the residuals from the run that counts: Gauss-Newton
needs no better direction, and a Jacobian costs five forward runs. The end is a step on a finer mesh with the last
derivatives. Standard errors hold two parts: noise, and how far
the estimate moves when mesh, step and penalty are changed (a linear shift: the change of the prediction through the
Jacobian).
"""

import hashlib
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from tissuejax import storage
from tissuejax.errors import InputError
from tissuejax.experiments.probing_predictor import ProbingPredictor
from tissuejax.experiments.probing_settings import REFINED
from tissuejax.fitting.advice import warnings_of
from tissuejax.fitting.problem import Problem
from tissuejax.fitting.result import Fit, Iterate
from tissuejax.fitting.scores import scores
from tissuejax.fitting.sparing import sparing
from tissuejax.fitting.stability import recorded_stability
from tissuejax.fitting.uncertainty import Uncertainty, uncertainty
from tissuejax.progress import Progress, Silent
from tissuejax.recordings.recording import Recording

METHOD = "sparing"
# what is left to the limit, over the change just seen: the mesh error falls with h^2 and the final mesh is the finer
# one; inertia with the compression squared, from f to f/2; the error of a penalty with its inverse, doubled
REMAINS = {"mesh": 1 / (REFINED**2 - 1), "step": 4 / 3, "penalty": 2.0}


@dataclass(frozen=True)
class ProbedFit:
    """A fit of probings and what numerics did to it.

    Attributes:
        fit: the result; its standard errors include the numerical part.
        shifts: for each numerical choice ("mesh", "step", "penalty"), how far it holds a free parameter off its limit.
        numerical: root mean square numerical error of each "recording/channel", SI.
        noise_std: standard errors from noise alone.
        simulations: forward runs (those for the numerical error and the finer mesh included) and Jacobians spent, a
            run being all fitted recordings.
    """

    fit: Fit
    shifts: dict[str, dict[str, float]]
    numerical: dict[str, float]
    noise_std: dict[str, float]
    simulations: dict[str, int]

    def record(self) -> dict:
        """The contents of result.json."""
        return self.fit.record() | {
            "numerical": {"shifts": self.shifts, "rms": self.numerical, "noise_std": self.noise_std},
            "simulations": self.simulations,
        }


def fit_probed(
    problem: Problem,
    *,
    holdout: tuple[str, ...] = (),
    numerical: bool = True,
    finish: bool = True,
    checkpoint: Path | None = None,
    max_steps: int = 12,
    fraction: float = 0.1,
    progress: Progress | None = None,
    on_accept: Callable[[int, float, dict[str, float]], None] | None = None,
) -> ProbedFit:
    """Estimate the free parameters of a problem whose predictor simulates probings.

    Args:
        problem: predictor, free parameters, start, noise, bounds, priors.
        holdout: recordings of the same sample to predict and score only.
        numerical: estimate the numerical error (three more forward runs).
        finish: move to the finer mesh at the end (two more forward runs there); needs a graded mesh.
        checkpoint: a file that keeps the last accepted values; a fit of the same problem goes on from there.
        max_steps: Jacobians at most.
        fraction: converged once the next step is shorter than this many standard errors.
        progress: told after every run.
        on_accept: told runs, chi-square and values after every accepted step.

    Raises:
        UnstableSimulation: the start can't be simulated.
        InputError: a predictor of other experiments.
    """
    fine = problem.predictor
    if not isinstance(fine, ProbingPredictor):
        raise InputError("fit_probed takes a predictor of probings; use fit for material tests")
    begun = time.perf_counter()
    coarse = replace(problem, predictor=fine.with_settings(fine.settings.coarse))
    box, spent, told = problem.box, {"forward": 0, "jacobian": 0}, Told()
    kept = Checkpoint(checkpoint, problem)
    start = kept.values()
    with (progress or Silent()).stage(f"fitting {', '.join(fine.names)}", None) as stage:

        def residuals(y):
            spent["forward"] += 1
            stage.advance(note="simulation")
            r = told.residuals(problem, problem.values(box.bounded(y)[0]))
            kept.before = kept.before or vector_errors(problem, r)
            return r

        def jacobian(y):
            spent["jacobian"] += 1
            stage.advance(note="derivatives")
            x, slope = box.bounded(y)
            return coarse.linearised(problem.values(x))[1] * slope

        def accepted(n, cost, y):
            values = problem.values(box.bounded(y)[0])
            kept.keep(values)
            stage.advance(0, note=f"chi-square {2 * cost:.5g}")
            if on_accept is not None:
                on_accept(n, 2 * cost, values)

        y = box.free(problem.vector(start))
        descent, r, J = sparing(jacobian, residuals, y, max_steps=max_steps, fraction=fraction, on_accept=accepted)
        x, slope = box.bounded(descent.y)
        J, cost = J / slope, descent.cost
        kept.keep(problem.values(x))
        stage.advance(note="numerical error")
        shifts, sizes = numerical_shifts(problem, problem.values(x), r, J, told) if numerical else ({}, {})
        if finish:
            stage.advance(note="finer mesh")
            problem, x, r = finished(problem, x, J, told)
            cost = 0.5 * float(r @ r)
        final, values = problem.predictor, problem.values(x)
        kept.keep(values)
        before, after = kept.before, vector_errors(problem, r)
        fitted = dict(told(problem, values))
        stage.advance(note="held out")
        held = dict(final.of(holdout).predict(values)) if holdout else {}
    spent["forward"] = told.runs
    noise_part = _noise_part(problem, x, J, r)
    spread = _with_shifts(noise_part, [np.array(list(s.values())) for s in shifts.values()])
    measured = fine.sample.recordings
    std = dict(problem.noise.std)
    for name in holdout:
        for channel, series in measured[name].channels.items():
            std[f"{name}/{channel}"] = series.noise_std or std.get(f"{fine.names[0]}/{channel}", 1.0)
    found = Fit(
        problem=problem,
        status="converged" if descent.converged else descent.reason,
        values=values,
        uncertainty=spread,
        at_bound={p: side for p, side in zip(problem.free, box.at_bound(x), strict=True) if side},
        chi2=2 * cost,
        channels=scores(measured, fitted, std),
        holdout=scores(measured, held, std),
        predictions=fitted | held,
        trace=[Iterate(i, 2 * c, problem.values(box.bounded(y)[0])) for i, (c, y) in enumerate(descent.trace, 1)],
        stability=recorded_stability(final, values),
        starts=[2 * cost],
        n_evaluations=descent.n_evaluations,
        seconds=time.perf_counter() - begun,
        method=METHOD,
        sites={
            name: {c: {"before": before[name][c], "after": rms} for c, rms in channels.items()}
            for name, channels in after.items()
        },
    )
    found.warnings.extend(warnings_of(found))
    if shifts:
        found.warnings.append(_numerical_sentence(problem.free, shifts, noise_part))
    kept.done()
    noise_std = dict(zip(problem.free, map(float, noise_part.std), strict=True))
    return ProbedFit(found, shifts, sizes, noise_std, spent)


def vector_errors(problem: Problem, residuals: Float[np.ndarray, " n"]) -> dict[str, dict[str, float]]:
    """Root mean square length of the error vectors by recording and channel, SI (Lister 2012, eq. 2.2, 2.3, corrected:
    the mean over the samples summed)."""
    found: dict[str, dict[str, float]] = {}
    for key, rows in problem.rows.items():
        error = residuals[rows] * problem.sigma(key)
        found.setdefault(key[0], {})[key[1]] = float(np.sqrt(3 * np.mean(error**2)))
    return found


class Told:
    """Predictions made so far, so that nothing is simulated twice."""

    def __init__(self):
        self.made: dict[tuple, Mapping[str, Recording]] = {}

    def __call__(self, problem: Problem, values: Mapping[str, float]) -> Mapping[str, Recording]:
        """The prediction of the fitted recordings."""
        key = (problem.predictor.settings, *sorted(values.items()))
        if key not in self.made:
            self.made[key] = problem.predictor.predict(dict(values))
        return self.made[key]

    def residuals(self, problem: Problem, values: Mapping[str, float]) -> Float[np.ndarray, " n"]:
        """Its residuals."""
        return problem.misfit(self(problem, values), values)

    @property
    def runs(self) -> int:
        """How many were simulated."""
        return len(self.made)


def finished(problem: Problem, x: Float[np.ndarray, " p"], jacobian: Float[np.ndarray, "n p"], told: Told):
    """The problem on the finer mesh, the estimate after one step there with given derivatives, and its residuals."""
    settings = problem.predictor.settings
    finer = replace(problem, predictor=problem.predictor.with_settings(settings.finer))
    before = told.residuals(finer, finer.values(x))
    step = x - np.linalg.lstsq(jacobian, before, rcond=None)[0]
    lower, upper = (np.array(v) for v in zip(*(problem.bound(path) for path in problem.free), strict=True))
    step = np.clip(step, lower, upper)
    after = told.residuals(finer, finer.values(step))
    return (finer, step, after) if after @ after < before @ before else (finer, x, before)


def numerical_shifts(
    problem: Problem,
    values: Mapping[str, float],
    residuals: Float[np.ndarray, " n"],
    jacobian: Float[np.ndarray, "n p"],
    told: Told,
) -> tuple[dict[str, dict[str, float]], dict[str, float]]:
    """How far mesh, step and penalty hold the estimate off its limit, and how far the prediction moves.

    Data that stay while the prediction changes by d move the estimate by -(J'J)^-1 J'd. From the change to the next
    setting the distance to the limit follows by the order of convergence (`REMAINS`).

    Args:
        problem: with the predictor whose settings are varied.
        values: the estimate.
        residuals: there.
        jacobian: of the residuals to the free parameters, at the estimate.
        told: keeps the predictions.
    """
    predictor = problem.predictor
    shifts, squares = {}, {}
    for choice, settings in predictor.settings.varied.items():
        other = told.residuals(replace(problem, predictor=predictor.with_settings(settings)), values)
        change = REMAINS[choice] * (other - residuals)
        for key, rows in problem.rows.items():
            d = change[rows] * problem.sigma(key)
            squares["/".join(key)] = squares.get("/".join(key), 0.0) + float(np.mean(d**2))
        move = -np.linalg.lstsq(jacobian, change, rcond=None)[0]
        shifts[choice] = dict(zip(problem.free, map(float, move), strict=True))
    return shifts, {key: value**0.5 for key, value in squares.items()}


def _noise_part(problem: Problem, x, J, r) -> Uncertainty:
    declared = problem.predictor.model.parameters
    widening = max(1.0, float(np.sqrt(float(r @ r) / max(1, len(r) - len(x)))))
    scale = np.array([declared[path].typical for path in problem.free])
    labels = tuple(path.removeprefix("energy.") for path in problem.free)
    return uncertainty(J, x, scale, labels, tuple(declared[p].unit for p in problem.free), widening)


def _with_shifts(noise: Uncertainty, shifts: list[Float[np.ndarray, " p"]]) -> Uncertainty:
    """Numerical shifts added in quadrature to what noise leaves open."""
    covariance = noise.covariance + sum((np.outer(s, s) for s in shifts), np.zeros_like(noise.covariance))
    std = np.where(np.isfinite(noise.std), np.sqrt(np.diag(covariance)), np.inf)
    return Uncertainty(std, covariance, covariance / np.outer(std, std), noise.condition, noise.sentences)


def _numerical_sentence(free, shifts, noise: Uncertainty) -> str:
    parts = []
    for i, path in enumerate(free):
        total = sum(s[path] ** 2 for s in shifts.values()) ** 0.5
        parts.append(f"{path.split('.')[-1]} {total:.3g} (noise {noise.std[i]:.3g})")
    return f"Standard errors include what mesh, step and penalty leave open: {', '.join(parts)}."


class Checkpoint:
    """The last accepted values of a fit on disk, with a mark of the problem they belong to."""

    def __init__(self, path: Path | None, problem: Problem):
        self.path, self.problem = (None if path is None else Path(path)), problem
        self.before: dict[str, dict[str, float]] = {}  # errors at the very start
        parts = (problem.predictor.model, problem.predictor.names, problem.free, problem.predictor.settings)
        numbers = [problem.measured[k].tobytes() for k in problem.channels]
        self.mark = hashlib.sha256(repr(parts).encode() + b"".join(numbers)).hexdigest()

    def values(self) -> dict[str, float]:
        """Where to begin: the kept values if they are of this problem, else its start."""
        start = {path: float(v) for path, v in self.problem.start.items()}
        if self.path is None or not self.path.exists():
            return start
        kept = json.loads(self.path.read_text())
        if kept.get("mark") != self.mark:
            return start
        self.before = kept["before"]
        return start | kept["values"]

    def keep(self, values: Mapping[str, float]) -> None:
        """Note accepted values."""
        if self.path is not None:
            storage.write_json(self.path, {"mark": self.mark, "values": dict(values), "before": self.before})

    def done(self) -> None:
        """The fit has ended: nothing to resume."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)

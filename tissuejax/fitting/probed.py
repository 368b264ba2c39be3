"""Fit of probings: few simulations, a swift descent, a fine end, and errors that include the numerical one.

Where to go is found by runs four times as fast as the one that counts: their own error moves the estimate by a few
standard errors, and their derivatives are right to some per cent, which is enough to go by. The end (`closing`) are
chord steps on the finer mesh with the last derivatives. Standard errors hold two parts: noise, and how far the estimate
moves when mesh, step and penalty are changed (a linear shift: the change of the prediction through the Jacobian). Both
want derivatives at life's pace: where two columns are nearly one (a bulk modulus beside a shear modulus), what rings
in a swift run tells them apart, and errors come out several times too small.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError
from tissuejax.estimation.covariance import Uncertainty, uncertainty
from tissuejax.estimation.descent import Ended, descend
from tissuejax.estimation.ending import Ending
from tissuejax.estimation.methods import marquardt
from tissuejax.estimation.numerical import changes
from tissuejax.estimation.numerical import shifts as numerical_shifts
from tissuejax.estimation.posed import LeastSquares, half_square
from tissuejax.estimation.problem import Problem
from tissuejax.estimation.stability import recorded_stability
from tissuejax.estimation.transforms import chained, unchained
from tissuejax.experiments.probing_predictor import ProbingPredictor, make_ready
from tissuejax.fitting.advice import warnings_of
from tissuejax.fitting.bands import Std, fitted_std, held_out_std, marker_std
from tissuejax.fitting.checkpoint import Checkpoint, mark_of
from tissuejax.fitting.closing import close
from tissuejax.fitting.result import Fit, Iterate
from tissuejax.fitting.scores import scores
from tissuejax.fitting.simulated import Simulated
from tissuejax.progress import Progress, Silent
from tissuejax.recordings.recording import Recording

PROBED_METHOD = "levenberg-marquardt"
LAST = 15.0  # standard errors: after a step shorter than this the rest is left to the chord steps of the end


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
        numerical: estimate the numerical error (three more forward runs, one of them on the finer mesh).
        finish: move to the finer mesh at the end (one or two more forward runs there); needs a graded mesh.
        checkpoint: a file that keeps the last accepted values; a fit of the same problem goes on from there.
        max_steps: Jacobians at most.
        fraction: converged once the next step is shorter than this many standard errors.
        progress: advanced after every run.
        on_accept: called with runs, chi-square and values after every accepted step.

    Raises:
        UnstableSimulation: the start can't be simulated.
        InputError: a predictor of other experiments.
    """
    fine = problem.predictor
    if not isinstance(fine, ProbingPredictor):
        raise InputError("fit_probed takes a predictor of probings; use fit for material tests")
    begun = time.perf_counter()
    kept = Checkpoint(checkpoint, mark_of(problem, fine.settings, fine.setups), problem.start)
    start = kept.values()
    with (progress or Silent()).stage(f"fitting {', '.join(fine.names)}", None) as stage:
        runs = Runs(problem, stage, kept, on_accept)
        kept.keep(start, kept.closing)  # a machine's first run compiles for longer than a user waits for a sign of it
        stage.advance(note="programs")
        finest = fine.with_settings(fine.settings.finer) if finish or numerical else fine
        make_ready([runs.swift.predictor], [finest, fine], start, problem.free)
        y = problem.box.free(problem.vector(start))
        kept.before = kept.before or vector_errors(problem, runs.begin(y))
        if kept.closing:  # the swift descent had ended already
            r, (x, slope) = runs.residuals(y), problem.box.bounded(y)
            J = chained(runs.better(x), slope)
            descent = Ended(y, half_square(r), Ending.CONVERGED, r, J, 0, 0)
        else:
            descent = descend(runs, y, marquardt(len(y), max_steps, fraction, LAST), runs.accepted)
        x, slope = problem.box.bounded(descent.y)
        J = unchained(descent.jacobian, slope)
        kept.keep(problem.values(x), closing=True)
        stage.advance(note="numerical error" if numerical else "the fine simulation")
        seen = changes(problem, problem.values(x), runs.simulated.all, finish, numerical)
        stage.advance(note="finer mesh" if finish else "last steps")
        problem, x, r, left = close(problem, x, J, seen, runs.simulated, finish, holdout, runs.better, runs.closer)
        J = runs.exact(x)
        shifts, sizes = numerical_shifts(problem, seen.left, J)
        cost = 0.5 * float(r @ r)
        final, values = problem.predictor, problem.values(x)
        before, after = kept.before, vector_errors(problem, r)
        fitted = dict(runs.simulated.all([final], values)[0])
        stage.advance(note="held out")
        held = dict(runs.simulated.all([final.of(holdout)], values)[0]) if holdout else {}
        noise_part = _noise_part(problem, x, J, r)
        spread = _with_shifts(noise_part, [np.array(list(s.values())) for s in shifts.values()])
        shown = _shown_std(problem, J, spread, fitted) | (runs.held_out_std(values, spread, held) if held else {})
    status = Ending.LONG_STEPS if left >= LAST else Ending.CONVERGED if descent.converged else descent.reason
    measured = fine.sample.recordings
    std = dict(problem.noise.std)
    for name in holdout:
        for channel, series in measured[name].channels.items():
            std[f"{name}/{channel}"] = series.noise_std or std.get(f"{fine.names[0]}/{channel}", 1.0)
    found = Fit(
        problem=problem,
        status=status,
        values=values,
        uncertainty=spread,
        at_bound={p: side for p, side in zip(problem.free, problem.box.at_bound(x), strict=True) if side},
        chi2=2 * cost,
        channels=scores(measured, fitted, std),
        holdout=scores(measured, held, std),
        predictions=fitted | held,
        trace=[
            Iterate(i, 2 * c, problem.values(problem.box.bounded(y)[0]))
            for i, (c, y) in enumerate([*descent.trace, (cost, problem.box.free(x))], 1)
        ],
        stability=recorded_stability(final, values),
        starts=[2 * cost],
        n_evaluations=runs.simulated.runs + runs.jacobians,
        seconds=time.perf_counter() - begun,
        method=PROBED_METHOD,
        sites={
            name: {c: {"before": before[name][c], "after": rms} for c, rms in channels.items()}
            for name, channels in after.items()
        },
        curve_std=shown,
    )
    found.warnings.extend(warnings_of(found))
    if shifts:
        found.warnings.append(numerical_sentence(problem, values, shifts, noise_part))
    kept.done()
    noise_std = dict(zip(problem.free, map(float, noise_part.std), strict=True))
    return ProbedFit(found, shifts, sizes, noise_std, {"forward": runs.simulated.runs, "jacobian": runs.jacobians})


class Runs(LeastSquares):
    """The simulations of a fit: what the descent asks for, in its own coordinates y, shown and counted.

    Attributes:
        swift: the problem simulated fast, for residuals and derivatives of the descent.
        simulated: forward runs made so far.
        jacobians: how many were computed.
    """

    def __init__(self, problem: Problem, stage, kept: Checkpoint, on_accept: Callable | None):
        self.problem, self.stage, self.kept, self.on_accept = problem, stage, kept, on_accept
        fine = problem.predictor
        self.swift = replace(problem, predictor=fine.with_settings(fine.settings.swift))
        self.coarse = replace(problem, predictor=fine.with_settings(fine.settings.coarse))
        self.simulated, self.jacobians, self.first = Simulated(), 0, {}

    def begin(self, y: Float[np.ndarray, " p"]) -> Float[np.ndarray, " n"]:
        """Residuals at the start, which come with the derivatives there and are kept with them."""
        self.stage.advance(note="derivatives")
        self.jacobians += 1
        x, slope = self.problem.box.bounded(y)
        r, J = self.swift.linearised(self.problem.values(x))
        self.first[y.tobytes()] = r, chained(J, slope)
        return r

    def residuals(self, y: Float[np.ndarray, " p"]) -> Float[np.ndarray, " n"]:
        """Of the swift simulation."""
        if y.tobytes() in self.first:
            return self.first[y.tobytes()][0]
        self.stage.advance(note="simulation")
        return self.simulated.residuals(self.swift, self.problem.values(self.problem.box.bounded(y)[0]))

    def jacobian(self, y: Float[np.ndarray, " p"]) -> Float[np.ndarray, "n p"]:
        """Of the swift simulation, to y."""
        if y.tobytes() not in self.first:
            self.begin(y)
        return self.first[y.tobytes()][1]

    def better(self, x: Float[np.ndarray, " p"]) -> Float[np.ndarray, "n p"]:
        """Jacobian to the parameters themselves, of a simulation nearer to the one that counts."""
        self.stage.advance(note="derivatives")
        self.jacobians += 1
        return self.coarse.linearised(self.problem.values(x))[1]

    def exact(self, x: Float[np.ndarray, " p"]) -> Float[np.ndarray, "n p"]:
        """Jacobian to the parameters themselves at the pace that counts, for what is said of the estimate."""
        self.stage.advance(note="standard errors")
        self.jacobians += 1
        return self.problem.linearised(self.problem.values(x))[1]

    def held_out_std(self, values: Mapping[str, float], spread: Uncertainty, held: Mapping[str, Recording]) -> Std:
        """See `bands.held_out_std`, by the simulation of `exact`."""
        self.stage.advance(note="band of what was held out")
        self.jacobians += 1
        return held_out_std(self.problem, values, spread, held)

    def accepted(self, n: int, cost: float, y: Float[np.ndarray, " p"]) -> None:
        """Keep an accepted step and show it."""
        self._accepted(n, cost, self.problem.values(self.problem.box.bounded(y)[0]), closing=False)

    def closer(self, x: Float[np.ndarray, " p"], cost: float) -> None:
        """The same for a chord step of the end."""
        self._accepted(self.simulated.runs + self.jacobians, cost, self.problem.values(x), closing=True)

    def _accepted(self, n: int, cost: float, values: dict[str, float], closing: bool) -> None:
        self.kept.keep(values, closing)
        self.stage.advance(0, note=f"chi-square {2 * cost:.5g}")
        if self.on_accept is not None:
            self.on_accept(n, 2 * cost, values)


def vector_errors(problem: Problem, residuals: Float[np.ndarray, " n"]) -> dict[str, dict[str, float]]:
    """Root mean square length of the error vectors by recording and channel, SI (Lister 2012, eq. 2.2, 2.3, corrected:
    the mean over the samples summed)."""
    found: dict[str, dict[str, float]] = {}
    for (recording, channel), rows in problem.rows.items():
        error = residuals[rows] * problem.sigma((recording, channel))
        found.setdefault(recording, {})[channel] = float(np.sqrt(3 * np.mean(error**2)))
    return found


def _shown_std(problem: Problem, J, spread: Uncertainty, fitted: Mapping) -> Std:
    """Standard deviation of what a picture shows: every component of the force, of the markers their mean way."""
    marks = marker_std(problem, J, spread, fitted)
    return {name: of | marks.get(name, {}) for name, of in fitted_std(problem, J, spread).items()}


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
    correlation = covariance / np.outer(std, std)
    return replace(noise, std=std, covariance=covariance, correlation=correlation)


def numerical_sentence(problem: Problem, values: Mapping[str, float], shifts, noise: Uncertainty) -> str:
    """Shares of the values, so that the sentence is right beside any unit."""
    declared, parts = problem.predictor.model.parameters, []
    for i, path in enumerate(problem.free):
        size = abs(values[path]) or declared[path].typical
        total = sum(s[path] ** 2 for s in shifts.values()) ** 0.5
        shares = (f"{100 * part / size:.2g} %" for part in (total, noise.std[i]))
        parts.append("{} {} (noise {})".format(path.split(".")[-1], *shares))
    told = ", ".join(parts)
    return f"Standard errors include what mesh, step and penalty leave open, of the values: {told}."

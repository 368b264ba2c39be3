"""Fit: weighted nonlinear least squares from several starts, with noise from the residuals where none was recorded.

`fit(problem)` is what commands and studies call. `descend(problem, start)` is the bare descent from one start, without
uncertainties or scores, for callers that fit thousands of times: no compilation when model structure and (padded)
lengths repeat.
"""

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError, NotConverged
from tissuejax.estimation.covariance import Uncertainty, uncertainty
from tissuejax.estimation.descent import Ended
from tissuejax.estimation.descent import descend as minimised
from tissuejax.estimation.ending import Ending
from tissuejax.estimation.losses import soften
from tissuejax.estimation.methods import trust_region
from tissuejax.estimation.posed import LeastSquares, half_square
from tissuejax.estimation.problem import Problem
from tissuejax.estimation.sigma import sigmas
from tissuejax.estimation.stability import recorded_stability
from tissuejax.estimation.transforms import chained
from tissuejax.fitting.advice import warnings_of
from tissuejax.fitting.gradient_descent import GRADIENT_METHODS, gradient_descent
from tissuejax.fitting.idle import roused, terms, woken, woken_modulus
from tissuejax.fitting.options import Search
from tissuejax.fitting.result import Fit, Iterate
from tissuejax.fitting.scores import scores
from tissuejax.fitting.separable import NotSeparable, projected_descent, separable
from tissuejax.fitting.serial import Serial, serial
from tissuejax.fitting.starts import fitted_moduli, neutral, variations

STRESS = "nominal_stress"
METHODS = ("levenberg-marquardt", *GRADIENT_METHODS)
CONTRADICTED = 3.5  # standard deviations of chi-square from which the recorded noise is not what the residuals have
AGAIN = 3  # rounds of re-estimating several unknown noise levels
WORTH = 1e-4  # share of the misfit that waking an idle term must take for a further try


def descend(
    problem: Problem,
    start: Mapping[str, float] | None = None,
    *,
    method: str = "levenberg-marquardt",
    max_steps: int = 200,
    tolerance: float = 1e-9,
    on_accept: Callable[[int, float, dict[str, float]], None] | None = None,
    to_beat: float = np.inf,
    on_run: Callable[[], None] | None = None,
) -> Ended:
    """The bare minimisation from one start; `Ended.y` are the free parameters themselves, in the order of
    `problem.free`.

    Args:
        problem: what to fit.
        start: values for all parameters (the problem's own if None).
        method: "levenberg-marquardt", "adam" or "lbfgs".
        max_steps: evaluations at most.
        tolerance: relative decrease of the misfit below which it stops.
        on_accept: called with evaluations, chi-square and values after every accepted step.
        to_beat: cost another start reached.
        on_run: called after every evaluation of residuals and derivatives ("levenberg-marquardt" that is not by
            projection).
    """
    x = problem.vector(start if start is not None else problem.start)
    if method == "levenberg-marquardt" and separable(problem):
        accepted = None if on_accept is None else lambda n, cost, x: on_accept(n, 2 * cost, problem.values(x))
        options = {"max_steps": max_steps, "tolerance": tolerance, "to_beat": to_beat}
        with suppress(NotSeparable):
            return projected_descent(problem, x, on_accept=accepted, **options)
    box = problem.box
    y = box.free(x)

    def report(n, cost, y):
        on_accept(n, 2 * cost, problem.values(box.bounded(y)[0]))

    accepted = report if on_accept is not None else None
    if method == "levenberg-marquardt":
        found = minimised(InBox(problem, on_run), y, trust_region(len(y), max_steps, tolerance, to_beat), accepted)
    elif method in GRADIENT_METHODS:
        found = gradient_descent(problem, y, method, max_steps=max_steps, tolerance=tolerance, on_accept=accepted)
    else:
        raise InputError(f"unknown method {method!r}; one of {', '.join(METHODS)}")
    trace = [(cost, box.bounded(y)[0]) for cost, y in found.trace]
    return replace(found, y=box.bounded(found.y)[0], trace=trace)


class InBox(LeastSquares):
    """A problem in coordinates without bounds (`transforms.Box`), its residuals bent by a loss.

    Residuals and derivatives come from one run in forward mode; those of the last point are kept.
    """

    def __init__(self, problem: Problem, on_run: Callable[[], None] | None = None):
        self.problem, self.at, self.last = problem, b"", (np.zeros(0), np.zeros((0, 0)))
        self.on_run = on_run or (lambda: None)

    def linearised(self, y: Float[np.ndarray, " p"]) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n p"]]:
        """Both; infinite residuals where either is not finite."""
        if self.at != y.tobytes():
            x, slope = self.problem.box.bounded(y)
            r, jacobian = self.problem.linearised(self.problem.values(x))
            r, bend = soften(self.problem.loss, r)
            jacobian = chained(jacobian, slope) * bend[:, None]
            good = np.isfinite(half_square(r)) and np.isfinite(jacobian).all()
            self.at, self.last = y.tobytes(), (r if good else np.full_like(r, np.inf), jacobian)
            self.on_run()
        return self.last

    def residuals(self, y: Float[np.ndarray, " p"]) -> Float[np.ndarray, " n"]:
        """See `LeastSquares.residuals`."""
        return self.linearised(y)[0]

    def jacobian(self, y: Float[np.ndarray, " p"]) -> Float[np.ndarray, "n p"]:
        """See `LeastSquares.jacobian`."""
        return self.linearised(y)[1]


def fit(
    problem: Problem,
    *,
    start: Mapping[str, float] | None = None,
    search: Search | None = None,
    holdout: tuple[str, ...] = (),
    on_accept: Callable[[int, float, dict[str, float]], None] | None = None,
) -> Fit:
    """Estimate the free parameters of a problem.

    Args:
        problem: predictor, free parameters, noise, bounds, priors.
        start: values to begin with, taken as they are; None solves for the moduli first. Where it says nothing of a
            relaxation's share and time, they begin where they promise most.
        search: method, number of starts and steps.
        holdout: recordings of the sample, outside the problem, to predict and score.
        on_accept: called with evaluations, chi-square and values after every accepted step.

    Raises:
        InputError: a start at which the model has no finite prediction, an unknown method or recording.
        NotConverged: no start led to a finite misfit.
    """
    begun, search = time.perf_counter(), search or Search()
    multistart, method, max_steps = search.multistart, search.method, search.max_steps
    first = dict(problem.start) | dict(start or {})
    if start is None and not separable(problem):
        first = fitted_moduli(problem, first)
    bare = first
    first = roused(problem, first, told=frozenset(start or ()))
    tries = [first, *variations(problem, first, multistart - 1, search.seed)]
    n, ends = 0, []
    options = {"method": method, "max_steps": max_steps, "on_accept": on_accept}
    for held in neutral(problem) if start is None and multistart > 1 else ():
        smaller = replace(problem, free=tuple(p for p in problem.free if p not in held))
        inside = descend(smaller, bare, method=method, max_steps=max_steps)
        n += inside.runs
        if np.isfinite(inside.cost):
            tries.append(smaller.values(inside.y))
    for values in tries:
        ends.append(descend(problem, values, to_beat=min((e.cost for e in ends), default=np.inf), **options))
        n += ends[-1].runs
    best = min(ends, key=lambda d: (d.cost, not d.converged))
    if not np.isfinite(best.cost):
        raise InputError(
            "the model has no finite prediction at the start (a stretch outside the energy's valid range?): "
            f"start was {_listed(problem, first)}; change it with --start, or the energy"
        )
    starts = [2 * d.cost for d in ends]
    if multistart > 1:
        best, more = _awake(problem, best, options)
        n += more
    if problem.noise.estimated:
        problem, best, more = _with_estimated_noise(problem, best, options)
        n += more
    values = problem.values(best.y)
    spread = curvature(problem, values)
    predictions = dict(problem.predictor.predict(values))
    std = dict(problem.noise.std)
    if holdout:
        predictions |= problem.predictor.of(holdout).predict(values)
        std |= _holdout_noise(problem, holdout)
    std |= _own_noise(problem, (*problem.predictor.names, *holdout))
    measured = problem.predictor.sample.recordings
    inside = {name: predictions[name] for name in problem.predictor.names}
    bounds = {p: side for p, side in zip(problem.free, problem.box.at_bound(best.y), strict=True) if side}
    found = Fit(
        problem=problem,
        status=Ending.CONVERGED if best.converged else best.reason,
        values=values,
        uncertainty=spread,
        at_bound=bounds,
        chi2=2 * best.cost,
        channels=scores(measured, inside, std),
        holdout=scores(measured, {name: predictions[name] for name in holdout}, std),
        predictions=predictions,
        stability=recorded_stability(problem.predictor, values),
        trace=[Iterate(i, 2 * cost, problem.values(x)) for i, (cost, x) in enumerate(best.trace, start=1)],
        starts=starts,
        n_evaluations=n,
        seconds=time.perf_counter() - begun,
        method=method,
    )
    found.warnings.extend(warnings_of(found))
    return found


def required(found: Fit) -> Fit:
    """`found` itself if it converged.

    Raises:
        NotConverged: with the reason and the advice.
    """
    if not found.converged:
        raise NotConverged(
            f"the fit did not converge ({found.status}); try other starts, more --max-steps or fewer parameters"
        )
    return found


def curvature(problem: Problem, values: Mapping[str, float]) -> Uncertainty:
    """Uncertainty of the free parameters at `values`: under correlated noise, by the residuals' own scatter where that
    contradicts the recorded noise or none was recorded."""
    r, jacobian = problem.linearised(values)
    memory = serial(problem, r)
    widening, dof = _scatter(problem, r, jacobian, memory)
    declared = problem.predictor.model.parameters
    return uncertainty(
        jacobian,
        problem.vector(values),
        np.array([declared[path].typical for path in problem.free]),
        tuple(path.removeprefix("energy.") for path in problem.free),
        tuple(declared[path].unit for path in problem.free),
        widening,
        correlated=memory.times if memory.parts else None,
        dof=dof,
    )


def _scatter(problem: Problem, r: np.ndarray, jacobian: np.ndarray, memory: Serial) -> tuple[float, float]:
    """What to widen standard errors by, and the degrees of freedom behind it."""
    u, s, _ = np.linalg.svd(jacobian / np.linalg.norm(jacobian, axis=0).clip(1e-300), full_matrices=False)
    u = u[:, s > 1e-10 * s[0]]
    left = max(len(r) - float(np.sum(u * memory.times(u))), 1.0)  # what squares add up to beside the fit
    squares = memory.squares(len(r)) * left / len(r)
    chi2 = float(r @ r)
    known = not problem.noise.estimated and abs(chi2 - left) < CONTRADICTED * np.sqrt(2 * squares)
    return (1.0, np.inf) if known else (float(np.sqrt(chi2 / left)), max(1.0, left**2 / squares))


def _awake(problem: Problem, best: Ended, options) -> tuple[Ended, int]:
    """Go on from `best` with idle terms woken (`fitting.idle`), one at a time as long as that gains."""
    n = 0
    for _ in range(sum(len(series) for series in terms(problem)) + len(problem.moduli)):
        values = problem.values(best.y)
        start = woken(problem, values) or woken_modulus(problem, values)
        if start is None:
            break
        again = descend(problem, start, **options)
        n += again.runs
        if not again.cost < (1 - WORTH) * best.cost:
            break
        best = again
    return best, n


def _with_estimated_noise(problem: Problem, best: Ended, options) -> tuple[Problem, Ended, int]:
    """Replace guessed noise by the residuals' own; refit where several levels are unknown, since their ratio
    matters.
    """
    n = 0
    several = len(set(problem.noise.groups.values())) > 1 or len(problem.noise.groups) < len(problem.noise.std)
    for _ in range(AGAIN if several else 1):
        r = problem.residuals(problem.values(best.y))
        factors = {}
        for group in set(problem.noise.groups.values()):
            mine = np.concatenate(
                [r[rows] for key, rows in problem.rows.items() if problem.noise.groups.get("/".join(key)) == group]
            )
            taken = len(problem.free) * len(mine) / problem.n_samples
            factors[group] = max(float(np.sqrt(mine @ mine / max(1.0, len(mine) - taken))), 1e-9)
        problem = problem.with_noise(problem.noise.scaled(factors))
        if several or problem.priors or problem.loss != "squares":
            again = descend(problem, problem.values(best.y), **options)
            n += again.runs
            best = again if np.isfinite(again.cost) else best
        else:
            factor = next(iter(factors.values())) ** 2
            best = replace(best, cost=best.cost / factor, trace=[(cost / factor, x) for cost, x in best.trace])
    return problem, best, n


def _holdout_noise(problem: Problem, names: tuple[str, ...]) -> dict[str, float]:
    """Noise of held-out channels: their own if recorded, else that of a fitted channel of the same name."""
    found = {}
    fitted = {key.split("/")[-1]: s for key, s in problem.noise.std.items()}
    for name in names:
        for channel, series in problem.predictor.sample.recordings[name].channels.items():
            recorded = series.noise_std
            found[f"{name}/{channel}"] = float(recorded) if recorded else fitted.get(channel, 1.0)
    return found


def _own_noise(problem: Problem, names: tuple[str, ...]) -> dict[str, float]:
    """Of material tests without a recorded noise, what the recordings themselves tell of it.

    A misfit in units of the residuals' own scatter is 1 whatever the model lacks; this is what a diagnosis measures by.
    """
    recordings = problem.predictor.sample.recordings
    plain = [n for n in names if STRESS in recordings[n].channels and {"stretch", "shear"} & set(recordings[n].inputs)]
    plain = [n for n in plain if f"{n}/{STRESS}" not in problem.noise.std or f"{n}/{STRESS}" in problem.noise.groups]
    found = sigmas(problem.predictor.sample, tuple(plain))[0] if plain else {}
    return {f"{n}/{STRESS}": s for n, s in found.items()}


def _listed(problem: Problem, values: Mapping[str, float]) -> str:
    return ", ".join(f"{path} = {values[path]:g}" for path in problem.free)

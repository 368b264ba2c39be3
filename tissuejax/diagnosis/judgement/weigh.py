"""One set of effects weighed: fitted under noise and discrepancy, and its evidence by Laplace's method.

Parameters of the base have flat priors, the same in every set. An effect's amplitude has a normal prior about neutral,
one-sided where the effect is; its width is in terms of what it does: the amplitude that changes the stress by
`Criteria.change` of it, or `Criteria.rig` (derivative at neutral, at the base fit, with the shapes where the fit rests;
of simulations with those where it began). So one number serves gaps, moduli and rates; an effect that only corrects
what was noted says itself how far that may be wrong (`Effect.misjudged`).
Positive shapes have normal priors of their logarithms. Fit and amplitudes of the discrepancy are found in turn.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.bench import Bench, Candidate
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Course
from tissuejax.diagnosis.judgement.evidence import SetEvidence
from tissuejax.diagnosis.judgement.marginal import (
    Linear,
    Marginal,
    Widths,
    amplitudes,
    uphill,
)
from tissuejax.diagnosis.judgement.mass import amplitude_mass
from tissuejax.diagnosis.judgement.ranges import on_bounds, within
from tissuejax.diagnosis.judgement.rest import beyond, numerical, rest, unlike_noise, wobble
from tissuejax.diagnosis.judgement.scales import BEFORE, Scales, log_prior, squared, with_priors
from tissuejax.diagnosis.judgement.whitening import Whitening
from tissuejax.diagnosis.refit import Descent, Refit, anchored, refit
from tissuejax.estimation.discrepancy import Part

FELT = 1e-6  # of the peak: what is no rounding, by its slope
WILD = 1e3  # of the peak: a prediction beyond that has no density, were it of one sample alone
NOTHING = 1e-12  # of the peak: a change of the stress that is rounding


@dataclass(frozen=True)
class Weighed:
    """A set that was weighed: its evidence, its fit to all recordings, the amplitudes, and what it leaves.

    Attributes:
        refit: to all recordings, under the discrepancy.
        v: squared amplitudes of the parts.
        parts: of the discrepancy, about the fit.
        rest: the discrepancy's posterior mean over the blocks, Pa.
        bench: that it was weighed on; `settled`: whether its predictions are exact at the fit.
        linear: the problem about the fit; None of an impossible set.
        begun: values at which it began, by which the priors of its amplitudes go at first.
        idle: keys of what does nothing there: it is the set without them.
    """

    evidence: SetEvidence
    refit: Refit
    v: Float[np.ndarray, " K"]
    parts: tuple[Part, ...]
    rest: Float[np.ndarray, " M"]
    bench: Bench | None = None
    settled: bool = True
    linear: Linear | None = None
    begun: Mapping[str, float] = field(default_factory=dict)
    idle: tuple[str, ...] = ()


@dataclass(frozen=True)
class Round:
    """What one turn of fit and amplitudes came to.

    Attributes:
        total: log evidence; value: of it, without `occam`, the mass over the discrepancy's amplitudes.
        fit, v: the parameters and the squared amplitudes reached.
        m: the density there; ahead: what a straight line would gain from there.
        bound: which parameters of `descent` rest on a bound.
        residual: block means, Pa, beside `parts`, on `bench`.
        felt: by parameter, its largest slope, Pa per unit.
        linear: the problem about the fit.
    """

    total: float
    value: float
    occam: float
    fit: Refit
    v: Float[np.ndarray, " K"]
    m: Marginal
    ahead: float
    bound: np.ndarray
    descent: Descent
    residual: Float[np.ndarray, " M"]
    parts: tuple[Part, ...]
    bench: Bench
    felt: Mapping[str, float]
    linear: Linear


@dataclass(frozen=True)
class Start:
    """Where the weighing of a set begins.

    Attributes:
        values: parameters, by which the priors of the amplitudes go at first.
        v: squared amplitudes of the discrepancy; of their prior's size by default.
        bench: where a cheap simulation is corrected, with the correction to begin with; that of the base by default.
        at: where the fit begins, if not at `values`.
    """

    values: Mapping[str, float]
    v: Float[np.ndarray, " K"] | None = None
    bench: Bench | None = None
    at: Mapping[str, float] | None = None


def weigh(
    scales: Scales, keys: Sequence[str], start: Start, criteria: Criteria, course: Course | None = None
) -> Weighed:
    """Fit the set `keys` from `start` and weigh it.

    Args:
        course: how far the fit is followed; that of a search's base by default.
    """
    course = course or Course()
    names = scales.bench.fitted
    widths = scales.priors(criteria, keys)
    faults = {p for k in keys if scales.bench.candidates[k].rig for p in scales.bench.candidates[k].paths}
    anew, v = start.v is None, widths.width**2 if start.v is None else start.v
    bench, priors = with_priors(scales, keys, start.values, criteria, start.bench)
    y, best = scales.cut.mean(bench.y), None
    at, tolerance, raw = dict(start.at or start.values), course.first, None
    bench = bench.anchored(at) if course.anchor else bench.nearer(at)
    shaped = not bench.costly and any(bench.candidates[k].shapes for k in keys)
    errs = np.array([f == "effect" or bool(faults) and f in BEFORE for f in scales.families])
    if anew or bench.costly or not np.any(v[errs]):
        parts = scales.about(bench.predict(at), bench, keys, at)
    else:
        parts, raw = _resumed(scales, bench, keys, at, faults)
    for turn in range(course.rounds):
        # what laws of effects err by lies across the slopes at a fit, so does what faults set, and before the first
        # there are none
        known = v if turn or raw is not None else np.where(errs, 0.0, v)
        misfit = Whitening(bench, scales.cut, scales.blocked, parts, known)
        seed = None if raw is None or bench.costly else misfit.whiten_means(raw)
        fit = refit(bench, misfit, keys, at, iterations=course.iterations, tolerance=tolerance, errors=False, seed=seed)
        if not np.isfinite(fit.chi2):
            break
        if course.anchor:
            bench, fit = anchored(bench, fit, at, course.shortened)
        if not np.max(np.abs(fit.prediction)) < WILD * scales.peak:
            break  # shares of it would cover all that was measured
        if shaped:
            bench, priors = with_priors(scales, keys, fit.values, criteria, bench)
        descent = Descent(bench, misfit, tuple(fit.values), names, {})
        x = descent.point(fit.values)
        resting = descent.resting(x)
        bound, own = resting.on, np.array([p not in faults for p in descent.paths])
        raw = scales.cut.mean(bench.jacobian(fit.values, descent.paths, names))
        slopes = resting.along(raw)
        jac = slopes * np.where(descent.log, [fit.values[p] for p in descent.paths], 1.0)
        if not np.isfinite(squared(jac / scales.blocked.sigma[:, None])):
            break  # a prediction without a slope, or with one beyond all numbers: no density is to be had there
        residual = y - scales.cut.mean(fit.prediction)
        of_base = raw[:, : len(bench.base)]  # they come first
        parts = scales.about(
            fit.prediction, bench, keys, fit.values, slopes[:, ~bound & own], of_base, slopes[:, ~bound & ~own]
        )
        prior = [priors.get(p) for p in descent.paths]
        weak = np.array([0.0 if p is None else p[1] ** -2 for p in prior])
        offset = np.array([0.0 if p is None else a - p[0] for a, p in zip(x, prior, strict=True)])
        if resting.full:
            offset = np.divide(resting.along(weak * offset), weak, out=offset, where=weak > 0)
        # what nothing is known of, neither from the data nor before, has no density and is left alone
        dead = np.max(np.abs(jac), axis=0, initial=0.0) * descent.scale <= NOTHING * scales.peak
        free = ~bound & ~(dead & (weak == 0))
        every = Linear(residual, jac, offset, weak)
        linear = every.of(free)
        # anew from where all is wide that may be; where predictions are costly fits are few, and both are tried
        begin = frozenset({"wide"} if anew else {"there"}) | ({"there"} if bench.costly else set())
        v, m = climb(linear, parts, widths, scales.blocked, v, begin, course)
        anew = False
        value = m.value + 0.5 * int(np.sum(free)) * math.log(2 * math.pi)
        # of these parameters, and not of those that a straight line leads to: the parts move with the prediction
        ahead = 0.5 * float(m.step @ m.precision @ m.step)
        value -= ahead
        value += sum(
            log_prior(bench.free[p], a, q) + 0.5 * w * o * o
            for p, a, q, w, o in zip(descent.paths, x, prior, weak, offset, strict=True)
            if q is not None
        )
        # what rests on a bound was left out of the integral: its own factor, and its prior's square, follow
        held = on_bounds(scales.blocked, parts, v, every, resting, free, m.precision)
        held += within(resting, free, m.precision)
        occam = amplitude_mass(linear, parts, widths, scales.blocked, v, m)
        total = value + held + occam
        if best is None or total > best.total + 1e-6:
            gained = math.inf if best is None else total - best.total
            felt = dict(zip(descent.paths, np.max(np.abs(raw), axis=0), strict=True))
            best = Round(
                total, value + held, occam, fit, v, m, ahead, bound, descent, residual, parts, bench, felt, linear
            )
        else:
            break
        if gained < course.settled or total + ahead < course.floor:
            break
        at, tolerance = dict(fit.values), tolerance if bench.costly else course.later
    if best is None:
        return _impossible(scales, keys)
    return replace(_described(scales, keys, best, criteria), settled=course.anchor, begun=dict(start.values))


def _resumed(
    scales: Scales, bench: Bench, keys: Sequence[str], at: Mapping[str, float], faults: set[str]
) -> tuple[tuple[Part, ...], np.ndarray | None]:
    """The parts about a place that a set came to rest at before, and the slopes there, means over blocks; None where
    they are beyond all numbers."""
    paths = tuple(dict.fromkeys([*bench.base, *(p for k in keys for p in bench.candidates[k].paths)]))
    values = {p: at.get(p, bench.start[p]) for p in paths}
    prediction, raw = bench.predict(values), scales.cut.mean(bench.jacobian(values, paths, bench.fitted))
    if not np.isfinite(squared(raw)):
        return scales.about(prediction, bench, keys, at), None
    own = np.array([p not in faults for p in paths])
    return scales.about(prediction, bench, keys, values, raw[:, own], faults=raw[:, ~own]), raw


def climb(
    linear: Linear, parts, widths: Widths, blocked, v, begin: frozenset[str], course: Course
) -> tuple[np.ndarray, Marginal]:
    """`amplitudes` from where all is wide that may be ("wide"), from `v` ("there"), or the better of both.

    Where the climb from `v` ends on a slope (amplitudes of another fit, far too small beside this one), the other is
    tried too: along a slope the mass over the amplitudes means nothing. A part that is empty, as that of effects is
    where none acts, stays at nothing.
    """
    acting = np.array([p.factor is None or bool(np.any(p.factor)) for p in parts])

    def at_widest(start: np.ndarray) -> tuple[np.ndarray, Marginal]:
        wide = amplitudes(linear, parts, widths.widest, blocked, acting * start, tolerance=course.settled)[0]
        return amplitudes(linear, parts, widths, blocked, wide)

    tried = [at_widest(v)] if "wide" in begin else []
    if "there" in begin:
        tried.append(amplitudes(linear, parts, widths, blocked, acting * v))
    if "wide" not in begin and uphill(*tried[0], widths) > course.steep:
        tried.append(at_widest(widths.width**2))
    return max(tried, key=lambda t: t[1].value + float(np.sum(widths.log_shape(t[0] / widths.width**2))))


def _impossible(scales: Scales, keys: Sequence[str]) -> Weighed:
    """A set whose model can't be predicted anywhere near."""
    names = tuple(dict.fromkeys(scales.bench.candidates[k].name for k in keys))
    n = len(scales.cut.starts)
    low = SetEvidence(
        tuple(keys), names, -math.inf, -math.inf, 0.0, 0.0, {}, 0, (), True, math.inf, n, 0.0, 0.0, (0.0, 0.0)
    )
    none = np.full(len(scales.bench.y), np.nan)
    fit = Refit(tuple(keys), {}, {}, {}, (), math.inf, n, math.inf, 0, False, none)
    return Weighed(low, fit, np.zeros(len(scales.families)), (), np.zeros(n))


def _described(scales: Scales, keys: Sequence[str], best: Round, criteria: Criteria) -> Weighed:
    fit, v, residual, parts, bench = best.fit, best.v, best.residual, best.parts, best.bench
    smoothed, scatter = rest(scales, parts, v, residual, scales.widened(keys))
    left, open_still = beyond(scales, best.linear, smoothed, scatter)
    chi2 = float(np.sum((residual / scales.blocked.sigma) ** 2))
    before = scales.cut.mean(bench.y - scales.bench.predict(scales.values)) / scales.blocked.sigma
    n = len(residual)
    base = max(float(before @ before) - n, 1e-9)
    whitened = Whitening(bench, scales.cut, scales.blocked, parts, v).residual(fit.prediction, bench.fitted)
    at_bound = tuple(p for p, b in zip(best.descent.paths, best.bound, strict=True) if b)
    idle = tuple(
        k
        for k in keys
        if _resting(bench.candidates[k], fit, bench, at_bound, v, scales.families)
        or _idle(bench.candidates[k], fit, bench, scales.peak, best.felt)
    )
    precision = best.m.precision
    own = 0.5 * float(np.linalg.slogdet(precision)[1]) if len(precision) else 0.0
    # what is left of the evidence when the parameters' width is taken out of it
    density = best.m.value - best.ahead + own
    evidence = SetEvidence(
        keys=tuple(keys),
        names=tuple(dict.fromkeys(bench.candidates[k].name for k in keys)),
        log_evidence=float(best.total),
        fit=float(density),
        parameters=float(best.value - density),
        discrepancy=float(best.occam),
        amplitudes={p.name: math.sqrt(x) for p, x in zip(parts, v, strict=True)},
        k=len(fit.values),
        at_bound=at_bound,
        void=bool(idle),
        chi2=chi2,
        n=n,
        kurtosis=kurtosis(whitened),
        explained=float(np.clip(1 - max(chi2 - n, 0.0) / base, -1.0, 1.0)),
        rest=(float(np.mean(left**2 + open_still)), wobble(left, open_still, criteria.alike)),
        scattered=unlike_noise(scales, parts, v, criteria),
        numerical=numerical(scales, parts, v),
        free=tuple(fit.values),
    )
    size = scales.peak if scales.size is None else scales.size
    return Weighed(evidence, fit, v, parts, left * size, bench, linear=best.linear, idle=idle)


def kurtosis(x: Float[np.ndarray, " n"]) -> float:
    """Fourth moment over the square of the second, less that of a normal distribution; 0 of what doesn't vary."""
    square = (x - np.mean(x)) ** 2
    return float(np.mean(square**2) / np.mean(square) ** 2) - 3.0 if np.any(square) else 0.0


def _resting(c: Candidate, fit: Refit, bench: Bench, at_bound: Sequence[str], v: np.ndarray, families) -> bool:
    """Whether all that a candidate may do is at nothing."""
    if c.widens:
        return not any(x > 0 for f, x in zip(families, v, strict=True) if f in c.widens)
    near = (abs(fit.values[p] - bench.start[p]) <= 1e-6 * bench.free[p].scale for p in c.amplitudes)
    return all(p in at_bound and n for p, n in zip(c.amplitudes, near, strict=True))


def _idle(c: Candidate, fit: Refit, bench: Bench, peak: float, felt: Mapping[str, float]) -> bool:
    """Whether the fit predicts the same without a candidate: it may do something, and does nothing here."""
    if not c.amplitudes:
        return False
    moved = max(felt.get(p, 0.0) * abs(fit.values[p] - bench.start[p]) for p in c.amplitudes)
    if bench.costly and moved > FELT * peak:  # its slope tells without another simulation
        return False
    without = bench.predict({**fit.values, **{p: bench.start[p] for p in c.amplitudes}})
    return bool(np.max(np.abs(without - fit.prediction)) <= NOTHING * peak)

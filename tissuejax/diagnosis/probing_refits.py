"""Refits of a set of effects where every prediction is a simulation: from where, how far, and in which form.

One step on the cheap mesh tells what a candidate promises. A refit to the end goes on from there on the mesh that
counts, with derivatives of the cheap one, and then a set may be given another place to start from, a richer form,
better derivatives, a fresh amplitude; or be asked what it is without one of its effects.
"""

import math
from dataclasses import replace

import numpy as np

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.probing_runs import COARSE, FINE
from tissuejax.diagnosis.quality import quality
from tissuejax.diagnosis.refit import Refit, refit
from tissuejax.diagnosis.score import Score
from tissuejax.diagnosis.search import ALLOWED, Search

MODEST = 2.0  # chi-square per sample above which no simulation is as wrong as that, nor a descent stuck as high
# iterations without one effect; the share of what was missing (fitted, or held out) from which on more is needed
BRIEF, LACKING = 3, 0.25
ASTRAY = 4.0  # times its start: the least by which a base parameter has gone astray
ELSEWHERE = 0.5  # of the best place's gain: the least for an inclusion to be tried under another site


def step(s: Search, parent: Refit, score: Score) -> Refit:
    """One step of base, set and a new candidate together, with derivatives at the parent's fit."""
    bench, candidate, names = s.bench, s.bench.candidates[score.key], s.bench.fitted
    old = bench.jacobian(parent.values, tuple(parent.values), names)
    new = bench.columns(parent.values, [(score.setting, a) for a in candidate.amplitudes])
    still = np.zeros((len(bench.y), len(candidate.shapes)))  # shapes mean nothing at zero amplitude
    seed = s.misfit.whiten(np.concatenate([old, new, still], axis=1), names)
    start = {**parent.values, **score.setting}
    # what the cheap mesh has wrong at the parent is taken off, or whatever takes up that error would be preferred
    coarse = bench.runs.many([(bench.at(parent.values), names, COARSE)])[0]
    bench.kind, bench.shift = COARSE, np.where(bench.mask(names), parent.prediction - coarse, 0.0)
    try:
        return refit(bench, s.misfit, (*parent.keys, score.key), start, iterations=1, final=False, seed=seed)
    finally:
        bench.kind, bench.shift = FINE, None


def finish(s: Search, keys: tuple[str, ...], start: Refit, iterations: int | None = None, exact: bool = False) -> Refit:
    """A refit to the end (or so many iterations), from where a trial or another form came to."""
    values = {**start.values, **start.own}
    iterations = iterations or s.budget.iterations
    return refit(s.bench, s.misfit, keys, values, iterations=iterations, tolerance=s.budget.tolerance, exact=exact)


def under_another_site(s: Search, parent: Refit, score: Score, found: Refit) -> Refit:
    """The fit of an inclusion, also begun under another site if the held-out recordings ask for it.

    Soft under one site and stiff under the other look alike from these two; what the probe meets elsewhere tells.
    """
    if found.chi2 > ALLOWED * found.n or not found.held > ALLOWED * found.n_held:
        return found
    place = [p for p in ("effects.inclusion.x", "effects.inclusion.y") if p in score.setting]
    for gained, _, setting in score.settings:
        if gained > ELSEWHERE * score.gain and any(setting[p] != score.setting[p] for p in place):
            trial = step(s, parent, replace(score, setting=setting))
            s.report(f"{' + '.join(trial.keys)} under another site")
            return min(found, finish(s, trial.keys, trial), key=s.criterion)
    return found


def richer(s: Search, at: frozenset) -> frozenset:
    """The set with each effect in a richer form, as long as something is left that it explains."""
    for _ in range(3):
        parent = s.refits[at]
        if quality(s, parent).noise:
            return at
        for old in parent.keys:
            for new in s.bench.candidates[old].beside:
                keys = at - {old} | {new}
                more = len(s.bench.candidates[new].paths) > len(s.bench.candidates[old].paths)
                if more and keys not in s.refits:
                    s.report(" + ".join(new if k == old else k for k in parent.keys))
                    start = replace(parent, values=spread(s.bench, parent.values, new))
                    s.refits[keys] = finish(s, tuple(new if k == old else k for k in parent.keys), start)
        forms = [k for k in s.refits if s.names(k) == s.names(at)]
        best = min(forms, key=lambda k: s.criterion(s.refits[k]))
        if best == at:
            return at
        at = best
    return at


def spread(bench: Bench, values: dict[str, float], form: str) -> dict[str, float]:
    """Values for a richer form: those common to all recordings for each of them, and from elsewhere if need be."""
    out = dict(values)
    for path in (*bench.candidates[form].paths, *bench.candidates[form].held):
        common = ".".join(path.split(".")[:3])
        if path not in out and common != path and common in values:
            out[path] = values[common]
    fresh = {p: bench.start[p] for p in bench.candidates[form].paths if p not in out}
    other = next(iter(bench.elsewhere(out | fresh)), {})
    return out | dict(other) if fresh.keys() & other.keys() else out


def polished(s: Search, at: frozenset) -> frozenset:
    """The set fitted on with derivatives of the mesh that counts, if little is left that it may yet explain.

    Those of the cheap mesh lead into a valley and not along it: a probe set aside trades with the stiffness, and a
    hundredth of chi-square decides whether the next site is met.
    """
    r = s.refits[at]
    if r.chi2 < MODEST * r.n and not quality(s, r).noise:
        s.report(f"{' + '.join(r.keys)}, by the finer mesh alone")
        s.bench.slopes = FINE
        try:
            s.refits[at] = min(r, finish(s, r.keys, r, exact=True), key=s.criterion)
        finally:
            s.bench.slopes = COARSE
    return at


def released(s: Search, at: frozenset) -> frozenset:
    """The set refitted with every amplitude that rests on its upper bound begun again from its usual size.

    A friction that nothing slides against has no slope, and what was missing when it ran there has a name now.
    """
    r, free = s.refits[at], s.bench.free
    amplitudes = {p for k in r.keys for p in s.bench.candidates[k].amplitudes}
    away = {p: free[p].scale for p in amplitudes.intersection(r.at_bound) if r.values[p] >= free[p].upper}
    if away:
        s.report(f"{' + '.join(r.keys)}, from within")
        again = finish(s, r.keys, replace(r, values={**r.values, **away}))
        s.refits[at] = min(r, again, key=s.criterion)
    return at


def astray(s: Search, r: Refit) -> Refit:
    """r, or the same set begun from where the base began, if the base had gone far astray for want of an effect and
    little is explained: a tissue of no stiffness at rest on a base that holds is no place to find one that slips from.
    """
    bench = s.bench
    far = any(abs(math.log(r.values[p] / bench.start[p])) > math.log(ASTRAY) for p in bench.base if bench.free[p].log)
    if r.chi2 < MODEST * r.n or not far:
        return r
    s.report(f"{' + '.join(r.keys)}, with the base from its start")
    again = finish(s, r.keys, replace(r, values={**r.values, **{p: bench.start[p] for p in bench.base}}))
    return min(r, again, key=s.criterion)


def leave_out(s: Search, at: frozenset) -> None:
    """Refits of a set without each of its effects, so that none stays that was only a stepping stone.

    They begin where the set came to rest, so a few iterations tell whether the rest can do without an effect at all.
    """
    parent = s.refits[at]
    far = parent.chi2 + LACKING * (s.empty.chi2 - parent.chi2)
    for key in parent.keys:
        smaller = at - {key}
        if smaller not in s.refits:
            order = tuple(k for k in parent.keys if k != key)
            s.report(" + ".join(order))
            brief = finish(s, order, parent, BRIEF)
            s.refits[smaller] = brief if brief.converged or brief.chi2 > far else finish(s, order, brief)

"""The search where every prediction is a simulation: score, try one step, refit those that keep their promise.

A linear score ranks by what a small change would do; far from the truth (an inclusion five times as stiff) it ranks
poorly. So the best few candidates take one real step on the cheap mesh, from the derivatives that the score has
computed already, at the price of one or two predictions each. Only those whose step did about as well as the best one
are refitted to the end, on the mesh that counts.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tissuejax.diagnosis.misfit import white
from tissuejax.diagnosis.probing import ProbingBench
from tissuejax.diagnosis.probing_numerics import numerics
from tissuejax.diagnosis.probing_refits import (
    LACKING,
    MODEST,
    astray,
    finish,
    leave_out,
    polished,
    released,
    richer,
    step,
    under_another_site,
)
from tissuejax.diagnosis.probing_runs import COARSE, FINE
from tissuejax.diagnosis.quality import quality, veiled
from tissuejax.diagnosis.refit import Refit, refit
from tissuejax.diagnosis.score import Score, gain, trusted
from tissuejax.diagnosis.search import Budget, Search
from tissuejax.errors import NotConverged

BUDGET = Budget(most=2, beam=(1, 1), nominees=(3, 2), share=0.03, starts=1, iterations=8, tolerance=20.0)
TRIED = 5  # candidates that take a step
PROMISING = 0.1  # of the best score: the least for a step
RIVALS = 0.3  # of the best step's gain: the least for a refit; a step from far off tells little
SETTLED, NEARLY = 0.03, 1.3  # share of the base's excess, and chi-square per sample, that a found effect may leave
CLOSE = 0.85  # the same, once one refit leaves nothing but noise
OUTSIDE = 3.0  # times the misfit of the fitted recordings: from there on the held-out ones are asked what they lack
# share of the held-out misfit that own values must take up, and that a leading set must explain; of the best score,
# the least for a name to be heard although its step did not do well
MOSTLY = 0.5


def search_probing(bench: ProbingBench, budget: Budget, report: Callable[[str], None] = lambda _: None) -> Search:
    """Fit the base, then add effects one at a time, as long as something is left; see the module's text.

    Raises:
        NotConverged: the base model can't be simulated at its start.
    """
    s = Search(bench, white(bench), budget, report=report)
    report("base model")
    bench.kind = COARSE  # most of the way on the cheap mesh
    near = refit(bench, s.misfit, (), {}, iterations=2 * budget.iterations, tolerance=budget.tolerance, final=False)
    bench.kind = FINE
    first = refit(bench, s.misfit, (), near.values, iterations=budget.iterations, tolerance=budget.tolerance)
    if not math.isfinite(first.chi2):  # what the cheap mesh bears may be unstable on the fine one: from the start again
        first = refit(bench, s.misfit, (), {}, iterations=2 * budget.iterations, tolerance=budget.tolerance)
    if not math.isfinite(first.chi2):
        raise NotConverged(
            f"the base model can't be simulated for {', '.join(bench.fitted)}: name another --energy, or look at the "
            "mesh and the path of the probe with `tissuejax inspect`"
        )
    s.refits[frozenset()] = first
    report("numerical error")
    bench.numerics[frozenset()] = numerics(bench, s.misfit, first)
    at = frozenset()
    for size in range(budget.most):
        parent = s.refits[at]
        report(f"scores beside {' + '.join(parent.keys) or 'the base'} (chi-square {parent.chi2 / parent.n:.3g})")
        s.score(at)
        calm = quality(s, parent).noise or (not at and bench.numerics[at].enough(first))
        if calm and not veiled(s, parent):
            break
        grown = grow(s, at, budget.nominees[min(size, len(budget.nominees) - 1)])
        if not grown:
            break
        best = richer(s, leading(s, at, grown))
        if s.criterion(s.refits[best]) >= s.criterion(parent):
            break
        best = polished(s, best)
        if len(best) > 1:
            best = released(s, best)
            leave_out(s, best)
        at = best
        if explained(s, s.refits[best]):
            return s
    if len(at) > 1:
        begin_with_the_second(s, at, budget.nominees[-1])
    return s


def begin_with_the_second(s: Search, at: frozenset, most: int) -> None:
    """The first effect of a pair was chosen while the second was missing, and may have stood in for both.

    So what leaves something is begun again from its second effect alone.
    """
    keys = s.refits[at].keys
    second = at - {keys[0]}
    grown = []
    if second in s.refits and math.isfinite(s.refits[second].chi2):
        s.report(f"scores beside {keys[1]}, without {keys[0]}")
        s.score(second)
        grown = grow(s, second, most)
    best = min([at, *grown], key=lambda k: s.criterion(s.refits[k]))
    if best != at:
        best = released(s, polished(s, richer(s, best)))
        leave_out(s, best)
        explained(s, s.refits[best])  # what its simulation has wrong must not speak against it


def explained(s: Search, r: Refit) -> bool:
    """Whether what r leaves is noise, too little to look further, or no more than its own simulation has wrong.

    An effect may call for a finer simulation than the base did: a support that hardly holds lags behind at ten times
    the speed of life, and a lag of the clocks would take that up.
    """
    if quality(s, r).noise:
        return True
    if r.chi2 > MODEST * r.n:
        return settled(s, r)
    s.report(f"numerical error beside {' + '.join(r.keys)}")
    found = s.bench.numerics[frozenset(r.keys)] = numerics(s.bench, s.misfit, r)
    return settled(s, r) or found.enough(r)


def settled(s: Search, r: Refit) -> bool:
    """Whether what is left is as small as the numerical error of what was found: a further effect would take that up.

    The scores beside an effect cost as much as all before them, and no set is believed for so small a share. Unless the
    held-out recordings ask for more: what hardly shows under two sites may be most of what a third one feels.
    """
    left, whole = r.chi2 - (r.n - r.k), s.empty.chi2 - (s.empty.n - s.empty.k)
    missed = r.held - r.n_held > LACKING * (s.empty.held - s.empty.n_held) and r.held > NEARLY * r.n_held
    return left < SETTLED * whole and r.chi2 / r.n < NEARLY and not missed


def leading(s: Search, at: frozenset, grown: list[frozenset]) -> frozenset:
    """The set to go on with: the smallest criterion, or the best on the fitted recordings where none explains the rest.

    What a second effect does to the held-out recordings must not choose the first.
    """
    parent, best = s.refits[at], min(grown, key=lambda k: s.criterion(s.refits[k]))
    lost = parent.held - parent.n_held
    if s.refits[best].held - parent.n_held < (1 - MOSTLY) * lost or lost < parent.n_held:
        return best
    return min(grown, key=lambda k: s.fitted(s.refits[k]))


def asked_outside(s: Search, at: frozenset) -> list[str]:
    """Candidates whose own values the held-out recordings ask for, what explains most first.

    Two probes set alike too low pass for a softer body, and only a third, set otherwise, shows it.
    """
    parent, bench, names = s.refits[at], s.bench, s.bench.held_out
    if not names or parent.held / parent.n_held < OUTSIDE * max(parent.chi2 / parent.n, 1.0):
        return []
    r, found = s.misfit.residual(parent.prediction, names), []
    for key, c in bench.candidates.items():
        if not c.held or c.shapes or c.name in s.names(at):
            continue
        columns = s.misfit.whiten(bench.jacobian(parent.values, c.held, names), names)
        low, high = np.array([trusted(bench.free[p]) for p in c.held]).T - [bench.start[p] for p in c.held]
        taken, _ = gain(r, columns, np.minimum(low, 0.0), np.maximum(high, 0.0))
        if taken > MOSTLY * (parent.held - parent.n_held):
            found.append((taken, key))
    return [key for _, key in sorted(found, reverse=True)]


def grow(s: Search, at: frozenset, most: int) -> list[frozenset]:
    """The set with one effect more, for the few effects that explain most; refitted."""
    parent, trials, nominated = s.refits[at], [], nominees(s, at)
    for score in nominated:
        s.report(f"one step: {' + '.join([*parent.keys, score.key])}")
        trial = step(s, parent, score)
        if math.isfinite(trial.chi2):
            trials.append((trial.chi2, score.key, trial, score))
    trials.sort(key=lambda t: t[0])
    whole = parent.chi2
    grown: list[frozenset] = []
    for key in asked_outside(s, at):
        if at | {key} in s.refits:
            continue
        s.report(f"{' + '.join([*parent.keys, key])}, which the held-out recordings ask for")
        s.refits[at | {key}] = finish(s, (*parent.keys, key), parent)
        grown.append(at | {key})
    most += len(grown)
    for chi2, key, trial, score in trials:
        own = any(s.bench.candidates[c].held for k in grown for c in k - at)
        if len(grown) >= most + own:  # they mimic much that is common to all: one rival more is heard
            break
        if at | {key} in s.refits or s.names(at | {key}) in [s.names(k) for k in grown]:
            continue  # forms of one effect are compared in `richer`
        calm = [k for k in grown if quality(s, s.refits[k]).noise or settled(s, s.refits[k])]
        enough = any(not s.bench.candidates[c].held for k in calm for c in k - at)
        if whole - chi2 < (CLOSE if enough else RIVALS) * (whole - trials[0][0]):
            break
        s.report(" + ".join(trial.keys))
        keys = at | {key}
        done = s.refits[keys] = under_another_site(s, parent, score, finish(s, trial.keys, trial))
        s.report(f"{' + '.join(trial.keys)}: chi-square {done.chi2 / done.n:.3g}")
        grown.append(keys)
    grown = grown + favourite(s, at, nominated, grown)
    if grown and not at:
        best = min(grown, key=lambda k: s.criterion(s.refits[k]))
        s.refits[best] = astray(s, s.refits[best])
    return grown


def favourite(s: Search, at: frozenset, nominated: list[Score], grown: list[frozenset]) -> list[frozenset]:
    """The set with the candidate of the best score, refitted although its one step did not do well, if nothing else
    explains the rest: in steps as long as the simulation bears them.

    The step may have led too far (a support nearly free), or the cheap mesh may not bear it (a probe set aside by less
    than one of its elements). Beside a found effect, where a right second one should leave nothing, the next name whose
    score is nearly as good is heard, too; and where only values of their own in every recording explain the rest, since
    they mimic much, one that is common to all.
    """
    calm = [k for k in grown if quality(s, s.refits[k]).noise or settled(s, s.refits[k])]
    if not nominated or any(not s.bench.candidates[c].held for k in calm for c in k - at):
        return []
    parent, known = s.refits[at], [s.names(k) for k in grown]
    heard = [n for n in nominated if n.gain > MOSTLY * nominated[0].gain] if at or calm else nominated[:1]
    heard = [n for n in heard if not (calm and s.bench.candidates[n.key].held)]
    best = next((n for n in heard if s.names(at | {n.key}) not in known and at | {n.key} not in s.refits), None)
    if best is None:
        return []
    keys = at | {best.key}
    s.report(f"{' + '.join([*parent.keys, best.key])}, in shorter steps")
    start = replace(parent, values={**parent.values, **best.setting})
    done = s.refits[keys] = finish(s, (*parent.keys, best.key), start)
    if calm:
        polished(s, keys)  # offsets fit at once what a place finds at the end of a long valley
    mimic = s.bench.candidates[best.key].held and (quality(s, done).noise or settled(s, done))
    return [keys, *(favourite(s, at, nominated, [*grown, keys]) if mimic else [])]


def nominees(s: Search, at: frozenset) -> list[Score]:
    """What may explain enough for its number of parameters, best first, two forms of an effect at most."""
    parent, price = s.refits[at], math.log(max(s.misfit.effective(s.bench.fitted), 3.0))
    best = max((score.gain for score in s.score(at)), default=0.0)
    least = max(s.budget.share * max(parent.chi2 - parent.n, 0.0), PROMISING * best)
    out, count = [], {}
    for score in s.score(at):
        c = s.bench.candidates[score.key]
        if score.gain < max(least, price * len(c.paths)) or count.get(c.name, 0) >= 2:
            continue
        count[c.name] = count.get(c.name, 0) + 1
        out.append(score)
    return out[:TRIED]

"""The search: score, refit every nominee, extend the best few sets, drop what is no longer needed.

Greedy forward selection fails where two effects mask each other, so a beam of the best sets is kept at every size,
every one scored anew at its own fit. A set reached once is never refitted. The noise is estimated anew from the
best fit so far, since correlation can only be seen once the smooth mismatch is gone, and then all is compared
under that one noise. In the end every effect of the best set is left out once, so that none stays that was only a
stepping stone (`neighbours`). What may be spent is counted and grows with the size of the sets, so that pairs can't use
up what sets of three need; a search that has found nothing but noise left stops before.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.misfit import Misfit, estimated, white
from tissuejax.diagnosis.neighbours import leave_out, reshape
from tissuejax.diagnosis.plausible import doubts, on_limit
from tissuejax.diagnosis.quality import quality
from tissuejax.diagnosis.refit import Refit, refit
from tissuejax.diagnosis.score import Score, scores
from tissuejax.diagnosis.starts import distinct, inside
from tissuejax.errors import NotConverged

LEAST = 2  # sets finished at each size, whatever they cost
ELSEWHERE = 2  # other places to start from that are followed to the end
PURSUED = 3  # sets whose other forms are tried with what is left in the end, where none has left noise only
ALLOWED = 1.5  # chi-square per sample up to which a fit explains its recordings


@dataclass(frozen=True)
class Budget:
    """How much a search may spend.

    Attributes:
        most: effects in a set at most.
        beam: sets extended at each size, by size.
        nominees: effects refitted at each extension of one set, by size.
        share: least share of the excess that a nominee's linear step must explain.
        starts: settings of the shapes tried in a refit.
        iterations: of a refit.
        tolerance: of a refit, in units of chi-square.
        finished: nominees refitted to the end at each size; the rest are dropped after a few steps.
        promise: share of the excess that the best pair must explain for a third effect to be sought.
        patience: cost up to which nominees beyond `finished` are refitted to the end too, by size, as long as none
            leaves noise only: a few steps say little of a set whose shapes have far to go. Up to the first of these
            costs all forms beside a set are.
        spend: cost of all predictions so far, in those of the base model, after which nothing more is tried at a size
            (`Bench.spent`), other forms halfway to the next; the last for leaving effects out in the end. 5.5e4 are
            about a minute of one processor.
        burden: searches and memories nested in a prediction at most (`Bench.burden`): three take a second a prediction.
    """

    most: int = 3
    beam: tuple[int, ...] = (1, 4, 2)
    nominees: tuple[int, ...] = (9, 4, 7)
    share: float = 0.02
    starts: int = 2
    iterations: int = 30
    tolerance: float = 0.1
    finished: tuple[int, ...] = (6, 4, 3)
    promise: float = 0.6
    patience: tuple[float, ...] = (5e3, 1.5e4, 2.5e4)
    spend: tuple[float, ...] = (2.5e4, 4e4, 5e4, 5.5e4)
    burden: int = 2


@dataclass
class Search:
    """All that a search has seen.

    Attributes:
        refits: by set of keys.
        scored: scores at each set that was extended.
        misfit: noise under which the refits are compared.
        size: effects in the sets that are being extended; a half more while other forms of them are tried.
        dropped: sets that were given a few steps and left.
    """

    bench: Bench
    misfit: Misfit
    budget: Budget
    refits: dict[frozenset, Refit] = field(default_factory=dict)
    scored: dict[frozenset, list[Score]] = field(default_factory=dict)
    report: Callable[[str], None] = lambda _: None
    size: float = 0
    dropped: set[frozenset] = field(default_factory=set)
    _doubts: dict[frozenset, tuple[Refit, tuple[str, ...]]] = field(default_factory=dict)

    def refit(self, keys: Sequence[str], start: Mapping[str, float], **options) -> Refit:
        """A refit under the present noise (`refit.refit`)."""
        return refit(self.bench, self.misfit, keys, start, **options)

    def doubts(self, keys: frozenset) -> tuple[str, ...]:
        """What speaks against the names in a set, whatever it explains; see `plausible`."""
        known = self._doubts.get(keys)
        if known is None or known[0] is not self.refits[keys]:
            known = self._doubts[keys] = (self.refits[keys], doubts(self.bench, self.misfit, self.refits[keys]))
        return known[1]

    @property
    def exhausted(self) -> bool:
        """Whether what the search may spend is spent: between two sizes, what lies between the two."""
        spend = self.budget.spend
        return not self.bench.dear and self.bench.spent > np.interp(self.size, range(len(spend)), spend)

    @property
    def patient(self) -> bool:
        """Whether sets that a few steps don't put first are refitted to the end too; see `Budget.patience`."""
        patience = self.budget.patience[min(math.ceil(self.size), len(self.budget.patience) - 1)]
        return not self.bench.dear and self.bench.spent < patience and not quality(self, self.best).noise

    @property
    def early(self) -> bool:
        """Whether so little has been spent that a few steps need not decide which forms are refitted to the end."""
        return not self.bench.dear and self.bench.spent < self.budget.patience[0]

    @property
    def best(self) -> Refit:
        """The fit of smallest criterion among those that have earned their names."""
        return min((r for k, r in self.refits.items() if not self.doubts(k)), key=self.criterion)

    @property
    def empty(self) -> Refit:
        """The fit of the base model alone."""
        return self.refits[frozenset()]

    def inside(self, r: Refit) -> float:
        """What r's parameters cost: Schwarz's k log n, n the number of independent samples that were fitted."""
        return r.k * math.log(max(self.misfit.effective(self.bench.fitted), 3.0))

    def fitted(self, r: Refit) -> float:
        """Schwarz's criterion: what the fitted recordings say of r."""
        return (r.chi2 if self.bench.dear else surprise(r.chi2, r.n)) + self.inside(r)

    def outside(self, r: Refit) -> float:
        """Surprise of the held-out recordings, and the price of what they have for themselves."""
        held = r.held if self.bench.dear else surprise(r.held, r.n_held)
        return held + len(r.own) * math.log(max(self.misfit.effective(self.bench.held_out), 3.0))

    def criterion(self, r: Refit) -> float:
        """Surprise of the fitted recordings + penalty + surprise of the held-out ones: the smaller the better.

        The first two are Schwarz's criterion; the third is minus twice the log predictive density of recordings that
        took no part in the fit, up to a constant, so the sum is one evidence-like number.
        """
        return self.fitted(r) + self.outside(r)

    def names(self, keys: frozenset) -> frozenset:
        """Effects in a set, whatever their form."""
        return frozenset(self.bench.candidates[k].name for k in keys)

    def score(self, keys: frozenset) -> list[Score]:
        """Scores of everything that may be added to the set, at its own fit."""
        if keys not in self.scored:
            at, names = self.refits[keys], self.names(keys)
            left = [
                c
                for c in self.bench.candidates.values()
                if c.name not in names and c.nominated and self.bench.burden((*keys, c.key)) <= self.budget.burden
            ]
            self.scored[keys] = scores(self.bench, self.misfit, at.values, tuple(at.values), left)
        return self.scored[keys]

    def nominees(self, keys: frozenset, most: int) -> list[Score]:
        """The best forms of the effects that promise most for their parameters."""
        parent = self.refits[keys]
        price = math.log(max(self.misfit.effective(self.bench.fitted), 3.0))
        least = self.budget.share * (parent.chi2 - parent.n)
        worth = {
            s.key: s.gain - price * len(self.bench.candidates[s.key].paths) for s in self.score(keys) if s.gain > least
        }
        out, count = [], {}
        for s in sorted(self.score(keys), key=lambda s: -worth.get(s.key, -math.inf)):
            name = self.bench.candidates[s.key].name
            if worth.get(s.key, -1.0) <= 0 or (name not in count and len(count) >= most):
                continue
            if self.bench.burden((*keys, s.key)) > self.budget.burden:
                continue
            if count.get(name, 0) >= (1 if keys and not self.bench.dear else 2):  # the other forms are tried beside it
                continue
            count[name] = count.get(name, 0) + 1
            out.append(s)
        return out

    def extensions(self, parents: list[frozenset], most: int) -> list[tuple[frozenset, Score]]:
        """Nominees of several sets, best first of each in turn, no company of effects twice."""
        lists = [[(keys, score) for score in self.nominees(keys, most)] for keys in parents]
        out, seen = [], set()
        for row in itertools.zip_longest(*lists):
            for keys, score in filter(None, row):
                company = self.names(keys | {score.key})
                if len(parents) == 1 or company not in seen:
                    out.append((keys, score))
                seen.add(company)
        return out

    def extend(self, extensions: list[tuple[frozenset, Score]], most: int) -> list[frozenset]:
        """Refits of sets with one candidate more, from its most promising settings; remembered.

        All are given a few steps, and the `most` of smallest criterion in the fitted recordings are finished, as
        long as there is something to spend; the others too where none of them explains and little has been spent.
        """
        grown, begun = [], {}
        for keys, score in extensions:
            key = keys | {score.key}
            if key in self.refits:
                grown.append(key)
                continue
            parent = self.refits[keys]
            candidate = self.bench.candidates[score.key]
            starts = [
                {**parent.values, **setting, **inside(self.bench, candidate, step, setting, parent.values)}
                for _, step, setting in distinct(score, self.budget.starts, whole=not keys and not self.bench.dear)
            ]
            order = (*parent.keys, score.key)
            if self.exhausted:
                break
            self.report(" + ".join(order))
            if self.bench.dear:
                self.refits[key] = self.finished(order, starts)
                grown.append(key)
            else:
                begun.setdefault(key, self.begun(order, starts))
        for rank, (key, r) in enumerate(sorted(begun.items(), key=lambda kr: self.fitted(kr[1]))):
            if len(grown) >= LEAST and self.exhausted:
                break
            if rank >= most and not self.patient:
                break
            self.refits[key] = self.finished(r.keys, [r.values])
            grown.append(key)
        return grown

    def begun(self, keys: tuple[str, ...], starts: list[Mapping[str, float]], held: bool = False) -> Refit:
        """The best of several starts after a few iterations, without errors; with held-out recordings if `held`."""
        options = {"iterations": 5, "final": held, "errors": False}
        return min((self.refit(keys, s, **options) for s in starts), key=lambda t: t.chi2)

    def finished(self, keys: tuple[str, ...], starts: list[Mapping[str, float]]) -> Refit:
        """The best of several starts, each given a few iterations before the winner is finished."""
        if len(starts) > 1:
            starts = [self.begun(keys, starts).values]
        options = {"iterations": self.budget.iterations, "tolerance": self.budget.tolerance}
        found = self.refit(keys, starts[0], **options)
        # the fitted recordings explained and the held-out ones not: the former may allow other values as well
        if self.bench.dear or found.chi2 > ALLOWED * found.n or found.held <= ALLOWED * found.n_held:
            return found
        if any(self.fitted(r) < self.fitted(found) for k, r in self.refits.items() if len(k) <= len(keys)):
            return found  # another set explains them better: it is followed first
        others = [{**found.values, **other} for other in self.bench.elsewhere(found.values)]
        begun = [] if self.exhausted else [self.begun(keys, [other], held=True) for other in others]
        for again in sorted(begun, key=self.criterion)[:ELSEWHERE]:
            if found.held > ALLOWED * found.n_held:
                found = min(found, self.refit(keys, again.values, **options), key=self.criterion)
        return found

    def again(self, keys: frozenset) -> Refit:
        """Refit of a set under the present noise, from where it was."""
        old = self.refits[keys]
        self.refits[keys] = self.refit(old.keys, old.values, iterations=self.budget.iterations)
        return self.refits[keys]


def search(
    bench: Bench,
    budget: Budget | None = None,
    report: Callable[[str], None] | None = None,
) -> Search:
    """Fit the base, then grow sets of candidates as the budget allows; see the module's text."""
    budget = budget or Budget()
    s = Search(bench, white(bench), budget, report=report or (lambda _: None))
    s.report("base model")
    first = s.refit((), {}, iterations=2 * budget.iterations, tolerance=budget.tolerance, final=bench.dear)
    if not math.isfinite(first.chi2):
        raise NotConverged(
            f"the base model can't be fitted to {', '.join(bench.fitted)}: its prediction is not finite there from any "
            "parameters tried; name another --energy, or leave out the samples of largest strain"
        )
    if not bench.dear:
        s.misfit = estimated(bench, bench.predict(first.values))
        first = s.refit((), first.values, iterations=2 * budget.iterations)
    s.refits[frozenset()] = first
    if bench.dear and quality(s, first).noise:
        s.score(frozenset())
        return s
    short = False
    for size in range(budget.most):
        s.size = size
        at = [k for k in best_of_each(s) if len(k) == size][: budget.beam[min(size, len(budget.beam) - 1)]]
        most = budget.nominees[min(size, len(budget.nominees) - 1)]
        grown = s.extend(s.extensions(at, most), budget.finished[min(size, len(budget.finished) - 1)])
        short |= s.exhausted
        if not grown:
            break
        if size == 0 and not bench.dear:
            renew_noise(s)
        s.size = size + 0.5  # beyond what the extensions may spend, before what the next ones may
        for keys in promising(s, 1 if bench.dear else (4, 2, 1)[min(size, 2)]):
            reshape(s, keys)
        short |= s.exhausted
        best = s.best
        left = (best.chi2 - best.n) / max(s.empty.chi2 - s.empty.n, 1.0)
        if (
            len(best.keys) <= size
            or quality(s, best).noise
            or (size > 0 and not bench.dear and left > 1 - budget.promise)
        ):
            break
    if not bench.dear:
        s.size = budget.most
        leave_out(s)
        for keys in promising(s, PURSUED):
            if not quality(s, s.best).noise:
                reshape(s, keys)
        if short or s.exhausted:
            bench.warnings.append(
                "the search ended when its budget was spent: larger sets of effects were not all tried"
            )
    return s


def surprise(chi2: float, n: int) -> float:
    """Minus twice the log-likelihood of n whitened residuals, up to a constant, for a misfit of unknown size.

    n (log v + s / v) with s = chi2 / n at its best v >= 1: chi-square where only noise is left, n (1 + log s) where
    something else is. A model that is known to be wrong by tens of standard deviations says little by the difference
    of two chi-squares, and in a recording that it can't predict at all next to nothing.
    """
    s = chi2 / n if n else 0.0
    return chi2 if s <= 1 else n * (1 + math.log(s))


def best_of_each(s: Search) -> list[frozenset]:
    """The best form of every set of effects that has earned its names, best first."""
    out: dict[frozenset, frozenset] = {}
    for keys in sorted((k for k in s.refits if not s.doubts(k)), key=lambda k: s.criterion(s.refits[k])):
        out.setdefault(s.names(keys), keys)
    return list(out.values())


def promising(s: Search, most: int) -> list[frozenset]:
    """Sets whose effects are tried in other forms: the best `most`, and any better one in which an exponent ran away.

    Fibres that stiffen without end are not believed; they may be crimped, which is the form beside.
    """
    kept = best_of_each(s)[:most]
    if s.bench.dear or not kept:
        return kept
    names = [s.names(k) for k in kept]
    worst = max(s.criterion(s.refits[k]) for k in kept)
    astray = [r for k, r in s.refits.items() if s.names(k) not in names and on_limit(s.bench, r)]
    best = sorted((r for r in astray if s.criterion(r) < worst), key=s.criterion)[:1]
    return kept + [frozenset(r.keys) for r in best]


def renew_noise(s: Search) -> None:
    """Estimate the noise again from the best fit so far; if it has changed, refit everything under it."""
    now = estimated(s.bench, s.best.prediction)
    if now.differs(s.misfit):
        s.misfit = now
        s.scored.clear()
        for keys in list(s.refits):
            s.again(keys)

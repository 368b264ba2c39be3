"""Which sets of effects are weighed: nominated by the evidence of one linear step, grown, reshaped, and pruned.

At the fit of a set every candidate's linear step is scored (`nominate`). The best are weighed in full (`weigh`). Sets
of two grow from the best single ones, sets of three from the best pairs, the best sets are tried in all their forms and
with every effect left out, and what other sets near the top hold with one effect less is weighed where it never was.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Course, Effort
from tissuejax.diagnosis.judgement.evidence import Evidence
from tissuejax.diagnosis.judgement.judge import Beforehand
from tissuejax.diagnosis.judgement.kept import Kept
from tissuejax.diagnosis.judgement.nominate import nominated
from tissuejax.diagnosis.judgement.scales import Scales
from tissuejax.diagnosis.judgement.sudden import beside, happened, held, joined
from tissuejax.diagnosis.judgement.weigh import Start, Weighed
from tissuejax.diagnosis.score import Score
from tissuejax.diagnosis.starts import distinct, inside


@dataclass
class Exploration:
    """All that was weighed.

    Attributes:
        bench: all recordings fitted.
        weighed: by set of keys.
        scored: linear scores at each set that was extended.
        kept: where sets are kept for a search that is begun again.
        noise_of: the set whose residual the noise was read from; None for the base.
        until: what may have been spent on predictions when a set is begun (`Effort.spend` for every search).
    """

    bench: Bench
    criteria: Criteria
    effort: Effort
    scales: Scales
    report: Callable[[str], None] = lambda _: None
    weighed: dict[frozenset, Weighed] = field(default_factory=dict)
    scored: dict[frozenset, list[Score]] = field(default_factory=dict)
    exhausted: bool = False
    kept: Kept = field(default_factory=Kept)
    noise_of: Weighed | None = None
    until: float = math.inf

    @cached_property
    def before(self) -> Beforehand:
        """What is held for probable before the recordings are seen."""
        return Beforehand.of(self.bench.forms, self.bench.faults, self.criteria)

    def worth(self, key: frozenset) -> float:
        """Log posterior of a weighed set, up to a constant: by all of its evidence, not the power that `judge` takes.

        What is tried next follows from what describes the data best; how sure that makes of a name is another question.
        """
        return self.log_worth(self.weighed[key])

    def log_worth(self, w: Weighed) -> float:
        """The same of a set that need not be remembered."""
        e = w.evidence
        if e.void or not math.isfinite(e.log_evidence):
            return -math.inf
        return e.log_evidence + self.before.log_prior(e)

    def names(self, key: frozenset) -> frozenset:
        """Effects in a set, whatever their form."""
        return frozenset(self.bench.candidates[k].name for k in key)

    def company(self, key: frozenset) -> frozenset:
        """The same, but a form that only widens the discrepancy apart from the others of its effect."""
        known = self.bench.candidates
        return frozenset(k if known[k].widens else known[k].name for k in key)

    def ranked(self, size: int, apart: bool = False) -> list[frozenset]:
        """The best form of every set of `size` effects, best first.

        Args:
            apart: the best with and the best without what only widens the discrepancy, where a set has both.
        """
        found: dict[frozenset, frozenset] = {}
        for key in sorted((k for k in self.weighed if len(k) == size), key=self.worth)[::-1]:
            if self.worth(key) > -math.inf:
                wide = frozenset(k for k in key if apart and self.bench.candidates[k].widens)
                found.setdefault(self.names(key) | wide, key)
        return list(found.values())

    def near(self, size: int, apart: bool = False, below: float | None = None) -> list[frozenset]:
        """Those of `ranked` that other forms may bring to the top, `below` it by so many nats (`Effort.hopeful`)."""
        least = self.worth(self.best) - (self.effort.hopeful if below is None else below)
        return [k for k in self.ranked(size, apart) if self.worth(k) > least]

    def parents(self, size: int) -> list[frozenset]:
        """Sets to grow: those near the top; all of `ranked` as long as the best one leaves more than is usual.

        A law that is anything smooth takes up what a second effect does, beside one of a few terms it stands out.
        """
        return self.ranked(size, apart=True) if self.strange else self.near(size, apart=True)

    @property
    def strange(self) -> bool:
        """Whether the best set leaves a lasting part of the discrepancy that is likelier something unknown.

        What happened at once is described by when it happened: no form of an effect is missing for it.
        """
        best, scales = self.weighed[self.best], self.scales
        return bool(np.any(scales.priors(self.criteria, best.evidence.keys).wider(best.v) & scales.lasting))

    @property
    def best(self) -> frozenset:
        """The most probable of all sets of known effects."""
        return max(self.weighed, key=self.worth)

    def evidence(self, fitted: tuple[str, ...], held_out: tuple[str, ...]) -> Evidence:
        """All of it as plain numbers."""
        sets = tuple(w.evidence for w in self.weighed.values())
        bench = self.bench
        return Evidence(sets, bench.forms, fitted, held_out, self.exhausted, bench.costly, bench.faults)

    def weigh(
        self,
        order: Sequence[str],
        starts: Sequence[Mapping[str, float]],
        bench: Bench | None = None,
        v: Float[np.ndarray, " K"] | None = None,
    ) -> Weighed | None:
        """Weigh a set from the best of several starts; remembered. None if there is nothing left to spend.

        Args:
            bench, v: see `Start`; a set that was weighed before is weighed again where `v` is given.
        """
        key, effort = frozenset(order), self.effort
        if key in self.weighed and v is None:
            return self.weighed[key]
        if order and self.bench.spent > self.until:
            self.exhausted = True
            return None
        self.tell("weighing", order)
        floor = self.weighed[self.best].evidence.log_evidence - effort.given_up
        course = replace(self.effort.course, floor=floor, anchor=not self.bench.costly)
        begin = [Start(s, v, bench) for s in starts]
        found = self._descended(order, begin, course)
        if (inside := self._inside(order, found)) is not None:
            added = [self.bench.candidates[k] for k in order if k not in inside.evidence.keys]
            idle = {a: self.bench.start[a] for c in added for a in c.amplitudes}
            within = Start({**begin[0].values, **inside.refit.values, **idle}, inside.v, inside.bench)
            again = self.kept.follow(self.scales, order, within, self.criteria, course)
            found = max(found, again, key=lambda w: w.evidence.log_evidence)
        old = self.weighed.get(key)
        if old is None or found.evidence.log_evidence > old.evidence.log_evidence:
            self.weighed[key] = found
        if found.evidence.log_evidence > self.weighed[self.best].evidence.log_evidence:
            # an effect rests at nothing, so the set can't be given: without it it is the best one
            for fewer in (key - {k} for k in found.idle):
                if fewer and fewer not in self.weighed:
                    self.weigh([k for k in order if k in fewer], [found.refit.values], found.bench, found.v)
        return self.weighed[key]

    def _descended(self, order: Sequence[str], begin: Sequence[Start], course: Course) -> Weighed:
        """The best of several starts: each is tried for a round, and what has come near the best of them is followed,
        each place once; the best alone where that ends far below the best set, or predictions are costly."""
        if len(begin) == 1:
            return self.kept.weigh(self.scales, order, begin[0], self.criteria, course)
        short = replace(self.effort.course, rounds=1, iterations=self.effort.trial)
        tried = [(self.kept.weigh(self.scales, order, s, self.criteria, short), s) for s in begin]
        tried.sort(key=lambda t: -t[0].evidence.log_evidence)
        there = [w.evidence.log_evidence for w, _ in tried]
        ends = [] if self.bench.costly else [w for w, _ in tried]
        for i, (w, s) in enumerate(tried[:1] if self.bench.costly else tried):
            known = any(x - there[i] < course.settled for x in there[:i])  # the same place again
            hopeless = i and ends[-1].evidence.log_evidence < course.floor
            if i and (known or hopeless or there[0] - there[i] > self.effort.hopeful):
                continue
            start = Start(w.refit.values, w.v if s.v is None else s.v, s.bench) if w.refit.values else s
            ends.append(self.kept.weigh(self.scales, order, start, self.criteria, course))
        return max(ends, key=lambda w: w.evidence.log_evidence)

    def _inside(self, order: Sequence[str], found: Weighed) -> Weighed | None:
        """The best set with one effect less where this one came to rest far below it, though it has that one's fit in
        itself: its descent ended elsewhere. None of what is far from the best set anyway."""
        key, sets = frozenset(order), self.weighed
        less = [sets[key - {k}] for k in order if key - {k} in sets]
        if not less or self.bench.costly:
            return None
        inside = max(less, key=lambda w: w.evidence.log_evidence)
        there = inside.evidence.log_evidence
        astray = found.evidence.log_evidence < there - self.effort.hopeful
        return inside if astray and there > sets[self.best].evidence.log_evidence - self.effort.given_up else None

    def score(self, key: frozenset) -> list[Score]:
        """Every candidate that may join the set, by the log evidence that its linear step gains, best first."""
        if key not in self.scored:
            self.tell("trying every effect beside", sorted(self.names(key)))
            names = self.names(key)
            left = [
                c
                for c in self.bench.candidates.values()
                if c.name not in names
                and c.nominated
                and c.amplitudes
                and self.bench.nested((*key, c.key)) <= self.effort.nested
            ]
            self.scored[key] = nominated(self.bench, self.scales, self.weighed[key], left, self.criteria, self.before)
        return self.scored[key]

    def extend(self, parents: Sequence[frozenset], most: int, each: int) -> None:
        """Weigh sets with one effect more: the best nominees of every parent in turn."""
        lists = []
        for key in parents:
            free = [c for c in self.bench.candidates.values() if c.widens and c.name not in self.names(key)]
            seen = {c.key: [Score(c.key, math.inf, 0.0, {}, {}, np.zeros(0), ((0.0, {}, {}),))] for c in free}
            for s in self.score(key):
                if s.gain < (0.0 if key and self.bench.costly else self.effort.least):
                    break
                seen.setdefault(self.bench.candidates[s.key].name, []).append(s)
            more = len(free) if self.bench.costly else 0
            lists.append([(key, rows[0]) for rows in itertools.islice(seen.values(), each + more)])
        tried = {self.company(k) for k in self.weighed}
        for row in itertools.zip_longest(*lists):
            for key, score in filter(None, row):
                company = self.company(key | {score.key})
                if most <= 0 or company in tried:
                    continue
                if self.bench.costly and self._behind(key, score):
                    continue
                tried.add(company)
                # what only widens the discrepancy has no slopes that cost simulations
                cheap = self.bench.costly and self.bench.candidates[score.key].widens
                if self._grown(key, score) is not None and not cheap:
                    most -= 1

    def _behind(self, key: frozenset, score: Score) -> bool:
        """Whether a set would stay behind the best one though it gained a multiple of what its linear step promises."""
        reach = self.worth(key) + self.effort.promised * max(score.gain, 0.0)
        return reach < self.worth(self.best) - self.effort.hopeful

    def _grown(self, key: frozenset, score: Score) -> Weighed | None:
        parent, candidate = self.weighed[key], self.bench.candidates[score.key]
        short = self.effort.short if not key and self.effort.starts > 1 else 0
        starts = [
            {**parent.refit.values, **setting, **inside(self.bench, candidate, step, setting, parent.refit.values)}
            for _, step, setting in distinct(score, self.effort.starts, self.effort.worthwhile, short)
        ]
        alone = self._alone(key, score.key)
        # beside a discrepancy that has taken up the misfit a step from nothing is short: a gap, say, is far from where
        # it leads, and another form of the effect promises more
        starts += [alone[score.key]] if score.key in alone else []
        found = self.weigh((*parent.evidence.keys, score.key), starts, bench=parent.bench)
        for form in [k for k in alone if k != score.key]:
            self.weigh((*parent.evidence.keys, form), [alone[form]], bench=parent.bench)
        return found

    def _alone(self, key: frozenset, form: str) -> dict[str, dict[str, float]]:
        """Starts of a set that grows from `key` by this form, and by that form of the effect that was best alone: the
        parameters that they had there, beside those of `key`."""
        if not key or self.bench.costly:
            return {}
        name, at = self.bench.candidates[form].name, self.weighed[key].refit.values
        singles = {next(iter(k)): w for k, w in self.weighed.items() if len(k) == 1 and self.names(k) == {name}}
        wanted = {form, max(singles, key=lambda k: self.worth(frozenset({k})))} if singles else {form}
        return {
            k: {**at, **{p: x for p, x in singles[k].refit.values.items() if p not in at}}
            for k in wanted & set(singles)
            if not self.bench.candidates[k].widens
        }

    def reshape(self, key: frozenset) -> None:
        """Weigh a set in the other forms of its effects, from form to neighbouring form as long as that gains."""
        at = None
        while at != (at := max((k for k in self.weighed if self.same(k, key)), key=self.worth)):
            parent = self.weighed[at]
            for old in parent.evidence.keys:
                for new in self.bench.candidates[old].beside:
                    order = tuple(new if k == old else k for k in parent.evidence.keys)
                    known = frozenset(order) in self.weighed or self.bench.nested(order) > self.effort.nested
                    if known or (len(order) > 1 and self.lost(new)):
                        continue
                    starts = [{**parent.refit.values, **s} for s in self.bench.candidates[new].grid]
                    most = self.effort.starts + (len(order) == 1)
                    self.weigh(order, starts[:most], bench=parent.bench)

    def lost(self, form: str) -> bool:
        """Whether a form, weighed alone, was far behind another form of its effect."""
        alone = {k: self.worth(k) for k in self.weighed if len(k) == 1 and self.same(k, frozenset({form}))}
        own = alone.get(frozenset({form}))
        return own is not None and own < max(alone.values()) - self.effort.hopeful

    def same(self, a: frozenset, b: frozenset) -> bool:
        """Whether two sets hold the same effects."""
        return self.names(a) == self.names(b) and len(a) == len(b)

    def settle(self, size: int) -> None:
        """Weigh the sets near the top anew with predictions that are exact at their fits, where those were corrected.

        Sets are tried with the correction of the set they grew from; what is judged has its own.
        """
        while left := [k for k in self.near(size) if not self.weighed[k].settled]:
            w = self.weighed[left[0]]
            self.tell("settling", w.evidence.keys)
            again = self._settled(w, at := w.refit.values, w.v)
            if again.evidence.log_evidence == -math.inf:  # the fine simulation breaks down there
                again = self._settled(w, {**at, **{p: self.scales.values[p] for p in self.bench.base}})
            self.weighed[left[0]] = again

    def _settled(self, w: Weighed, values: Mapping[str, float], v: Float[np.ndarray, " K"] | None = None) -> Weighed:
        start = Start(values, v, w.bench)
        return self.kept.weigh(self.scales, w.evidence.keys, start, self.criteria, self.effort.course)

    def look_again(self) -> None:
        """Weigh the best sets and the base anew beside what may have happened at once by the best of them."""
        while (happening := happened(self.scales, self.weighed[self.best], self.criteria)) is not None:
            before, moment = self.scales, happening.moment
            self.tell("looking at what happened at once beside", sorted(self.names(self.best)))
            best = sorted(self.weighed, key=self.worth)[: -self.effort.again - 1 : -1]
            self.scales = joined(before, moment)
            for key, w in self.weighed.items():
                self.weighed[key] = beside(w, moment)
                if key in best or not key:
                    again = self._settled(w, w.refit.values, happening.start(before, w, self.criteria))
                    if again.evidence.log_evidence > w.evidence.log_evidence:
                        self.weighed[key] = again
            if not held(self.weighed[self.best], moment):
                break

    def tell(self, stage: str, order: Sequence[str]) -> None:
        """Report what is done now, and the best so far."""
        best = " + ".join(sorted(self.names(self.best))) if self.weighed else ""
        self.report(f"{stage} {' + '.join(order) or 'base model'}; best so far: {best or 'base model'}")

    def leave_out(self, key: frozenset) -> None:
        """Weigh the set without each of its effects, from where it came to rest."""
        parent = self.weighed[key]
        for k in parent.evidence.keys if len(key) > 1 or self.bench.costly else ():
            order = tuple(x for x in parent.evidence.keys if x != k)
            self.weigh(order, [parent.refit.values], v=parent.v, bench=parent.bench)

    def look_inside(self, key: frozenset) -> None:
        """Weigh what a set holds with one effect less, where that was never tried: an effect that a linear step ranks
        low may have come in as the third, beside one that had its place."""
        parent = self.weighed[key]
        for k in parent.evidence.keys if not self.bench.costly else ():
            order = tuple(x for x in parent.evidence.keys if x != k)
            if self.company(frozenset(order)) not in {self.company(w) for w in self.weighed}:
                self.weigh(order, [parent.refit.values], bench=parent.bench)

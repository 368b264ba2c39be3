"""A judgement in the terms of a diagnosis: what the page shows, and what is said of recordings held out.

All recordings choose the set, those called held out too: they are measurements like the others. What is reported of a
recording held out is another thing: the base and the set that was chosen are fitted to the other recordings alone,
nothing at all is fitted to it, and its error is that of the prediction.
"""

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.judgement.blocks import Blocks
from tissuejax.diagnosis.judgement.carried import carried
from tissuejax.diagnosis.judgement.evidence import Evidence
from tissuejax.diagnosis.judgement.explore import Exploration
from tissuejax.diagnosis.judgement.judge import Judgement, Kind, judge, undecided
from tissuejax.diagnosis.judgement.rest import level
from tissuejax.diagnosis.judgement.search import Setup, explore
from tissuejax.diagnosis.judgement.twins import merged
from tissuejax.diagnosis.judgement.whitening import Whitening
from tissuejax.diagnosis.misfit import Misfit, white
from tissuejax.diagnosis.refit import Refit, anchored, refit
from tissuejax.diagnosis.score import Score
from tissuejax.estimation.discrepancy import Discrepancy


@dataclass
class Answered:
    """A judged sample, with the fits that its page shows.

    Attributes:
        fitting: fitted and held-out recordings as the user named them; `bench` is the same in SI units.
        exploration: all that was weighed.
        judgement: the answer.
        refits: by set of keys, fitted to the fitted recordings alone.
        rest: what the chosen set leaves at each block, Pa.
    """

    fitting: Bench
    exploration: Exploration
    evidence: Evidence
    judgement: Judgement
    refits: dict[frozenset, Refit] = field(default_factory=dict)
    whitenings: dict[frozenset, Whitening] = field(default_factory=dict)
    plain: dict[frozenset, Refit] = field(default_factory=dict)

    @property
    def bench(self) -> Bench:
        """What pages show: measurements in SI units, candidates, warnings."""
        return self.fitting.shown

    @property
    def kind(self) -> Kind:
        """The verdict; it compares and prints as its text."""
        return self.judgement.kind

    @property
    def confidence(self) -> float:
        """Its probability."""
        return self.judgement.confidence

    @property
    def empty(self) -> Refit:
        """The base model alone, least squares."""
        return self.refits[frozenset()]

    @property
    def chosen(self) -> Refit:
        """The fit that stands, or the best attempt."""
        return self.refits[frozenset(self.judgement.chosen.keys)]

    @property
    def rivals(self) -> tuple[Refit, ...]:
        """What a further recording would have to decide between, beside the chosen set; see `open_sets`."""
        return tuple(self.refits[frozenset(k)] for k in open_sets(self.judgement, self.exploration))

    @property
    def misfit(self) -> Misfit:
        """White noise as stated; what is correlated is the discrepancy's."""
        return white(self.bench)

    @property
    def scored(self) -> dict[frozenset, list[Score]]:
        """Linear scores at each set that was extended."""
        return self.exploration.scored

    def names(self, keys: frozenset) -> frozenset:
        """Effects in a set, whatever their form."""
        return self.exploration.names(keys)

    @property
    def explained(self) -> tuple[float, float]:
        """Share of the base's misfit that the chosen set removes, fitted and held out.

        Of the misfit beyond noise, each series over what nobody asks of a model: its noise, or `Criteria.negligible`
        of its range where that is more. Over the noise alone one quiet recording would count for all.
        """
        bench = self.bench
        inside, outside = (
            [self._beyond(f, names) for f in (self.empty, self.chosen)] for names in (bench.fitted, bench.held_out)
        )
        return _share(*inside), _share(*outside)

    def _beyond(self, fit: Refit, recordings: Sequence[str]) -> float:
        bench, total = self.bench, 0.0
        for s in bench.segments:
            if s.recording in recordings:
                noise = bench.sigma[s.rows] ** 2
                unseen = (self.exploration.criteria.negligible * np.ptp(bench.y[s.rows])) ** 2
                missed = (bench.y - fit.prediction)[s.rows] ** 2
                total += float(np.sum((missed - noise) / np.maximum(noise, unseen)))
        return total

    def rest(self) -> dict:
        """What the chosen model leaves beyond noise: `rms`, Pa, of the discrepancy's posterior mean; shares; typical
        amplitudes of its `parts`, and of those that are the business of an effect that is `named`; where something
        happened `at_once` (recording, s, amplitude; the largest first)."""
        s, e = self.judgement.chosen, self.exploration
        named = e.scales.widened(s.keys)
        w = e.weighed[frozenset(s.keys)]
        peak, blocks = e.scales.peak, e.scales.cut.counts
        squares = {}
        for i, segment in enumerate(self.bench.segments):
            rows = e.scales.blocked.rows[i]
            squares[segment.recording] = squares.get(segment.recording, 0.0) + float(
                np.sum(w.rest[rows] ** 2 * blocks[rows])
            )
        whole = sum(squares.values())
        of = e.scales.discrepancy
        moments = of.sudden if isinstance(of, Discrepancy) and of.timed is not None else ()
        at_once = [
            {"recording": of.timed.names[m.recording], "time": m.time, "amplitude": s.amplitudes[m.name]}
            for m in moments
            if s.amplitudes.get(m.name, 0.0) > 0
        ]
        return {
            "rms": float(np.sqrt(whole / np.sum(blocks))),
            "unit": self.bench.segments[0].unit if self.bench is self.fitting else "1",
            "share_of_peak": float(np.sqrt(whole / np.sum(blocks))) / peak,
            "negligible": self.judgement.negligible,
            "recordings": {n: x / whole if whole else 0.0 for n, x in squares.items()},
            "parts": {p.name: s.amplitudes[p.name] for p in w.parts if p.family not in named},
            "named": {p.name: s.amplitudes[p.name] for p in w.parts if p.family in named},
            "at_once": sorted(at_once, key=lambda m: -m["amplitude"]),
            "kurtosis": s.kurtosis,
        }

    @property
    def noise_level(self) -> float:
        """What scatters from sample to sample beside the chosen set, over the stated noise."""
        w = self.exploration.weighed[frozenset(self.judgement.chosen.keys)]
        return level(self.exploration.scales, w.parts, w.v)

    def rest_size(self) -> Float[np.ndarray, " N"]:
        """Root mean square of the rest at every sample, SI: the same share of every channel."""
        n = len(self.fitting.y)
        unit = self.fitting.natural(np.ones(n)) - self.fitting.natural(np.zeros(n))
        return self.rest()["share_of_peak"] * self.exploration.scales.peak * unit


def _share(before: float, after: float) -> float:
    return float(np.clip(1 - max(after, 0.0) / before, 0.0, 1.0)) if before > 0 else 0.0


def answer(
    bench: Bench,
    whole: Bench,
    cut: Blocks,
    of: Discrepancy,
    by: Setup | None = None,
) -> Answered:
    """Weigh sets on all recordings, judge, and fit what is shown to the fitted recordings alone.

    Args:
        bench: with recordings held out; `whole`: the same sample with all of them fitted.
        cut, of: block means of both, and the discrepancy that any model leaves of them.
        by: what the search is done with.
    """
    by = by or Setup()
    with whole.ahead():
        found = explore(whole, cut, of, by)
    evidence = found.evidence(bench.fitted, bench.held_out)
    judgement = judge(evidence, by.criteria)
    shown = copy.copy(bench)
    shown.candidates = {k: replace(c, held=()) for k, c in bench.candidates.items()}
    out = Answered(shown, found, evidence, judgement)
    for k in dict.fromkeys(((), tuple(judgement.chosen.keys), *open_sets(judgement, found))):
        shown_fit(out, k)
    return out


def open_sets(judgement: Judgement, found: Exploration) -> tuple[tuple[str, ...], ...]:
    """The sets that a further recording would have to decide between, beside the chosen one, as many as get a fit of
    their own; where every prediction is a simulation, only if the answer is that they can't be told apart."""
    if found.bench.costly and judgement.kind is not Kind.AMBIGUOUS:
        return ()
    return undecided(judgement, found.criteria)[: found.effort.rivals]


def shown_fit(out: Answered, keys: tuple[str, ...]) -> Refit:
    """The fit of a set to the fitted recordings alone, and its misfit over the stated noise; remembered.

    What is shown of material tests is the model as near as it comes to the recordings, by least squares, as a fit of it
    is: under the whole discrepancy, which is free to be anything smooth, parameters may settle far from there and
    describe the data as well with it. Parts that a name widens belong to the model; they are fitted after the
    parameters, with them, or with them beside all other parts but what laws of effects err by, whichever comes nearest.
    Standard errors are those under the whole discrepancy.
    """
    weighed, scales = out.exploration.weighed[frozenset(keys)], out.exploration.scales
    start = {p: v for p, v in weighed.refit.values.items() if p in out.fitting.free}
    # corrected as the set was weighed: just where it came to rest the fine simulation may break down
    bench = out.fitting.corrected_as(weighed.bench or out.fitting)
    near = bench.anchored(start)
    bench = near if np.all(np.isfinite(near.predict(start))) else bench
    named, effort, twins = scales.widened(keys), out.exploration.effort, out.exploration.criteria.twins
    whitening = Whitening(bench, scales.cut, scales.blocked, weighed.parts, weighed.v, named)
    misfit = whitening if keys else white(bench)

    def with_fewer(found: Refit, again: Callable[[Mapping[str, float]], Refit]) -> Refit:
        for key in () if bench.costly else keys:
            while (fewer := merged(bench.candidates[key], found.values, twins)) is not None:
                out.fitting.candidates = bench.candidates = {**bench.candidates, key: fewer[0]}
                found = again(fewer[1])
        return found

    fit, takes = with_fewer(refit(bench, misfit, keys, start), lambda at: refit(bench, misfit, keys, at)), whitening
    if keys and not bench.costly:
        families = [p.family for p in weighed.parts]
        own, exact = (
            replace(whitening, v=np.where(kept, weighed.v, 0.0), _roots={})
            for kept in ([f in named for f in families], [f != "effect" for f in families])
        )
        ends = []
        # what is of each recording's own reaches no other: the parameters are fitted to all as if it were not there
        shared = ((own, own), (exact, exact)) if named - {"gain"} else ()
        for model, taken in ((white(bench), own), *shared):
            near = nearest(bench, model, keys, (start, fit.values, {}), effort.shown)
            near = with_fewer(near, lambda at, model=model: nearest(bench, model, keys, (at,), effort.shown))
            left = bench.y - near.prediction
            left = (left - carried(taken, left[:, None])[:, 0])[bench.mask(bench.fitted)]
            ends.append((squares(left / bench.sigma[bench.mask(bench.fitted)]), near, taken))
        _, near, takes = min(ends, key=lambda end: end[0])
        fit = replace(refit(bench, misfit, keys, near.values, iterations=0), converged=near.converged)
    _, near = anchored(bench, fit, start, effort.course.shortened)
    fit = near if np.all(np.isfinite(near.prediction)) else fit  # else of the simulation as it was corrected before
    fit = replace(fit, prediction=fit.prediction + carried(takes, (bench.y - fit.prediction)[:, None])[:, 0])
    out.plain[frozenset(keys)], out.whitenings[frozenset(keys)] = fit, whitening
    shown = out.bench
    fit = replace(fit, prediction=bench.natural(fit.prediction))
    z = (shown.y - fit.prediction) / shown.sigma
    inside, outside = shown.mask(shown.fitted), shown.mask(shown.held_out)
    out.refits[frozenset(keys)] = replace(
        fit,
        chi2=squares(z[inside]),
        n=int(np.sum(inside)),
        held=squares(z[outside]),
        n_held=int(np.sum(outside)),
    )
    return out.refits[frozenset(keys)]


def nearest(
    bench: Bench, model: Misfit, keys: tuple[str, ...], starts: Sequence[Mapping[str, float]], steps: int
) -> Refit:
    """The fit by least squares over what the model leaves open, from whichever start ends nearest."""
    ends = [refit(bench, model, keys, s, iterations=steps, final=False) for s in starts]
    return min(ends, key=lambda f: f.chi2 if np.isfinite(f.chi2) else np.inf)


def squares(z: Float[np.ndarray, " n"]) -> float:
    """Sum of squares; infinite where something is not finite."""
    return float(z @ z) if np.all(np.isfinite(z)) else np.inf


def evidence_file(folder: Path) -> Path:
    """Where the evidence of a result lies."""
    return folder / "evidence.json"

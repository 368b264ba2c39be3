"""The course of a search: the base, single effects, pairs and triples, and what may have happened at once.

Every single effect that is likelier than none is tried in all its forms; every effect at all where even the best one
leaves a lasting part of the discrepancy that is likelier something unknown. What happened at once comes in before the
pairs where it describes the recordings better, beside the base, than any single effect does, and at the end beside the
best sets.

How noise is correlated in time is read from the base's residual first. A mismatch that is as quick as the noise hides
it there, so it is read again from what the best set leaves; where that set is likelier under it all sets are weighed
anew, for sets are compared under one noise.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from tissuejax.diagnosis.bench import Bench, Free
from tissuejax.diagnosis.judgement.blocks import Blocks
from tissuejax.diagnosis.judgement.coloured import coloured, shown
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Course, Effort
from tissuejax.diagnosis.judgement.explore import Exploration
from tissuejax.diagnosis.judgement.kept import Kept
from tissuejax.diagnosis.judgement.marginal import Blocked
from tissuejax.diagnosis.judgement.scales import Scales, scaled
from tissuejax.diagnosis.judgement.sudden import disrupted
from tissuejax.diagnosis.judgement.weigh import Start, Weighed
from tissuejax.errors import NotConverged
from tissuejax.estimation.correlation import GAIN
from tissuejax.estimation.discrepancy import Discrepancy


@dataclass(frozen=True)
class Setup:
    """What a search is done with.

    Attributes:
        criteria: the numbers that make a verdict; effort: how much is tried.
        report: told what is done now.
        kept: where sets are kept for a search that is begun again; nowhere by default.
    """

    criteria: Criteria = field(default_factory=Criteria)
    effort: Effort = field(default_factory=Effort)
    report: Callable[[str], None] = lambda _: None
    kept: Kept = field(default_factory=Kept)


def explore(bench: Bench, cut: Blocks, of: Discrepancy, by: Setup) -> Exploration:
    """Weigh the base model and the sets that are worth it; see the module's text.

    Args:
        bench: with all recordings fitted.
        cut: block means of what was measured; of: the discrepancy that any model leaves of them.

    Raises:
        NotConverged: the base model can't be fitted at all.
    """
    by.report("fitting the base model")
    scales, base = based(bench, cut, of, by.criteria, by.kept)
    e = searched(scales.bench, scales, base, by)
    for _ in range(by.effort.readings):
        if (noise := noise_beside(e)) is None:
            break
        best, scales = e.weighed[e.best], replace(scales, blocked=noise)
        base = by.kept.weigh(scales, (), Start(base.refit.values), by.criteria, Course())
        e = searched(scales.bench, scales, base, by)
        e.noise_of = best
    e.look_again()
    return e


def noise_beside(e: Exploration) -> Blocked | None:
    """The noise that the best set's residual shows, where that set is the likelier for it by as much as correlated
    noise has to beat white; None where there is no set, or nothing to gain."""
    best, old = e.weighed[e.best], e.scales.blocked
    if not e.best or e.bench.costly:
        return None
    e.tell("reading the noise again beside", best.evidence.keys)
    noise = shown(old, e.bench, e.scales.cut, best.refit.prediction)
    if noise.noise is None and old.noise is None:
        return None
    start = Start(best.begun, best.v, at=best.refit.values)
    again = e.kept.follow(replace(e.scales, blocked=noise), best.evidence.keys, start, e.criteria, e.effort.course)
    return noise if again.evidence.log_evidence - best.evidence.log_evidence > GAIN / 2 else None


def searched(bench: Bench, scales: Scales, base: Weighed, by: Setup) -> Exploration:
    """The sets that are worth it, weighed under the noise of these scales."""
    effort = by.effort
    e = alone(bench, scales, base, by)
    scales, disturbed = disrupted(scales, base, by.criteria)
    if e.log_worth(disturbed) > e.worth(e.best):  # better than any single effect: all of them beside what happened
        e = alone(bench, scales, disturbed, by)
    if bench.costly:  # one start was all that the base had
        e.leave_out(e.best)
    for size, most in ((1, effort.pairs), (2, effort.triples)):
        parents = e.parents(size)[: effort.parents[size - 1]]
        if size >= effort.most or not parents or (size == 2 and len(e.best) < 2 and not e.strange):
            break  # a third effect is sought where a second one has come in, or much is left
        if effort.stepwise and len(e.best) < size:
            break
        e.extend(parents, most, max(most // len(parents), 1) + effort.spare)
        for key in e.near(size + 1)[: effort.reshaped[size]]:
            e.reshape(key)
        e.settle(size + 1)
        e.leave_out(e.best)
        for key in e.near(size + 1, below=effort.given_up):
            e.look_inside(key)
        e.settle(size)
    return e


def based(
    bench: Bench,
    cut: Blocks,
    of: Discrepancy,
    criteria: Criteria,
    kept: Kept,
    start: Start | None = None,
    course: Course | None = None,
) -> tuple[Scales, Weighed]:
    """The base model weighed, and the scales of the sample with the noise that its residual shows.

    Args:
        start: of the base's fit; its neutral values by default. course: how far it is followed.
    """
    start, course = start or Start({p: bench.start[p] for p in bench.base}), course or Course()
    bench = bench.anchored(start.values)
    scales = scaled(bench, cut, of, bench.y, start.values, criteria)
    base = kept.weigh(scales, (), start, criteria, course)
    if not np.isfinite(base.evidence.log_evidence):
        raise NotConverged(
            f"the base model can't be fitted to {', '.join(bench.fitted)}: its prediction is not finite there from any "
            "parameters tried; name another --energy, or leave out the samples of largest strain"
        )
    if (noise := coloured(scales.blocked, bench, cut, base.refit.prediction)) is not None:
        scales.blocked = noise
        base = kept.weigh(scales, (), Start(base.refit.values), criteria, course)
    return scales, base


def rooted(scales: Scales, base: Weighed, free: Mapping[str, Free]) -> None:
    """The scales about the base's fit, where the sizes of effects are taken."""
    scales.values, scales.reference = base.refit.values, scales.cut.mean(base.refit.prediction)
    scales.bench = (base.bench or scales.bench).anchored(base.refit.values).rooted(base.refit.values)
    scales.bench.free = dict(free)  # without the priors of a set


def alone(bench: Bench, scales: Scales, base: Weighed, by: Setup) -> Exploration:
    """An exploration with the base and all single effects weighed."""
    rooted(scales, base, bench.free)
    sets, effort = {frozenset(): base}, by.effort
    until = scales.bench.spent + effort.spend
    e = Exploration(scales.bench, by.criteria, effort, scales, by.report, sets, kept=by.kept, until=until)
    e.extend([frozenset()], effort.singles, effort.singles)
    for key in e.near(1)[: effort.reshaped[0]]:
        e.reshape(key)
    if not bench.costly:
        # a law unlike an effect's plain form leaves that form far behind, where no form near the top leads to it
        for key in e.ranked(1):
            if e.strange or e.worth(key) > e.worth(frozenset()):
                e.reshape(key)
    e.settle(1)
    return e

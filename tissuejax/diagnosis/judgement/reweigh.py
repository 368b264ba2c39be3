"""Sets that a search has found, weighed again under other criteria from where they came to rest: no search.

Parameters and amplitudes of the discrepancy begin where the search left them, so a set costs a few predictions and one
derivative. That says what a number does to the weight of sets; what else a search would have tried says only a search.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.judgement.blocks import Blocks
from tissuejax.diagnosis.judgement.coloured import shown
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Course
from tissuejax.diagnosis.judgement.evidence import Evidence
from tissuejax.diagnosis.judgement.explore import Exploration
from tissuejax.diagnosis.judgement.judge import left
from tissuejax.diagnosis.judgement.kept import Kept
from tissuejax.diagnosis.judgement.search import based, rooted
from tissuejax.diagnosis.judgement.sudden import joined, known_moments
from tissuejax.diagnosis.judgement.weigh import Start, Weighed
from tissuejax.errors import InputError
from tissuejax.estimation.discrepancy import Discrepancy


@dataclass(frozen=True)
class Rested:
    """Where one set came to rest.

    Attributes:
        keys: candidates in the set.
        values: its parameters.
        v: squared amplitudes of the discrepancy.
        begun: values at which it began, by which the priors of its amplitudes go.
    """

    keys: tuple[str, ...]
    values: Mapping[str, float]
    v: tuple[float, ...]
    begun: Mapping[str, float]

    @classmethod
    def of(cls, w: Weighed) -> "Rested":
        """Of a set that was weighed."""
        return cls(w.evidence.keys, dict(w.refit.values), tuple(w.v.tolist()), dict(w.begun))

    @classmethod
    def read(cls, given: Mapping) -> "Rested":
        """From a file."""
        return cls(tuple(given["keys"]), given["values"], tuple(given["v"]), given["begun"])

    def start(self, parts: int | None = None) -> Start:
        """From there; with the amplitudes of the first `parts` alone."""
        return Start(dict(self.begun), np.array(self.v[:parts]), at=dict(self.values))


@dataclass(frozen=True)
class Found:
    """What a finished search leaves to be weighed again, as plain numbers.

    Attributes:
        sets: where sets came to rest, the base first.
        moments: names of what may have happened at once, as they came in.
        held_out: recordings so called.
        noise_of: where the set came to rest whose residual the noise was read from; None for the base.
    """

    sets: tuple[Rested, ...]
    moments: tuple[str, ...] = ()
    held_out: tuple[str, ...] = ()
    noise_of: Rested | None = None

    @classmethod
    def of(cls, e: Exploration, held_out: Sequence[str] = (), near: float = 12.0, most: int = 25) -> "Found":
        """The base and those sets that the criteria may bring to the top.

        Args:
            near: nats of `judge`'s weight below the best up to which sets are kept; most: how many at most.
        """
        c, usable = e.criteria, [w for w in e.weighed.values() if math.isfinite(w.evidence.log_evidence)]
        best = max((w.evidence for w in usable), key=lambda s: s.log_evidence)
        power = c.power(best.n, left(best))
        weight = {w.evidence.keys: power * w.evidence.log_evidence + e.before.log_prior(w.evidence) for w in usable}
        top = max(weight.values())
        ranked = sorted(usable, key=lambda w: -weight[w.evidence.keys])
        kept = [w for w in ranked if w.evidence.keys and weight[w.evidence.keys] > top - near][:most]
        of = e.scales.discrepancy
        moments = tuple(m.name for m in of.sudden) if isinstance(of, Discrepancy) else ()
        noise_of = None if e.noise_of is None else Rested.of(e.noise_of)
        return cls(tuple(Rested.of(w) for w in (e.weighed[frozenset()], *kept)), moments, tuple(held_out), noise_of)

    def as_dict(self) -> dict:
        """For a file."""
        return dataclasses.asdict(self)

    @classmethod
    def read(cls, given: Mapping) -> "Found":
        """From `as_dict`."""
        sets, beside = tuple(Rested.read(s) for s in given["sets"]), given["noise_of"]
        noise_of = None if beside is None else Rested.read(beside)
        return cls(sets, tuple(given["moments"]), tuple(given["held_out"]), noise_of)


def reweighed(
    bench: Bench, cut: Blocks, of: Discrepancy, found: Found, criteria: Criteria, course: Course | None = None
) -> Evidence:
    """The evidence of the sets of `found` under these criteria.

    Args:
        bench: with all recordings fitted; cut, of: as `criteria` have them.
        course: how far each fit is followed from where it was; two rounds by default.

    Raises:
        InputError: a set that this bench does not offer, or moments that are no longer scanned.
    """
    if missing := sorted({k for s in found.sets for k in s.keys} - set(bench.candidates)):
        raise InputError(f"{', '.join(missing)}: not offered for these recordings now; search again")
    course = course or Course(rounds=2)
    base, *others = found.sets
    # what happened at once comes in last: it begins beside the base with all else
    start = base.start(len(base.v) - len(found.moments))
    scales, _ = based(bench, cut, of, criteria, Kept(), start, course)
    if found.noise_of is not None:
        scales.blocked = shown(scales.blocked, scales.bench, cut, scales.bench.predict(found.noise_of.values))
    known = known_moments(of) if found.moments else {}
    for name in found.moments:
        if name not in known:
            raise InputError(f"{name}: no longer one of the moments that are scanned; search again")
        scales = joined(scales, known[name])
    kept = Kept()
    first = kept.follow(scales, base.keys, base.start(), criteria, course)
    rooted(scales, first, bench.free)
    sets = [first.evidence]
    sets += [kept.follow(scales, s.keys, s.start(), criteria, course).evidence for s in others]
    fitted = tuple(n for n in bench.fitted if n not in found.held_out)
    return Evidence(tuple(sets), bench.forms, fitted, found.held_out, faults=bench.faults)

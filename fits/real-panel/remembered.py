"""Searches of one sample by many numbers, in which no set is weighed twice: most numbers change which sets are tried,
and not what a set weighs."""

from collections.abc import Sequence
from dataclasses import replace

from tissuejax.cache.key import described
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Course
from tissuejax.diagnosis.judgement.kept import Kept
from tissuejax.diagnosis.judgement.particular import SHOWN
from tissuejax.diagnosis.judgement.scales import Scales
from tissuejax.diagnosis.judgement.weigh import Start, Weighed, weigh


class Remembered(Kept):
    """What was weighed, by all that `weigh` depends on; with what it cost, which a search is charged again.

    Attributes:
        found: sets and costs by that; taken: how often one was known.
    """

    def __init__(self):
        super().__init__()
        self.found: dict[str, tuple[Weighed, float]] = {}
        self.taken = 0

    def weigh(self, scales: Scales, keys: Sequence[str], start: Start, criteria: Criteria, course: Course) -> Weighed:
        """As `weigh`."""
        bench = scales.bench
        told = described(
            [
                (bench.candidates, bench.free, bench.start, bench.known, bench.sigma, bench.y),
                (scales.cut, scales.blocked, scales.discrepancy, scales.families, scales.moments),
                (scales.values, scales.reference, scales.peak),
                (tuple(keys), dict(start.values), start.v, None if start.at is None else dict(start.at), course),
                replace(criteria, shown=SHOWN),  # what recordings can show decides what is offered, and no weight
            ]
        )
        if told is None:
            raise RuntimeError("a sample of the panel that can't be told in full")
        if told not in self.found:
            before = bench.counted.cost
            self.found[told] = weigh(scales, keys, start, criteria, course), bench.counted.cost - before
        else:
            self.taken += 1
            bench.counted.cost += self.found[told][1]
        return self.found[told][0]

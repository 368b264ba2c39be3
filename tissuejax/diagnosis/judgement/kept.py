"""What a search has weighed so far, on disk: a search that was stopped goes on from there instead of beginning anew.

Of each set that was weighed the parameters and the amplitudes that it came to rest at are kept, in the order in which
the search asked for them. A search that is begun again on the same recordings, with the same settings and the same code
asks in the same order, and takes them up where they were: one prediction and one derivative each, no descent.
"""

import json
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Course
from tissuejax.diagnosis.judgement.scales import Scales
from tissuejax.diagnosis.judgement.weigh import Start, Weighed, weigh
from tissuejax.storage import write_json

NAME = "weighed.json"


class Kept:
    """The sets of one search.

    Attributes:
        path: of the file; None keeps nothing.
        before: how many were there to begin with; taken_up: how many of them were asked for again.
    """

    def __init__(self, folder: Path | None = None, key: str | None = None):
        """Keep in `folder` under `key` (a hash of all that the search depends on); nothing where either is missing."""
        self.path = None if folder is None or key is None else folder / NAME
        self.taken_up = 0
        self._key, self._asked = key, Counter()
        self._sets = self._read()
        self.before = len(self._sets)
        self._write()

    def weigh(self, scales: Scales, keys: Sequence[str], start: Start, criteria: Criteria, course: Course) -> Weighed:
        """As `weigh`; from where the same question came to rest before, if it is known."""
        if self.path is None or scales.bench.costly:  # simulations are kept one by one, by themselves
            return weigh(scales, keys, start, criteria, course)
        name = f"{len(scales.families)} parts: {' + '.join(keys)}"
        self._asked[name] += 1
        name = f"{name} ({self._asked[name]})"
        if (known := self._sets.get(name)) is not None:
            self.taken_up += 1
            rested = replace(start, at=known["values"], v=np.array(known["v"]))
            once = replace(course, rounds=1, iterations=0, floor=-math.inf)
            return weigh(scales, keys, rested, criteria, once)
        found = weigh(scales, keys, start, criteria, course)
        total = found.evidence.log_evidence
        if math.isfinite(total):  # where nothing can be predicted it is soon found out again
            self._sets[name] = {"values": found.refit.values, "v": found.v.tolist(), "log_evidence": total}
            self._write()
        return found

    def follow(self, scales: Scales, keys: Sequence[str], start: Start, criteria: Criteria, course: Course) -> Weighed:
        """A set from a place where one came to rest: the better of what it is there and where it leads from there.

        Parts of the discrepancy move with the prediction: a fit beside those of its start may lead away.
        """
        still = replace(course, rounds=1, iterations=0, floor=-math.inf)
        tried = [self.weigh(scales, keys, start, criteria, c) for c in (still, course)]
        return max(tried, key=lambda w: w.evidence.log_evidence)

    def forget(self) -> None:
        """The search is finished: remove the file, and its folder if nothing else is in it."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)
            if self.path.parent.is_dir() and not any(self.path.parent.iterdir()):
                self.path.parent.rmdir()

    def _read(self) -> dict[str, dict]:
        if self.path is None or not self.path.is_file():
            return {}
        try:
            found = json.loads(self.path.read_text())
            return dict(found["sets"]) if found["key"] == self._key else {}
        except (OSError, ValueError, KeyError, TypeError):  # cut short or another's: begin anew
            return {}

    def _write(self) -> None:
        if self.path is not None:
            write_json(self.path, {"key": self._key, "sets": self._sets})

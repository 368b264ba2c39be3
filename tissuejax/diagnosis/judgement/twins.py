"""Two relaxation times that came out as one: what is shown is the same law with a term less.

A second time that settles on the first adds nothing to the prediction, and neither its share nor the other's has an
error worth the name: only their sum is seen.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

from tissuejax.diagnosis.bench import Candidate

COUNTED = {"two times": "one time", "three times": "two times"}


def merged(candidate: Candidate, values: Mapping[str, float], near: float) -> tuple[Candidate, dict[str, float]] | None:
    """The candidate without the later of two like times, and where to begin with it; None where there are none.

    Args:
        values: the fit, by dotted path; pairs "NAME.g2", "NAME.tau2" of shares and times.
        near: relative difference up to which two times are one (`Criteria.twins`).
    """
    times = [p for p in candidate.paths if p.rpartition(".")[2].startswith("tau") and p in values]
    for i, first in enumerate(times):
        for second in times[i + 1 :]:
            if values[first] > 0 and abs(math.log(values[second] / values[first])) < near:
                shares = [p.replace(".tau", ".g") for p in (first, second)]
                gone = {second, shares[1]}
                start = {p: v for p, v in values.items() if p not in gone}
                start[shares[0]] = values[shares[0]] + values[shares[1]]
                form = candidate.form
                for many, fewer in COUNTED.items():
                    if form.startswith(many):
                        form = form.replace(many, fewer)
                        break
                return (
                    replace(
                        candidate,
                        amplitudes=tuple(p for p in candidate.amplitudes if p not in gone),
                        shapes=tuple(p for p in candidate.shapes if p not in gone),
                        form=form,
                    ),
                    start,
                )
    return None

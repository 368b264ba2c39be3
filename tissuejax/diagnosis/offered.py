"""Which candidates these recordings can speak of: none that its own page calls them blind to.

What a kind of experiment can't show must not be named from it. Aging needs recordings at several times of the session;
a direction needs specimens loaded along several; a clock is needed by all that acts in time (`untimed`).
"""

from collections.abc import Mapping

import numpy as np

from tissuejax.diagnosis.bench import Candidate
from tissuejax.diagnosis.untimed import timed, without_clock
from tissuejax.recordings.recording import Sample

SCATTER = Candidate("specimen-scatter", (), widens={"gain": 0.3})
HYSTERESIS = Candidate("hysteresis", (), widens={"hysteresis": 0.15})


def offered(
    sample: Sample, candidates: Mapping[str, Candidate], names: tuple[str, ...] | None = None
) -> tuple[dict[str, Candidate], list[str]]:
    """Candidates that the sample's recordings can show, and remarks on what was left out.

    Two are added that have no parameters but let a part of the discrepancy be large: a stiffness of each recording's
    own (specimens that differ, or a gain that changed: stress and stretch alone can't tell), and a rate-independent
    hysteresis.

    Args:
        names: effects asked for; all by default.
    """
    kept, remarks = dict(candidates), []
    if not timed(sample):
        kept = without_clock(kept)
        remarks.append("no time was recorded: effects that act in time (relaxation, drift, aging) were not tried")
    recordings = list(sample.recordings.values())
    starts = {float(r.attributes.get("start", 0.0)) for r in recordings}
    if len(starts) < 2 and any(c.name == "aging" for c in kept.values()):
        kept = {k: c for k, c in kept.items() if c.name != "aging"}
        remarks.append(
            "the recordings carry no times of their own in the session (`start`): aging can't be told and was not tried"
        )
    directions = {tuple(np.round(np.asarray(r.attributes.get("direction", (0, 0, 0)), float), 6)) for r in recordings}
    several = len(directions) > 1 or any(r.experiment == "biaxial" for r in recordings)
    if not several and any(c.name == "anisotropy" for c in kept.values()):
        kept = {k: c for k, c in kept.items() if c.name != "anisotropy"}
        remarks.append("all recordings load one direction: anisotropy can't be told and was not tried")
    if len(recordings) > 1 and (names is None or SCATTER.name in names):
        kept[SCATTER.key] = SCATTER
    if names is None or HYSTERESIS.name in names:
        kept[HYSTERESIS.key] = HYSTERESIS
    return kept, remarks

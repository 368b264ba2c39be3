"""Where the refit of a set with one candidate more starts: settings of its shapes, amplitudes from the linear step."""

import math
from collections.abc import Mapping

import numpy as np

from tissuejax.diagnosis.bench import Bench, Candidate
from tissuejax.diagnosis.score import Score


def inside(
    bench: Bench, candidate: Candidate, step: Mapping[str, float], setting: Mapping[str, float], values: Mapping
) -> dict[str, float]:
    """Amplitudes after the linear step, pulled inside their bounds: a step is trusted only so far."""
    out = {}
    for path in candidate.amplitudes:
        free = bench.free[path]
        origin = {**bench.start, **values, **setting}[path]
        low, high = max(free.lower, origin - 30 * free.scale), min(free.upper, origin + 30 * free.scale)
        value = float(np.clip(origin + step[path], low, high))
        if value in (free.lower, free.upper) and math.isfinite(free.upper - free.lower):
            value = 0.9 * value + 0.1 * origin if value != origin else value
        out[path] = value
    return out


def distinct(score: Score, most: int, worthwhile: float, short: int) -> list[tuple[float, dict, dict]]:
    """The best settings whose gains are `worthwhile` beside the best one's; all of a list no longer than `short`.

    A linear step ranks directions of strong fibres badly: those that it sees first shorten and go slack.
    """
    if len(score.settings) <= short:
        return list(score.settings)
    kept = list(score.settings[:1])
    for trial in score.settings[1:]:
        if len(kept) >= most or trial[0] < worthwhile * kept[0][0]:
            break
        kept.append(trial)
    return kept

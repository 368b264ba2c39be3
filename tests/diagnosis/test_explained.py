"""The share of the misfit that a set explains, over what can be seen and not over a noise that no model meets."""

import copy

import numpy as np
import pytest
from spring_bench import Spring, judged, spring

from tissuejax.diagnosis.judgement.effort import Effort


def test_a_recording_of_next_to_no_noise_does_not_count_for_all():
    """Relaxation is named; in one recording a gauge rounds to a thousandth of the range, fifty times its noise."""
    bench: Spring = copy.copy(spring({"relax.g": 0.4, "relax.tau": 1.5}, sigma=0.02))
    quiet = next(s for s in bench.segments if s.recording == "r1")
    step = 1e-3 * np.ptp(bench.y[quiet.rows])
    bench.sigma = bench.sigma.copy()
    bench.sigma[quiet.rows] = step / 50
    bench.y[quiet.rows] = step * np.round(bench.y[quiet.rows] / step)
    found = judged(bench, Effort(most=1, singles=3))
    assert "relax" in found.judgement.names
    shown, fits = found.bench, (found.empty, found.chosen)
    before, after = (
        sum(np.mean(((shown.y - f.prediction)[s.rows] / np.ptp(shown.y[s.rows])) ** 2) for s in shown.segments[:2])
        for f in fits
    )
    assert found.explained[0] == pytest.approx(1 - after / before, abs=0.05)  # as it is seen in the figures
    assert found.explained[1] > 0.95

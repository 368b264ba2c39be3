"""Probings of a small box diagnosed from end to end, as their view is weighed."""

import numpy as np
import pytest

from tests.probing.bench import VALUES, measured, recording, sample
from tissuejax.diagnosis.judgement.answer import Answered, answer
from tissuejax.diagnosis.judgement.search import Setup
from tissuejax.diagnosis.kinds.probings import PROBING
from tissuejax.diagnosis.probing import ProbingBench
from tissuejax.diagnosis.probing_discrepancy import probing_discrepancy
from tissuejax.diagnosis.probing_view import ProbingView, probing_blocks
from tissuejax.energies.catalogue import energy
from tissuejax.recordings.recording import Sample
from tissuejax.report.judged_sentences import PARTS

SETTINGS = {"mesh": "file", "compression": 3.0, "interval": 0.04, "step": 8e-4, "processes": 1}
NAMES = ["contact-offset", "force-drift"]
TWO = sample(recording("a"), recording("b", place=(-0.004, 0.004), depth=2.5e-3))


def diagnosed(**more: float) -> Answered:
    """Two recordings as a slower simulation predicts them, with noise, and the answer to them."""
    law, rng = energy("reduced-polynomial-2"), np.random.default_rng(4)
    fine = ProbingBench.of(TWO, law, ("a", "b"), (), NAMES, **SETTINGS | {"compression": 1.5})
    told = fine.runs._predictor("fine", tuple(more.items())).predict(VALUES | more)
    made = {n: measured(told[n], r, rng) for n, r in TWO.recordings.items()}
    own = ProbingBench.of(
        Sample(TWO.name, made, geometry=TWO.geometry, density=TWO.density), law, ("a", "b"), (), NAMES, **SETTINGS
    )
    whole, shown = ProbingView.of(own), ProbingView.of(own.narrowed(("a",), ("b",), NAMES))
    cut = probing_blocks(whole)
    found = answer(shown, whole, cut, probing_discrepancy(whole, cut), Setup(effort=PROBING))
    found.simulations = own.runs.count
    return found


@pytest.mark.parametrize(
    ("more", "names"),
    [
        ({"effects.force-drift.rate_z": 0.02}, ("force-drift",)),
        pytest.param({}, (), marks=pytest.mark.slow),
    ],
)
def test_a_probing_is_diagnosed_for_few_simulations(more, names):
    found = diagnosed(**more)
    assert found.judgement.names == names
    assert found.simulations < 250
    assert sum(found.judgement.probabilities.values()) == pytest.approx(1.0)
    parts = {p.name.partition(" of ")[0] for w in found.exploration.weighed.values() for p in w.parts}
    assert {"law", "marker", "mesh", "speed", "ringing"} <= parts <= set(PARTS)  # the page has words for each
    assert found.chosen.values["energy.C10"] == pytest.approx(VALUES["energy.C10"], rel=0.2)
    for path, std in found.chosen.std.items():
        true = (VALUES | more).get(path)
        assert true is None or abs(found.chosen.values[path] - true) < 4 * std, path

"""What scatters from sample to sample beside the stated noise: the noise stated wrong, or a rest of its own?"""

import math

import numpy as np
import pytest

from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.evidence import Evidence, SetEvidence
from tissuejax.diagnosis.judgement.judge import Kind, judge
from tissuejax.diagnosis.judgement.rest import told_apart

USUAL = Criteria()


@pytest.mark.parametrize("stated", [0.002, 0.005, 0.02])
def test_noise_and_a_rest_are_told_apart_as_draws_of_both_are(stated):
    """Levels and rests are drawn as often as they are held for probable; of draws that scatter alike those with a rest
    are counted."""
    rng, n = np.random.default_rng(7), 4_000_000
    level = np.exp(rng.normal(0, math.log(USUAL.misstated), n))
    size = USUAL.strange * USUAL.shares["white"]
    rest = np.where(rng.random(n) < USUAL.unknown, np.abs(rng.normal(0, size, n)), 0.0)
    factor = np.hypot(level, rest / stated)
    for f in (1.05, 1.5, 2.0, 3.0, 6.0):
        alike = rest[np.abs(np.log(factor / f)) < 0.02]
        chance, square = told_apart(f, stated, USUAL)
        counted = np.mean(alike > 0)
        assert chance == pytest.approx(counted, abs=4 * math.sqrt(counted * (1 - counted) / len(alike)) + 0.005)
        assert square == pytest.approx(np.mean(alike[alike > 0] ** 2), rel=0.1)


def test_less_than_was_stated_is_no_rest():
    assert told_apart(1.0, 0.01, USUAL) == told_apart(0.5, 0.01, USUAL) == (0.0, 0.0)


@pytest.mark.parametrize(("factor", "kind"), [(2.0, Kind.NOTHING), (3.0, Kind.NOTHING), (12.0, Kind.UNEXPLAINED)])
def test_noise_of_a_level_stated_wrong_lacks_nothing_and_far_more_is_a_rest(factor, kind):
    """Noise of half a per cent of the peak, beside a model that leaves nothing else."""
    chance, square = told_apart(factor, 0.005, USUAL)
    base = SetEvidence(
        keys=(), names=(), log_evidence=0.0, fit=0.0, parameters=0.0, discrepancy=0.0, amplitudes={}, k=2, at_bound=(),
        void=False, chi2=100 * factor**2, n=100, kurtosis=0.0, explained=0.0, rest=(1e-8, 1e-9),
        scattered=(chance, square),
    )  # fmt: skip
    said = judge(Evidence((base,), {"slack": 1}, ("r1",), ()))
    assert said.kind is kind
    # no other set was weighed, so all that is held for probable is the base: it lacks nothing, or has a rest
    assert said.probabilities[kind] == pytest.approx((1 - chance if kind is Kind.NOTHING else chance), abs=1e-6)
    assert base.rest_size == pytest.approx(math.sqrt(1e-8 + chance * square))

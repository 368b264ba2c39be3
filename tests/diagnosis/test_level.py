"""A noise level that was recorded wrong is told from missing physics: its surplus is white."""

from dataclasses import replace

import numpy as np
import pytest
from spring_bench import spring

from tissuejax.diagnosis.decide import decide, worse
from tissuejax.diagnosis.misfit import estimated, white
from tissuejax.diagnosis.refit import refit
from tissuejax.diagnosis.search import search


def stated(truth, factor, **options):
    """A spring whose noise is said to be `factor` times what it is."""
    bench = spring(truth, **options)
    bench.sigma = factor * bench.sigma
    return bench


@pytest.mark.parametrize(
    ("truth", "kind", "names"),
    [({}, "nothing-missing", ()), ({"relax.g": 0.3}, "found", ("relax",))],
    ids=["null", "relaxing"],
)
def test_noise_stated_half_changes_no_verdict_and_is_said(truth, kind, names):
    s = search(stated(truth, 0.5))
    verdict = decide(s)
    assert (verdict.kind, verdict.chosen.keys) == (kind, names)
    (said,) = s.misfit.remarks()
    assert "check the noise level" in said
    assert "2.0 times in r1" in said
    assert verdict.quality.fitted == pytest.approx(1.0, abs=0.1)


def test_noise_stated_double_changes_no_verdict():
    s = search(stated({}, 2.0))
    assert decide(s).kind == "nothing-missing"
    assert all(n.share == 0 for n in s.misfit.noises.values()), "white noise that is too small is still white"
    assert s.misfit.remarks() == []


def test_standard_errors_are_those_of_the_true_noise_whatever_was_stated():
    right, half = (stated({}, f) for f in (1.0, 0.5))
    errors = []
    for bench in (right, half):
        first = refit(bench, estimated(bench, bench.predict({"a": 10.0, "b": 20.0})), (), {})
        errors.append([first.std[p] for p in ("a", "b")])
    np.testing.assert_allclose(errors[1], errors[0], rtol=0.08)


@pytest.mark.parametrize("factor", [1.0, 0.5])
def test_standard_errors_of_refits_are_the_scatter_of_the_values(factor):
    """By the residuals where they exceed what was stated; 60 draws know a scatter to 9 %."""
    values, std = [], []
    for seed in range(60):
        bench = spring({}, seed=0, names=("r1", "r2"), held_out=())
        clean = bench.predict({"a": 10.0, "b": 20.0})
        bench.y = clean + 0.05 * np.random.default_rng(seed).normal(size=len(clean))
        bench.sigma = factor * bench.sigma
        found = refit(bench, white(bench), (), {})
        values.append([found.values[p] for p in ("a", "b")])
        std.append([found.std[p] for p in ("a", "b")])
    np.testing.assert_allclose(np.sqrt(np.mean(np.square(std), axis=0)), np.std(values, axis=0), rtol=0.25)


def test_held_out_recordings_have_their_say():
    """Of two sets that fit alike, the one that predicts the held-out recording worse has the larger criterion, by the
    surprise of its residuals; and one that predicts it worse than the base alone is no answer."""
    s = search(spring({"relax.g": 0.3}))
    base, known = s.empty, s.refits[frozenset({"relax"})]
    n = known.n_held
    twice, thrice = replace(known, held=2.0 * n), replace(known, held=3.0 * n)
    assert s.criterion(thrice) - s.criterion(twice) == pytest.approx(n * np.log(3 / 2))  # n log(chi-square / n)
    assert not worse(s, known)
    assert worse(s, replace(known, held=2.0 * base.held))


def test_a_smooth_mismatch_is_no_wrong_level():
    bench = spring({"relax.g": 0.3, "offset.value": 0.3})
    base = refit(bench, estimated(bench, bench.predict({"a": 10.0, "b": 20.0})), (), {})
    assert base.chi2 > 4 * base.n
    misfit = estimated(bench, base.prediction)
    assert misfit.remarks() == []
    assert all(n.std == pytest.approx(1.0) for n in misfit.noises.values())

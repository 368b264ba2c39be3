"""A noise level that was recorded wrong is told from missing physics: its surplus is white."""

import numpy as np
import pytest
from spring_bench import spring

from tissuejax.diagnosis.decide import decide
from tissuejax.diagnosis.misfit import estimated
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


def test_a_smooth_mismatch_is_no_wrong_level():
    bench = spring({"relax.g": 0.3, "offset.value": 0.3})
    base = refit(bench, estimated(bench, bench.predict({"a": 10.0, "b": 20.0})), (), {})
    assert base.chi2 > 4 * base.n
    misfit = estimated(bench, base.prediction)
    assert misfit.remarks() == []
    assert all(n.std == pytest.approx(1.0) for n in misfit.noises.values())

"""The engine on a spring in closed form: what it must find, and what it must leave unsaid."""

import numpy as np
import pytest
from spring_bench import judged, spring

from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.locate import locate
from tissuejax.diagnosis.misfit import white
from tissuejax.diagnosis.refit import refit
from tissuejax.diagnosis.score import complement, gain, scores

QUICK = Effort(most=2, singles=4, pairs=3, reshaped=(0, 0, 0))


def test_nothing_is_found_in_noise():
    found = judged(spring({}, seed=1), QUICK)
    assert found.kind == "nothing-missing"
    assert found.chosen.values["a"] == pytest.approx(10.0, abs=4 * found.chosen.std["a"])


def test_noise_that_remembers_has_no_name():
    """Correlated noise is a wander in time: a rest, and no effect."""
    assert judged(spring({}, seed=2, rho=0.8), QUICK).judgement.names == ()


def test_one_effect_is_found_with_its_parameters():
    found = judged(spring({"relax.g": 0.2, "relax.tau": 0.6}), QUICK)
    assert (found.kind, found.judgement.names) == ("found", ("relax",))
    for path, true in {"relax.g": 0.2, "relax.tau": 0.6, "a": 10.0, "b": 20.0}.items():
        assert found.chosen.values[path] == pytest.approx(true, abs=4 * found.chosen.std[path])
    assert found.explained[1] > 0.98
    assert found.rest()["unit"] == "N"


def test_what_is_shown_is_counted_over_the_stated_noise_in_and_out_of_the_fit():
    found = judged(spring({"relax.g": 0.2, "relax.tau": 0.6}), QUICK)
    bench, n = found.bench, len(found.bench.segments[0].time)
    assert found.chosen is found.refits[frozenset({"relax"})]
    for fit in (found.empty, found.chosen):
        z = (bench.y - fit.prediction) / 0.05
        assert (fit.n, fit.n_held) == (2 * n, n)
        assert fit.chi2 == pytest.approx(np.sum(z[: 2 * n] ** 2))
        assert fit.held == pytest.approx(np.sum(z[2 * n :] ** 2))
    assert 0.8 < found.chosen.chi2 / found.chosen.n < 1.2 < found.empty.chi2 / found.empty.n


def test_two_effects_are_found_together():
    truth = {"relax.g": 0.15, "relax.tau": 1.0, "wave.s": 0.3, "wave.period": 2.3}
    assert set(judged(spring(truth), QUICK).judgement.names) == {"relax", "wave"}


def test_an_effect_outside_the_catalogue_is_not_given_a_name():
    bench = spring({})
    for s in bench.segments:  # a step of the sensor's zero in the middle of every recording, of another size each
        size = {"r1": 1.0, "r2": -0.6, "r3": 1.4}[s.recording]
        bench.y[s.rows] += size * (s.time > 7.0 + 2.0 * size)
    assert judged(bench, Effort(most=1, singles=4, reshaped=(0, 0, 0))).judgement.names == ()


def test_without_a_held_out_recording_it_still_answers():
    found = judged(spring({"relax.g": 0.2, "relax.tau": 0.6}, names=("r1",), held_out=()), QUICK)
    assert found.judgement.names == ("relax",)


def test_the_score_of_a_column_in_the_span_of_the_base_is_zero(rng):
    base = rng.normal(size=(200, 3))
    q = complement(base)
    column = base @ np.array([1.0, -2.0, 0.5])
    left = column - q @ (q.T @ column)
    assert gain(rng.normal(size=200), left[:, None], np.array([-np.inf]), np.array([np.inf]))[0] < 1e-9


def test_a_one_sided_amplitude_gains_nothing_on_the_wrong_side(rng):
    column = rng.normal(size=(100, 1))
    g, step = gain(-column[:, 0], column, np.array([0.0]), np.array([np.inf]))
    assert g == pytest.approx(0.0, abs=1e-12)
    assert step[0] == pytest.approx(0.0, abs=1e-12)
    assert gain(column[:, 0], column, np.array([0.0]), np.array([np.inf]))[0] == pytest.approx(np.sum(column**2))


def test_the_score_is_the_gain_of_a_linear_refit():
    bench = spring({"offset.value": 0.05})
    misfit = white(bench)
    base = refit(bench, misfit, (), {})
    found = {s.key: s for s in scores(bench, misfit, base.values, tuple(base.values), [bench.candidates["offset"]])}
    full = refit(bench, misfit, ("offset",), base.values, tolerance=1e-6)
    assert found["offset"].gain == pytest.approx(base.chi2 - full.chi2, rel=1e-4)


@pytest.mark.parametrize(("truth", "low", "high"), [({"form.c": 8.0}, 0.9, 1.01), ({"wave.s": 0.4}, -0.01, 0.5)])
def test_what_depends_on_the_drive_alone_is_told_from_what_does_not(truth, low, high):
    bench = spring(truth)
    places = locate(bench, refit(bench, white(bench), (), {}).prediction)
    assert low < next(x for x in places if x.kind == "history").share < high
    assert sum(x.share for x in places if x.kind == "recording") == pytest.approx(1.0)


def test_a_period_is_located():
    bench = spring({"wave.s": 0.3, "wave.period": 2.3})
    period = next(x for x in locate(bench, bench.predict({"a": 10.0, "b": 20.0})) if x.kind == "period")
    assert period.details["period"] == pytest.approx(2.3, rel=0.05)

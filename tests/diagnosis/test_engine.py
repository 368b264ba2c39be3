"""The engine on a spring in closed form: what it must find, and what it must leave unsaid."""

from dataclasses import replace

import numpy as np
import pytest
from spring_bench import spring

from tissuejax.diagnosis.decide import FIELD, decide, sound, stated
from tissuejax.diagnosis.locate import locate
from tissuejax.diagnosis.misfit import white
from tissuejax.diagnosis.refit import refit
from tissuejax.diagnosis.score import complement, gain, scores
from tissuejax.diagnosis.search import search


def names(verdict):
    return tuple(verdict.chosen.keys)


@pytest.mark.parametrize("rho", [0.0, 0.8])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_nothing_is_found_in_noise(seed, rho):
    verdict = decide(search(spring({}, seed=seed, rho=rho)))
    assert verdict.kind == "nothing-missing"
    assert verdict.chosen.values["a"] == pytest.approx(10.0, abs=4 * verdict.chosen.std["a"])


def test_one_effect_is_found_with_its_parameters():
    verdict = decide(search(spring({"relax.g": 0.2, "relax.tau": 0.6})))
    assert (verdict.kind, names(verdict)) == ("found", ("relax",))
    for path, true in {"relax.g": 0.2, "relax.tau": 0.6, "a": 10.0, "b": 20.0}.items():
        assert verdict.chosen.values[path] == pytest.approx(true, abs=4 * verdict.chosen.std[path])
    assert verdict.explained[1] > 0.98


def test_a_weak_effect_under_correlated_noise_is_found():
    verdict = decide(search(spring({"relax.g": 0.08, "relax.tau": 1.0}, rho=0.8)))
    assert (verdict.kind, names(verdict)) == ("found", ("relax",))


def test_two_effects_are_found_together():
    verdict = decide(search(spring({"relax.g": 0.15, "relax.tau": 1.0, "wave.s": 0.15, "wave.period": 2.3})))
    assert verdict.kind == "found"
    assert set(names(verdict)) == {"relax", "wave"}


def test_three_effects_are_found_together():
    truth = {"relax.g": 0.2, "relax.tau": 1.0, "wave.s": 0.2, "wave.period": 2.3, "form.c": 8.0}
    verdict = decide(search(spring(truth)))
    assert (verdict.kind, set(names(verdict))) == ("found", {"relax", "wave", "form"})
    for path, true in truth.items():
        assert verdict.chosen.values[path] == pytest.approx(true, abs=4 * verdict.chosen.std[path])


def test_an_effect_that_is_a_small_share_beside_a_strong_one_is_kept_though_something_else_is_left():
    bench = spring({"offset.value": 8.0, "relax.g": 0.25})
    for s in bench.segments:
        bench.y[s.rows] += 0.05 * np.sin(s.time**1.5)  # a law that isn't ours: as large as the noise
    s = search(bench)
    verdict = decide(s)
    assert set(names(verdict)) == {"offset", "relax"}
    assert not verdict.quality.noise
    gained = s.refits[frozenset({"offset"})].chi2 - verdict.chosen.chi2
    assert gained < 0.02 * s.empty.chi2


def test_confidence_falls_with_what_a_name_leaves_and_rises_with_what_an_abstention_leaves():
    s = search(spring({"relax.g": 0.2, "relax.tau": 0.6}))
    chosen, before = s.refits[frozenset({"relax"})], (1e4, 1e4)
    left = [0.0, 1.0, 100.0, 1000.0, 1e4]
    named = [stated(s, "found", chosen, False, before, (x, x)) for x in left]
    strange = [stated(s, "unexplained", chosen, False, before, (x, x)) for x in left]
    assert named == sorted(named, reverse=True)
    assert strange == sorted(strange)
    assert stated(s, "found", chosen, True, before, (1e3, 1e3)) == pytest.approx(named[0])
    assert max(named + strange) < 1
    assert min(named[-1], strange[0]) < 0.01


def test_an_effect_outside_the_catalogue_is_not_given_a_name():
    bench = spring({})
    for s in bench.segments:  # a step of the sensor's zero in the middle of every recording, of another size each
        size = {"r1": 1.0, "r2": -0.6, "r3": 1.4}[s.recording]
        bench.y[s.rows] += size * (s.time > 7.0 + 2.0 * size)
    verdict = decide(search(bench))
    assert verdict.kind == "unexplained"


def test_without_a_held_out_recording_it_still_answers():
    verdict = decide(search(spring({"relax.g": 0.2, "relax.tau": 0.6}, names=("r1",), held_out=())))
    assert (verdict.kind, names(verdict)) == ("found", ("relax",))


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


def test_no_name_is_given_that_leaves_as_much_as_wrong_ones_do():
    """Relaxation beside a wobble that no candidate knows, larger than a hundredth of the peak."""
    kinds = []
    for size in (0.0, 0.06):
        bench = spring({"relax.g": 0.4, "relax.tau": 1.0}, sigma=0.02)
        for s in bench.segments:
            bench.y[s.rows] += size * np.sin(s.time**1.5)
        verdict = decide(search(bench))
        assert names(verdict) == ("relax",)
        kinds.append(verdict.kind)
        assert verdict.kind != "found" or verdict.confidence > 0.5
    assert kinds == ["found", "unexplained"]


def test_a_set_that_ran_to_its_bound_or_predicts_worse_than_the_base_is_not_sound():
    s = search(spring({"relax.g": 0.2, "relax.tau": 0.6}))
    good = s.refits[frozenset({"relax"})]
    assert sound(s, good)
    assert not sound(s, replace(good, at_bound=("relax.g",), values={**good.values, "relax.g": 0.95}))
    whole = s.bench.candidates["relax"]
    s.bench.candidates["relax"] = replace(whole, amplitudes=("relax.g", *(f"bell{i}" for i in range(FIELD))))
    assert sound(s, replace(good, at_bound=("relax.g",), values={**good.values, "relax.g": 0.95})), "one of many"
    s.bench.candidates["relax"] = whole
    off = replace(good, at_bound=("relax.g",), values={**good.values, "relax.g": 0.0})
    assert sound(s, off)
    assert not sound(s, replace(good, held=2 * s.empty.held))

"""Refits of probings without simulations: another place, better derivatives, a fresh amplitude, one effect less."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.diagnosis.unsimulated import Fit
from tissuejax.diagnosis import probing_refits
from tissuejax.diagnosis.score import Score

X, Y, Z, RADIUS = (f"effects.inclusion.{p}" for p in ("x", "y", "z", "radius"))
HERE, DEEPER, THERE = ({X: x, Y: 0.0, Z: z, RADIUS: 6e-3} for x, z in ((-0.01, 0.01), (-0.01, 0.005), (0.01, 0.01)))
SCORE = Score(
    "inclusion/round",
    100.0,
    0.8,
    {"effects.inclusion.contrast": 1.4},
    HERE,
    np.zeros(1),
    ((100.0, {}, HERE), (99.0, {}, DEEPER), (80.0, {}, THERE)),
)
SOFT = {-0.01: 10.0, 0.01: 1.0}  # held-out chi-square per sample, by where the fit began: stiff here, soft there


@pytest.fixture
def search(monkeypatch):
    begun = []

    def step(s, parent, score):
        begun.append(score.setting)
        return Fit((score.key,), score.setting[X], np.inf)

    monkeypatch.setattr(probing_refits, "step", step)
    monkeypatch.setattr(probing_refits, "finish", lambda s, keys, trial: Fit(keys, trial.x, SOFT[trial.x]))
    return SimpleNamespace(begun=begun, report=lambda _: None, criterion=lambda r: r.chi2 + r.held)


def test_the_held_out_recording_sends_an_inclusion_under_another_site(search):
    first = Fit((SCORE.key,), -0.01, SOFT[-0.01])
    found = probing_refits.under_another_site(search, None, SCORE, first)
    assert search.begun == [THERE], "another depth under the same site is within reach of a refit"
    assert found.x == 0.01


@pytest.mark.parametrize("fit", [Fit((), -0.01, 1.0), Fit((), -0.01, 10.0, chi2=3.0)])
def test_nothing_is_begun_anew_where_all_is_explained_or_the_fitted_recordings_are_not(search, fit):
    assert probing_refits.under_another_site(search, None, SCORE, fit) is fit
    assert not search.begun


def test_a_set_that_can_do_without_an_effect_is_finished_and_one_that_cannot_is_not(monkeypatch):
    both = Fit(("a", "b"), 0.0, 1.0, chi2=10.0)
    begun, left = [], {("a",): 12.0, ("b",): 60.0}  # of 100: without b a little is lost, without a half

    def finish(s, keys, start, iterations=None):
        begun.append((keys, iterations))
        return Fit(keys, 0.0, 1.0, chi2=left[keys])

    monkeypatch.setattr(probing_refits, "finish", finish)
    s = SimpleNamespace(refits={frozenset("ab"): both}, empty=Fit((), 0.0, 1.0, chi2=100.0), report=lambda _: None)
    probing_refits.leave_out(s, frozenset("ab"))
    assert begun == [(("b",), probing_refits.BRIEF), (("a",), probing_refits.BRIEF), (("a",), None)]
    assert {k: s.refits[k].chi2 for k in (frozenset("a"), frozenset("b"))} == {
        frozenset("a"): 12.0,
        frozenset("b"): 60.0,
    }


@pytest.mark.parametrize(
    ("chi2", "noise", "again", "kept"),
    [
        (1.004, False, 0.996, 0.996),  # the fitted recordings are met, the next site is not
        (1.004, False, 1.1, 1.004),
        (1.004, True, 0.996, 1.004),  # nothing to do
        (3.0, False, 0.996, 3.0),  # more is missing than a better descent would bring
    ],
)
def test_a_set_that_leaves_little_goes_on_with_derivatives_of_the_mesh_that_counts(
    monkeypatch, chi2, noise, again, kept
):
    bench, seen = SimpleNamespace(slopes=probing_refits.COARSE), []

    def finish(s, keys, start, exact):
        assert exact
        seen.append(bench.slopes)
        return Fit(keys, 0.0, 1.0, chi2=again)

    monkeypatch.setattr(probing_refits, "finish", finish)
    monkeypatch.setattr(probing_refits, "quality", lambda s, r: SimpleNamespace(noise=noise))
    at = frozenset(["registration/place"])
    s = SimpleNamespace(
        bench=bench,
        refits={at: Fit(tuple(at), 0.0, 1.0, chi2=chi2)},
        report=lambda _: None,
        criterion=lambda r: r.chi2,
    )
    assert probing_refits.polished(s, at) == at
    assert s.refits[at].chi2 == kept
    assert seen == ([probing_refits.FINE] if not noise and chi2 < 2 else [])
    assert bench.slopes == probing_refits.COARSE


@pytest.mark.parametrize(("value", "chi2", "kept"), [(2.0, 5.0, 5.0), (2.0, 30.0, 20.0), (1.9, 5.0, 20.0)])
def test_an_amplitude_that_ran_to_its_limit_is_begun_again_from_its_usual_size(monkeypatch, value, chi2, kept):
    path, begun = "effects.friction.coefficient", []
    both = Fit(("friction", "base-slip"), 0.0, 1.0, chi2=20.0)
    both.values, both.at_bound = {path: value, "energy.C10": 500.0}, (path,) if value == 2.0 else ()
    monkeypatch.setattr(probing_refits, "replace", lambda fit, values: begun.append(values) or fit)
    monkeypatch.setattr(probing_refits, "finish", lambda s, keys, start: Fit(keys, 0.0, 1.0, chi2=chi2))
    bench = SimpleNamespace(
        free={path: SimpleNamespace(upper=2.0, scale=0.3)},
        candidates={"friction": SimpleNamespace(amplitudes=(path,)), "base-slip": SimpleNamespace(amplitudes=())},
    )
    at = frozenset(both.keys)
    s = SimpleNamespace(bench=bench, refits={at: both}, report=lambda _: None, criterion=lambda r: r.chi2)
    assert probing_refits.released(s, at) == at
    assert s.refits[at].chi2 == kept
    assert begun == ([{path: 0.3, "energy.C10": 500.0}] if value == 2.0 else [])


@pytest.mark.parametrize(
    ("C10", "chi2", "again", "kept"),
    [
        (30.0, 16.0, 2.0, 2.0),  # soft as nothing, since the base that slips was held
        (30.0, 16.0, 20.0, 16.0),
        (300.0, 16.0, 2.0, 16.0),  # not astray
        (30.0, 1.5, 0.9, 1.5),  # nothing worth it is left
    ],
)
def test_a_base_gone_astray_is_begun_again_from_its_start(monkeypatch, C10, chi2, again, kept):
    begun = []
    monkeypatch.setattr(probing_refits, "replace", lambda fit, values: begun.append(values) or fit)
    monkeypatch.setattr(probing_refits, "finish", lambda s, keys, start: Fit(keys, 0.0, 1.0, chi2=again))
    found = Fit(("base-slip",), 0.0, 1.0, chi2=chi2)
    found.values = {"energy.C10": C10, "effects.base-slip.compliance": 3e-5}
    bench = SimpleNamespace(
        base=("energy.C10",), start={"energy.C10": 400.0}, free={"energy.C10": SimpleNamespace(log=True)}
    )
    s = SimpleNamespace(bench=bench, report=lambda _: None, criterion=lambda r: r.chi2)
    assert probing_refits.astray(s, found).chi2 == kept
    wanted = C10 == 30.0 and chi2 > 2
    assert begun == ([{"energy.C10": 400.0, "effects.base-slip.compliance": 3e-5}] if wanted else [])

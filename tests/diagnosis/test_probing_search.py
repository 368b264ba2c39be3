"""The search of probings without simulations: where an inclusion is begun anew, and how long a set does without one."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from tissuejax.diagnosis import probing_search
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


@dataclass
class Fit:
    keys: tuple[str, ...]
    x: float
    held: float
    chi2: float = 1.0
    n: int = 1
    n_held: int = 1
    converged: bool = False


@pytest.fixture
def search(monkeypatch):
    begun = []

    def step(s, parent, score):
        begun.append(score.setting)
        return Fit((score.key,), score.setting[X], np.inf)

    monkeypatch.setattr(probing_search, "step", step)
    monkeypatch.setattr(probing_search, "finish", lambda s, keys, trial: Fit(keys, trial.x, SOFT[trial.x]))
    return SimpleNamespace(begun=begun, report=lambda _: None, criterion=lambda r: r.chi2 + r.held)


def test_the_held_out_recording_sends_an_inclusion_under_another_site(search):
    first = Fit((SCORE.key,), -0.01, SOFT[-0.01])
    found = probing_search.under_another_site(search, None, SCORE, first)
    assert search.begun == [THERE], "another depth under the same site is within reach of a refit"
    assert found.x == 0.01


@pytest.mark.parametrize("fit", [Fit((), -0.01, 1.0), Fit((), -0.01, 10.0, chi2=3.0)])
def test_nothing_is_begun_anew_where_all_is_explained_or_the_fitted_recordings_are_not(search, fit):
    assert probing_search.under_another_site(search, None, SCORE, fit) is fit
    assert not search.begun


def test_a_set_that_can_do_without_an_effect_is_finished_and_one_that_cannot_is_not(monkeypatch):
    both = Fit(("a", "b"), 0.0, 1.0, chi2=10.0)
    begun, left = [], {("a",): 12.0, ("b",): 60.0}  # of 100: without b a little is lost, without a half

    def finish(s, keys, start, iterations=None):
        begun.append((keys, iterations))
        return Fit(keys, 0.0, 1.0, chi2=left[keys])

    monkeypatch.setattr(probing_search, "finish", finish)
    s = SimpleNamespace(refits={frozenset("ab"): both}, empty=Fit((), 0.0, 1.0, chi2=100.0), report=lambda _: None)
    probing_search.leave_out(s, frozenset("ab"))
    assert begun == [(("b",), probing_search.BRIEF), (("a",), probing_search.BRIEF), (("a",), None)]
    assert {k: s.refits[k].chi2 for k in (frozenset("a"), frozenset("b"))} == {
        frozenset("a"): 12.0,
        frozenset("b"): 60.0,
    }


@pytest.mark.parametrize(("held", "led_by"), [(10.0, "a"), (40.0, "a"), (60.0, "b"), (80.0, "b")])
def test_what_no_set_explains_of_the_held_out_recording_does_not_choose_among_them(held, led_by):
    """b is better on the fitted recordings; a by the criterion, which counts the held-out one (100 before) as well."""
    refits = {frozenset(): Fit((), 0.0, 100.0, chi2=100.0)}
    refits |= {frozenset("a"): Fit(("a",), 0.0, held, chi2=25.0), frozenset("b"): Fit(("b",), 0.0, 90.0, chi2=20.0)}
    s = SimpleNamespace(refits=refits, criterion=lambda r: r.chi2 + r.held, fitted=lambda r: r.chi2)
    assert probing_search.leading(s, frozenset(), [frozenset("a"), frozenset("b")]) == frozenset(led_by)


class Outside:
    """Two recordings fitted, one not: its ten samples are all 3 too high, and an offset of its own would say so."""

    held_out, start = ("r3",), {"own": 0.0, "other": 0.0}
    free = {p: SimpleNamespace(lower=-10.0, upper=10.0, prior=None) for p in ("own", "other")}
    candidates = {
        "offset/each": SimpleNamespace(held=("own",), shapes=(), name="offset"),
        "wave": SimpleNamespace(held=("other",), shapes=(), name="wave"),
        "common": SimpleNamespace(held=(), shapes=(), name="common"),
    }

    def jacobian(self, values, paths, names):
        columns = {"own": np.ones(10), "other": np.tile([1.0, -1.0], 5)}
        return np.stack([columns[p] for p in paths], axis=1)


@pytest.mark.parametrize(("chi2", "asked"), [(10.0, ["offset/each"]), (40.0, [])])
def test_held_out_recordings_that_are_missed_far_more_ask_for_values_of_their_own(chi2, asked):
    parent = Fit((), 0.0, 90.0, chi2=chi2, n=10, n_held=10)
    parent.prediction, parent.values = np.zeros(10), {}
    misfit = SimpleNamespace(residual=lambda prediction, names: np.full(10, 3.0), whiten=lambda x, names: x)
    s = SimpleNamespace(refits={frozenset(): parent}, bench=Outside(), misfit=misfit, names=lambda keys: frozenset())
    assert probing_search.asked_outside(s, frozenset()) == asked


@pytest.mark.parametrize(("noise", "grown", "begun"), [(False, "b", ["a"]), (True, "b", []), (False, "a", [])])
def test_the_best_scored_candidate_is_refitted_unless_it_was_or_something_explains_the_rest(
    monkeypatch, noise, grown, begun
):
    asked = []
    parent = Fit((), 0.0, 1.0)
    monkeypatch.setattr(probing_search, "replace", lambda fit, values: fit)
    monkeypatch.setattr(probing_search, "quality", lambda s, r: SimpleNamespace(noise=noise))
    monkeypatch.setattr(probing_search, "settled", lambda s, r: False)
    monkeypatch.setattr(probing_search, "finish", lambda s, keys, start: asked.append(*keys) or Fit(keys, 0.0, 1.0))
    parent.values = {}
    s = SimpleNamespace(
        refits={frozenset(): parent, frozenset(grown): parent}, report=lambda _: None, names=lambda keys: keys
    )
    nominated = [SimpleNamespace(key=k, gain=10.0, setting={}) for k in "ac"]
    found = probing_search.favourite(s, frozenset(), nominated, [frozenset(grown)])
    assert asked == begun
    assert found == [frozenset(k) for k in begun]


@pytest.mark.parametrize(("gain", "begun"), [(8.0, [("x", "c")]), (3.0, [])])
def test_beside_a_found_effect_the_next_name_of_nearly_as_good_a_score_is_heard(monkeypatch, gain, begun):
    asked, parent = [], Fit(("x",), 0.0, 1.0)
    parent.values = {}
    monkeypatch.setattr(probing_search, "replace", lambda fit, values: fit)
    monkeypatch.setattr(probing_search, "quality", lambda s, r: SimpleNamespace(noise=False))
    monkeypatch.setattr(probing_search, "settled", lambda s, r: False)
    monkeypatch.setattr(probing_search, "finish", lambda s, keys, start: asked.append(keys) or Fit(keys, 0.0, 1.0))
    refits = {frozenset("x"): parent, frozenset("xa"): parent}  # a was refitted and left something
    s = SimpleNamespace(refits=refits, report=lambda _: None, names=lambda keys: keys)
    nominated = [SimpleNamespace(key=k, gain=g, setting={}) for k, g in (("a", 10.0), ("c", gain))]
    found = probing_search.favourite(s, frozenset("x"), nominated, [frozenset("xa")])
    assert asked == begun
    assert found == [frozenset(k) for k in begun]


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
    bench, seen = SimpleNamespace(slopes=probing_search.COARSE), []

    def finish(s, keys, start, iterations):
        seen.append(bench.slopes)
        return Fit(keys, 0.0, 1.0, chi2=again)

    monkeypatch.setattr(probing_search, "finish", finish)
    monkeypatch.setattr(probing_search, "quality", lambda s, r: SimpleNamespace(noise=noise))
    at = frozenset(["registration/place"])
    s = SimpleNamespace(
        bench=bench,
        refits={at: Fit(tuple(at), 0.0, 1.0, chi2=chi2)},
        report=lambda _: None,
        criterion=lambda r: r.chi2,
    )
    assert probing_search.polished(s, at) == at
    assert s.refits[at].chi2 == kept
    assert seen == ([probing_search.FINE] if not noise and chi2 < 2 else [])
    assert bench.slopes == probing_search.COARSE


@pytest.mark.parametrize(
    ("chi2", "noise", "enough", "answer", "asked"),
    [
        (1.3, False, True, True, 1),  # a lag of our own making: nothing to look for beside
        (1.3, False, False, False, 1),
        (1.0, True, False, True, 0),
        (2.5, False, True, False, 0),  # no simulation is as wrong as that: three more runs would tell nothing
    ],
)
def test_what_a_found_effect_leaves_is_asked_whether_it_is_numerical(monkeypatch, chi2, noise, enough, answer, asked):
    seen = []

    def numerics(bench, misfit, r):
        seen.append(r)
        return SimpleNamespace(enough=lambda at: enough)

    monkeypatch.setattr(probing_search, "numerics", numerics)
    monkeypatch.setattr(probing_search, "quality", lambda s, r: SimpleNamespace(noise=noise))
    monkeypatch.setattr(probing_search, "settled", lambda s, r: False)
    s = SimpleNamespace(bench=SimpleNamespace(numerics={}), misfit=None, report=lambda _: None)
    assert probing_search.explained(s, Fit(("base-slip",), 0.0, 1.0, chi2=chi2)) is answer
    assert len(seen) == asked


def test_a_pair_that_leaves_something_is_begun_again_from_its_second_effect(monkeypatch):
    """a was chosen while b was missing; beside b alone it is c that explains the rest."""
    fits = {k: Fit(tuple(k), 0.0, 1.0, chi2=c) for k, c in {"": 100.0, "a": 40.0, "ab": 20.0, "b": 45.0}.items()}
    refits = {frozenset(k): r for k, r in fits.items()}
    begun, left_out, judged = [], [], []

    def grow(s, at, most):
        begun.append(at)
        s.refits[frozenset("bc")] = Fit(("b", "c"), 0.0, 1.0, chi2=5.0)
        return [frozenset("bc")]

    monkeypatch.setattr(probing_search, "grow", grow)
    monkeypatch.setattr(probing_search, "richer", lambda s, at: at)
    monkeypatch.setattr(probing_search, "polished", lambda s, at: at)
    monkeypatch.setattr(probing_search, "leave_out", lambda s, at: left_out.append(at))
    monkeypatch.setattr(probing_search, "explained", lambda s, r: judged.append(r.keys))
    candidates = {k: SimpleNamespace(amplitudes=()) for k in "abc"}
    s = SimpleNamespace(
        refits=refits,
        score=lambda at: [],
        report=lambda _: None,
        criterion=lambda r: r.chi2,
        bench=SimpleNamespace(free={}, candidates=candidates),
    )
    monkeypatch.setattr(Fit, "at_bound", (), raising=False)
    probing_search.begin_with_the_second(s, frozenset("ab"), 1)
    assert begun == [frozenset("b")]
    assert left_out == [frozenset("bc")]
    assert judged == [("b", "c")], "its numerical error counts as that of any found set"


@pytest.mark.parametrize(("value", "chi2", "kept"), [(2.0, 5.0, 5.0), (2.0, 30.0, 20.0), (1.9, 5.0, 20.0)])
def test_an_amplitude_that_ran_to_its_limit_is_begun_again_from_its_usual_size(monkeypatch, value, chi2, kept):
    path, begun = "effects.friction.coefficient", []
    both = Fit(("friction", "base-slip"), 0.0, 1.0, chi2=20.0)
    both.values, both.at_bound = {path: value, "energy.C10": 500.0}, (path,) if value == 2.0 else ()
    monkeypatch.setattr(probing_search, "replace", lambda fit, values: begun.append(values) or fit)
    monkeypatch.setattr(probing_search, "finish", lambda s, keys, start: Fit(keys, 0.0, 1.0, chi2=chi2))
    bench = SimpleNamespace(
        free={path: SimpleNamespace(upper=2.0, scale=0.3)},
        candidates={"friction": SimpleNamespace(amplitudes=(path,)), "base-slip": SimpleNamespace(amplitudes=())},
    )
    at = frozenset(both.keys)
    s = SimpleNamespace(bench=bench, refits={at: both}, report=lambda _: None, criterion=lambda r: r.chi2)
    assert probing_search.released(s, at) == at
    assert s.refits[at].chi2 == kept
    assert begun == ([{path: 0.3, "energy.C10": 500.0}] if value == 2.0 else [])

"""The search of probings without simulations: what is tried, what leads, and when it is enough."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.diagnosis.unsimulated import Fit
from tissuejax.diagnosis import probing_search


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


@pytest.mark.parametrize(
    ("noise", "grown", "own", "begun"),
    [
        (False, "b", "", ["a"]),
        (True, "b", "", []),  # something explains the rest
        (False, "a", "", []),  # it was refitted
        (True, "b", "b", ["a"]),  # what explains the rest has values of its own in every recording, and mimics much
        (True, "b", "ba", ["c"]),
    ],
)
def test_the_best_scored_candidate_is_refitted_unless_it_was_or_something_explains_the_rest(
    monkeypatch, noise, grown, own, begun
):
    asked = []
    parent = Fit((), 0.0, 1.0)
    monkeypatch.setattr(probing_search, "replace", lambda fit, values: fit)
    monkeypatch.setattr(probing_search, "quality", lambda s, r: SimpleNamespace(noise=noise))
    monkeypatch.setattr(probing_search, "settled", lambda s, r: False)
    monkeypatch.setattr(probing_search, "finish", lambda s, keys, start: asked.append(*keys) or Fit(keys, 0.0, 1.0))
    monkeypatch.setattr(probing_search, "polished", lambda s, at: at)
    parent.values = {}
    s = SimpleNamespace(
        refits={frozenset(): parent, frozenset(grown): parent},
        report=lambda _: None,
        names=lambda keys: keys,
        bench=SimpleNamespace(candidates={k: SimpleNamespace(held=("x",) if k in own else ()) for k in "abc"}),
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
    candidates = {k: SimpleNamespace(held=()) for k in "xac"}
    s = SimpleNamespace(
        refits=refits, report=lambda _: None, names=lambda keys: keys, bench=SimpleNamespace(candidates=candidates)
    )
    nominated = [SimpleNamespace(key=k, gain=g, setting={}) for k, g in (("a", 10.0), ("c", gain))]
    found = probing_search.favourite(s, frozenset("x"), nominated, [frozenset("xa")])
    assert asked == begun
    assert found == [frozenset(k) for k in begun]


def test_after_offsets_of_every_recording_an_effect_common_to_all_is_heard(monkeypatch):
    """a explains the rest with values of its own in every recording; c, common to all, does so too."""
    asked, further, parent = [], [], Fit(("x",), 0.0, 1.0)
    parent.values = {}
    monkeypatch.setattr(probing_search, "replace", lambda fit, values: fit)
    monkeypatch.setattr(probing_search, "polished", lambda s, at: further.append(at))
    monkeypatch.setattr(probing_search, "quality", lambda s, r: SimpleNamespace(noise=len(r.keys) > 1))
    monkeypatch.setattr(probing_search, "settled", lambda s, r: False)
    monkeypatch.setattr(probing_search, "finish", lambda s, keys, start: asked.append(keys) or Fit(keys, 0.0, 1.0))
    candidates = {k: SimpleNamespace(held=("own",) if k in "ab" else ()) for k in "xabcd"}
    s = SimpleNamespace(
        refits={frozenset("x"): parent},
        report=lambda _: None,
        names=lambda keys: keys,
        bench=SimpleNamespace(candidates=candidates),
    )
    nominated = [SimpleNamespace(key=k, gain=10.0, setting={}) for k in "abcd"]
    assert probing_search.favourite(s, frozenset("x"), nominated, []) == [frozenset("xa"), frozenset("xc")]
    assert asked == [("x", "a"), ("x", "c")]
    assert further == [frozenset("xc")], "it goes on to the end before the two are compared"


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


@pytest.mark.parametrize(
    ("chi2", "held", "answer"),
    [
        (118.0, 120.0, True),  # 2 % of the base's excess is left, held out 5 %
        (118.0, 320.0, False),  # the third site misses more than half of what the base missed there
        (118.0, 128.0, True),  # much of little is little
        (150.0, 100.0, False),
    ],
)
def test_a_found_effect_is_enough_only_if_the_held_out_recordings_do_not_ask_for_more(chi2, held, answer):
    base = Fit((), 0.0, 500.0 if held != 128.0 else 150.0, chi2=1100.0, n=100, n_held=100)
    base.k, r = 0, Fit(("friction",), 0.0, held, chi2=chi2, n=100, n_held=100)
    r.k = 0
    assert probing_search.settled(SimpleNamespace(empty=base), r) is answer

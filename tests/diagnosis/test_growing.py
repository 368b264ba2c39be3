"""Which sets a search weighs, in which order and from where, by hand: with known evidence."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from tests.diagnosis.known_sets import explored, score, sets, weighed
from tissuejax.diagnosis.judgement import explore


def test_what_cannot_be_is_worth_nothing():
    e = explored({})
    e.weighed |= {
        frozenset({"hum"}): weighed(("hum",), -10.0, void=True),
        frozenset({"gap"}): weighed(("gap",), np.nan),
    }
    assert [e.worth(k) for k in sets("hum", "gap")] == [-math.inf, -math.inf]
    assert e.best == frozenset()
    assert e.ranked(1) == []


def test_worth_is_evidence_and_prior_together():
    e = explored({})
    e.weighed[frozenset({"hum"})] = weighed(("hum",), -50.0)
    e.__dict__["before"] = SimpleNamespace(log_prior=lambda evidence: -3.0)
    assert e.worth(frozenset({"hum"})) == -53.0


def test_forms_of_an_effect_are_one_company_but_for_what_widens_the_discrepancy():
    e = explored({})
    assert e.company(frozenset({"law", "gap/late"})) == {"law", "gap"}
    assert e.names(frozenset({"law", "gap/late"})) == {"wide", "gap"}
    assert e.same(frozenset({"gap", "hum"}), frozenset({"hum", "gap/late"}))
    assert not e.same(frozenset({"gap"}), frozenset({"hum"}))


def test_near_is_less_than_hopeful_below_the_best():
    e = explored({})
    for form, worth in (("hum", -50.0), ("gap", -57.9), ("drift", -58.1)):
        e.weighed[frozenset({form})] = weighed((form,), worth)
    e.weighed[frozenset({"hum", "drift"})] = weighed(("hum", "drift"), -51.0)
    assert e.near(1) == sets("hum", "gap")
    assert e.near(1, below=8.2) == sets("hum", "gap", "drift")


def test_nominees_of_several_sets_take_turns_and_no_set_is_weighed_twice():
    rows = {
        ("hum",): [score("gap", 9.0), score("drift", 8.0)],
        ("gap",): [score("hum", 9.0), score("drift", 7.0)],
    }
    e = explored({}, rows)
    e.weighed |= {frozenset({k}): weighed((k,), -50.0, mu=2.0) for k in ("hum", "gap")}
    e.extend(sets("hum", "gap"), most=10, each=3)
    # a law that widens the discrepancy needs no step and comes first; of the others the pair of both only once
    assert e.kept.order == sets("hum+law", "gap+law", "hum+gap", "hum+drift", "gap+drift")


@pytest.mark.parametrize(("most", "each", "pairs"), [(2, 3, 2), (10, 1, 2), (10, 2, 3), (0, 3, 0)])
def test_so_many_sets_are_weighed_and_so_many_of_each_parent(most, each, pairs):
    """With one of each the two that widen; with two the pair of both, which is the next of either."""
    rows = {("hum",): [score("gap", 9.0), score("drift", 8.0)], ("gap",): [score("hum", 9.0), score("drift", 7.0)]}
    e = explored({}, rows)
    e.weighed |= {frozenset({k}): weighed((k,), -50.0) for k in ("hum", "gap")}
    e.extend(sets("hum", "gap"), most, each)
    assert len(e.kept.order) == pairs


def test_the_best_form_that_a_step_promises_is_the_one_that_is_tried():
    e = explored({}, {(): [score("gap/late", 9.0), score("gap", 8.0)]})
    e.extend([frozenset()], 10, 10)
    assert e.kept.order == sets("law", "gap/late")


def test_what_was_weighed_before_takes_no_turn_from_the_next():
    """Three sets nominate each other: what the second has in common with the first is left out, the third goes on."""
    rows = {("hum",): [score("gap", 9.0)], ("gap",): [score("hum", 9.0)], ("drift",): [score("hum", 9.0)]}
    e = explored({("law",): -500.0}, rows)
    e.weighed |= {frozenset({k}): weighed((k,), -50.0) for k in ("hum", "gap", "drift", "law")}
    e.weighed |= {frozenset({k, "law"}): weighed((k, "law"), -500.0) for k in ("hum", "gap", "drift")}
    e.extend(sets("hum", "gap", "drift"), 10, 10)
    assert e.kept.order == sets("gap+hum", "drift+hum")


@pytest.mark.parametrize(
    ("parent", "costly", "gain", "tried"),
    [
        ((), False, -3.9, True),
        ((), False, -4.1, False),
        ((), True, -0.5, True),
        (("gap",), False, -0.5, True),
        (("gap",), True, -0.5, False),
        (("gap",), True, 0.5, True),
    ],
)
def test_a_step_has_to_promise_something(parent, costly, gain, tried):
    """Little beside nothing or where a prediction costs nothing; beside a set of simulations some gain."""
    e = explored({}, {parent: [score("hum", gain)]}, costly)
    e.weighed[frozenset(parent)] = weighed(parent, -100.0)
    e.extend([frozenset(parent)], 5, 5)
    assert (frozenset({*parent, "hum"}) in e.weighed) is tried


@pytest.mark.parametrize(("parent", "tried"), [(-57.5, True), (-58.5, False)])
def test_a_step_that_promises_a_loss_takes_nothing_from_its_set(parent, tried):
    e = explored({}, {(): [score("hum", -2.0)]}, costly=True)
    e.weighed |= {frozenset(): weighed((), parent), frozenset({"gap"}): weighed(("gap",), -50.0)}
    e.extend([frozenset()], 5, 5)
    assert (frozenset({"hum"}) in e.weighed) is tried


def test_who_may_join_a_set(monkeypatch):
    """Another effect that is nominated, has an amplitude, and nests no search within two others."""
    asked = []
    monkeypatch.setattr(explore, "nominated", lambda *given: asked.append([c.key for c in given[3]]) or [])
    e = explored({}, nested=lambda keys: 3 if "drift" in keys else 2)
    e.weighed[frozenset({"hum"})] = weighed(("hum",), -50.0)
    assert e.score(frozenset({"hum"})) == e.score(frozenset({"hum"})) == []
    assert asked == [["gap"]]  # once


def test_a_set_is_begun_from_its_parents_fit_and_the_linear_step():
    """Settings whose steps gain half as much are begun from too, two of them beside a set; of the base, all of four."""
    steps = {(): [score("hum", 9.0, settings=4)], ("hum",): [score("gap", 9.0, settings=4)]}
    e = explored({("hum", "gap"): -49.0}, steps)
    e.extend([frozenset()], 5, 5)
    begun = [values for keys, values, *_ in e.kept.asked if keys == ("hum",)]
    assert begun[:4] == [{"mu": 1.0, "hum.size": 2.0, "hum.edge": float(k)} for k in range(4)]
    hum = e.weighed[frozenset({"hum"})] = weighed(("hum",), -50.0, mu=3.0)
    e.kept.asked.clear()
    e.extend([frozenset({"hum"})], 5, 5)
    begun = [row for row in e.kept.asked if row[0] == ("hum", "gap")]
    tried = [{"mu": 3.0, "gap.size": 2.0, "gap.edge": k} for k in (0.0, 1.0)]
    assert [values for _, values, *_ in begun[:2]] == tried
    assert all(values in tried for _, values, *_ in begun)
    assert {bench for *_, bench in begun} == {hum.bench}


def test_one_start_is_one_setting():
    e = explored({("hum",): -99.0}, {(): [score("hum", 9.0, settings=4)]}, starts=1)
    e.extend([frozenset()], 5, 5)
    assert [values["hum.edge"] for keys, values, *_ in e.kept.asked if keys == ("hum",)] == [0.0]


def test_beside_others_an_effect_begins_where_it_was_alone_too_and_in_its_best_form():
    e = explored({("hum", "gap/late"): -49.0}, {("hum",): [score("gap", 9.0)]})
    e.weighed[frozenset({"hum"})] = weighed(("hum",), -50.0, mu=3.0)
    e.weighed[frozenset({"gap"})] = weighed(("gap",), -60.0, mu=5.0, **{"gap.size": 7.0})
    e.weighed[frozenset({"gap/late"})] = weighed(("gap/late",), -55.0, mu=6.0, **{"gap/late.size": 8.0})
    e.extend(sets("hum"), 5, 5)
    of = {keys: [v for k, v, *_ in e.kept.asked if k == keys] for keys in (("hum", "gap"), ("hum", "gap/late"))}
    assert {"mu": 3.0, "gap.size": 7.0} in of["hum", "gap"]
    assert of["hum", "gap/late"] == [{"mu": 3.0, "gap/late.size": 8.0}]


@pytest.mark.parametrize("costly", [False, True])
def test_where_predictions_cost_nothing_the_best_form_alone_is_another_start(costly):
    """Nominated is a form whose name comes after that of the one that was best alone."""
    e = explored({("hum", "gap"): -49.0}, {("hum",): [score("gap/late", 90.0)]}, costly)
    e.weighed[frozenset({"hum"})] = weighed(("hum",), -50.0, mu=3.0)
    e.weighed[frozenset({"gap"})] = weighed(("gap",), -55.0, mu=5.0, **{"gap.size": 7.0})
    e.extend(sets("hum"), 5, 5)
    assert [v for keys, v, *_ in e.kept.asked if keys == ("hum", "gap")] == (
        [] if costly else [{"mu": 3.0, "gap.size": 7.0}]
    )


def test_forms_are_changed_as_long_as_that_gains():
    """From late to twice though twice is no neighbour of the form that was nominated; from worse ones nowhere."""
    e = explored({("gap/late",): -45.0, ("gap/twice",): -40.0})
    e.weighed[frozenset({"gap"})] = weighed(("gap",), -50.0, mu=3.0)
    e.weighed[frozenset({"hum"})] = weighed(("hum",), -30.0)
    e.reshape(frozenset({"gap"}))
    assert e.kept.order == sets("gap/late", "gap/twice")
    e = explored({("gap/late",): -55.0})
    e.weighed[frozenset({"gap"})] = weighed(("gap",), -50.0, mu=3.0)
    e.reshape(frozenset({"gap"}))
    assert e.kept.order == sets("gap/late")
    # alone from the first three settings, each beside the fit of the form before
    begun = [values for _, values, *_ in e.kept.asked]
    assert begun[:3] == [{"mu": 3.0, "gap/late.edge": k} for k in (0.0, 1.0, 2.0)]
    assert all(values in begun[:3] for values in begun)


@pytest.mark.parametrize(("late", "tried"), [(-57.0, True), (-59.0, False)])
def test_beside_others_a_form_that_was_far_behind_alone_is_not_tried(late, tried):
    e = explored({})
    e.weighed[frozenset({"hum"})] = weighed(("hum",), -30.0)
    e.weighed[frozenset({"gap"})] = weighed(("gap",), -50.0)
    e.weighed[frozenset({"gap/late"})] = weighed(("gap/late",), late)
    e.weighed[frozenset({"hum", "gap"})] = weighed(("hum", "gap"), -40.0)
    e.reshape(frozenset({"hum", "gap"}))
    assert (frozenset({"hum", "gap/late"}) in e.weighed) is tried
    if tried:  # two settings beside another effect
        assert len({v["gap/late.edge"] for keys, v, *_ in e.kept.asked if "gap/late" in keys}) == 2


@pytest.mark.parametrize(("depth", "tried"), [(2, True), (3, False)])
def test_searches_within_searches_within_searches_are_not_begun(depth, tried):
    e = explored({}, nested=lambda keys: depth if "gap/late" in keys else 0)
    e.weighed[frozenset({"gap"})] = weighed(("gap",), -50.0)
    e.reshape(frozenset({"gap"}))
    assert (frozenset({"gap/late"}) in e.weighed) is tried


def test_every_effect_of_a_set_is_left_out_once_from_where_the_set_rests():
    e = explored({})
    pair = e.weighed[frozenset({"hum", "gap"})] = weighed(("hum", "gap"), -40.0, mu=3.0)
    e.leave_out(frozenset({"hum", "gap"}))
    assert e.kept.asked == [(("gap",), {"mu": 3.0}, pair.v, pair.bench), (("hum",), {"mu": 3.0}, pair.v, pair.bench)]
    e.kept.asked.clear()
    e.leave_out(frozenset({"hum"}))
    assert e.kept.asked == []  # the base has been weighed


@pytest.mark.parametrize(("promised", "tried"), [(21.1, True), (20.9, False)])
def test_a_costly_set_that_would_stay_behind_is_not_begun(promised, tried):
    """The best at -50, a parent at -100: what is hopeful begins at -58, and a step may gain twice what it promises."""
    e = explored({}, {(): [score("hum", promised)]}, costly=True)
    e.weighed[frozenset({"gap"})] = weighed(("gap",), -50.0)
    e.extend([frozenset()], 5, 5)
    assert (frozenset({"hum"}) in e.weighed) is tried


def test_a_costly_set_that_stays_behind_takes_no_turn_from_the_next():
    e = explored({}, {("gap",): [score("hum", 1.0)], ("drift",): [score("hum", 90.0)]}, costly=True)
    e.weighed |= {frozenset({"gap"}): weighed(("gap",), -100.0), frozenset({"drift"}): weighed(("drift",), -50.0)}
    e.weighed |= {frozenset({k, "law"}): weighed((k, "law"), -500.0) for k in ("gap", "drift")}
    e.extend(sets("gap", "drift"), 5, 5)
    assert e.kept.order == sets("drift+hum")


def test_predictions_that_cost_nothing_do_not_count_where_others_do():
    """A law that only widens the discrepancy beside two effects, of which one may be weighed."""
    rows = {(): [score("hum", 90.0), score("drift", 90.0)]}
    e = explored({}, rows, costly=True)
    e.extend([frozenset()], most=1, each=1)
    assert set(e.kept.order) == set(sets("law", "hum"))

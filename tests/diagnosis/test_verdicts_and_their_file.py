"""Edges of the rules of a verdict, on probabilities that are given, and evidence as it is written and read."""

import json
import math
from dataclasses import FrozenInstanceError, replace
from itertools import combinations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from weighed_sets import evidence, weighed

from tissuejax.diagnosis.judgement.blocks import Blocks, State
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.evidence import Evidence, SetEvidence, read_evidence, write_evidence
from tissuejax.diagnosis.judgement.judge import (
    Beforehand,
    Judgement,
    Kind,
    covering,
    entropy,
    judge,
    left,
    negligible,
    undecided,
    weighted,
)
from tissuejax.diagnosis.judgement.marginal import Blocked, Linear, Marginal, Widths
from tissuejax.diagnosis.judgement.search import Setup
from tissuejax.diagnosis.judgement.weigh import Round, Start, Weighed
from tissuejax.errors import InputError

CRITERIA = Criteria(covered=0.75)
Named: Any = SimpleNamespace


def test_effects_stand_in_three_of_the_five_answers():
    assert [k.speaks for k in Kind] == [False, True, True, True, False]


def test_no_more_act_than_there_are_names_and_no_more_than_are_thought_possible():
    usual = Criteria()
    one = Beforehand.of({"slack": 2}, (), usual)
    assert one.sizes == (0.5, 0.5)
    assert one.exactly(("slack",)) == pytest.approx(0.5)
    none = Beforehand.of({}, (), usual)
    assert (none.sizes, none.exactly(()), none.with_all(())) == ((1.0,), 1.0, 1.0)
    names = "abcde"
    five = Beforehand.of(dict.fromkeys(names, 1), ("a",), usual)
    assert five.sizes == usual.sizes
    for many in (tuple("abcd"), tuple("abcde")):
        assert five.exactly(many) == five.with_all(many) == 0.0
    assert five.log_prior(Named(names=tuple("abcd"))) == -math.inf
    odds = {n: usual.fault if n == "a" else 1.0 for n in names}
    for some in (("a",), ("b",), ("a", "b"), ("c", "d"), ("b", "c", "d"), ()):
        acting = 0.0
        for k, share in enumerate(usual.sizes):
            sets = [(math.prod(odds[n] for n in s), set(some) <= set(s)) for s in combinations(names, k)]
            acting += share * sum(x for x, inside in sets if inside) / sum(x for x, _ in sets)
        assert five.with_all(some) == pytest.approx(acting)


def test_a_set_shares_the_prior_of_its_names_among_their_forms():
    forms = {"a": 3, "b": 2, "c": 1}
    prior = Beforehand.of(forms, ("c",), Criteria())
    for names in ((), ("a",), ("a", "b"), ("c", "a")):
        shared = math.log(prior.exactly(names)) - sum(math.log(forms[n]) for n in names)
        assert prior.log_prior(Named(names=names)) == pytest.approx(shared)


@pytest.mark.parametrize(("chi2", "share"), [(100.0, 0.0), (99.0, 0.0), (200.0, 0.5), (400.0, 0.75), (0.0, 0.0)])
def test_what_is_left_beyond_noise_is_a_share_of_the_squares(chi2, share):
    assert left(replace(weighed([], 0.0), chi2=chi2, n=100)) == pytest.approx(share)


def test_a_rest_that_is_surely_known_is_negligible_or_is_not():
    """Half a per cent of the peak, and beside it what is laid to the simulation."""
    usual = Criteria()
    for rest, numerical, expected in ((2.4e-5, 0.0, 1), (2.6e-5, 0.0, 0), (2.6e-5, 1.1e-3, 1), (2.6e-5, 0.9e-3, 0)):
        s = replace(weighed([], 0.0), rest=(rest, 0.0), numerical=numerical)
        assert negligible(s, usual) == expected
    s = replace(weighed([], 0.0), rest=(2.0e-5, 0.0), scattered=(0.3, 6e-6))
    assert negligible(s, usual) == pytest.approx(0.7)


def test_sets_that_cannot_be_are_not_weighed_and_all_are_compared_by_the_power_of_the_likeliest():
    sets = (
        weighed([], 1.0, chi2=400.0),
        replace(weighed(["slack"], 3.0, chi2=200.0), n=50),
        weighed(["drift"], 9.0, void=True),
        weighed(["relaxation"], -math.inf),
    )
    found = weighted(evidence(*sets), Criteria(coarse=60.0))
    power = 60.0 / (60.0 + 100 * (1 - 50 / 200))
    before = Beforehand.of(evidence().forms, (), Criteria())
    expected = [power * s.log_evidence + before.log_prior(s) for s in sets[:2]]
    assert [w for w, _ in found] == pytest.approx(expected)
    assert [s.names for _, s in found] == [(), ("slack",)]


def test_ten_alternatives_are_kept_the_likeliest_first():
    names = [f"e{i:02d}" for i in range(13)]
    sets = [weighed([], -50.0), *(weighed([n], 0.1 * i) for i, n in enumerate(names))]
    j = judge(Evidence(tuple(sets), dict.fromkeys(names, 1), ("p",), ()))
    assert j.chosen.names == ("e12",)
    assert [s.names for s, _ in j.alternatives] == [(n,) for n in names[11:1:-1]]


def test_a_name_is_given_where_it_is_likelier_than_the_rule_says_and_not_where_it_is_as_likely():
    given = evidence(weighed([], 0.0), weighed(["slack"], 1.5), weighed(["drift"], 1.0))
    likely = judge(given).inclusion["slack"]
    assert judge(given, Criteria(named=likely)).exact == 0.0
    assert judge(given, Criteria(named=likely * (1 - 1e-12))).exact > 0.0


def test_what_is_stated_may_be_a_set_that_was_never_weighed():
    """Of all three pairs of three names each name is in two: all are likelier present than not, together never."""
    sets = [weighed([], -50.0), *(weighed(pair, 0.0) for pair in combinations(("a", "b", "c"), 2))]
    j = judge(Evidence(tuple(sets), dict.fromkeys("abc", 1), ("p",), ()))
    assert j.inclusion == pytest.approx(dict.fromkeys("abc", 2 / 3))
    assert (j.exact, j.probabilities[Kind.FOUND]) == (0.0, 0.0)
    assert j.probabilities[Kind.AMBIGUOUS] == pytest.approx(1.0)


@pytest.mark.parametrize(("base", "drift"), [("void", 2.0), ("impossible", 2.0), ("none", -9.0)])
def test_where_the_base_cannot_be_nothing_is_never_the_answer(base, drift):
    """Of one name in one form and one in three: e^1 and e^2 / 3."""
    sets = [weighed(["slack"], 1.0), weighed(["drift"], drift)]
    if base != "none":
        sets.append(weighed([], 5.0 if base == "void" else -math.inf, void=base == "void"))
    j = judge(Evidence(tuple(sets), {"slack": 1, "drift": 3}, ("p",), ()), Criteria(coarse=1e12))
    slack = math.e / (math.e + math.exp(drift) / 3)
    assert (j.probabilities[Kind.NOTHING], j.probabilities[Kind.UNEXPLAINED]) == (0.0, 0.0)
    assert j.posterior == pytest.approx({"slack": slack, "drift": 1 - slack})
    assert j.missing == 1.0
    assert j.kind in (Kind.FOUND, Kind.IN_PART)
    assert j.probabilities[Kind.AMBIGUOUS] == pytest.approx(1 - slack)


def test_of_forms_alike_in_all_the_likeliest_is_shown():
    """Inside it and hardly beaten: fewer parameters first, then the better of as many."""
    forms = {"plain": ("mu", "k"), "other": ("mu", "t"), "full": ("mu", "k", "t"), "apart": ("mu",), "else": ("nu",)}

    def shown(**worth: float) -> str:
        sets = [replace(weighed(["slack"], w), keys=(n,), free=forms[n]) for n, w in worth.items()]
        return judge(evidence(weighed([], -50.0), *sets), Criteria(coarse=1e12)).chosen.keys[0]

    near = math.log(20.0)
    assert shown(full=0.0, plain=-near + 0.01) == "plain"
    assert shown(full=0.0, plain=-near - 0.01) == "full"
    assert shown(full=0.0, plain=-2.0, other=-1.0) == "other"
    assert shown(full=0.0, other=-1.0, plain=-2.0) == "other"
    assert shown(full=0.0, plain=-1.0, other=-1.0) == "plain"
    assert shown(plain=0.0, other=-1.0) == "plain"
    assert shown(plain=0.0, full=-0.1) == "plain"
    assert shown(full=0.0, plain=-1.0, apart=-2.5) == "apart"
    assert shown(**{"full": 0.0, "else": -0.1}) == "full"  # another law, and no plainer for that


def given(chosen: str, posterior: dict[str, float], **kinds: float) -> Any:
    """A judgement of these probabilities, by names; sets are their names."""
    names = tuple(chosen.split(" + ")) if chosen else ()
    keys = [k for k in sorted(posterior, key=lambda k: -posterior[k]) if k not in ("", " + ".join(sorted(names)))]
    chances = dict.fromkeys(Kind, 0.0) | {Kind[k]: x for k, x in kinds.items()}
    sets = [(SimpleNamespace(keys=tuple(k.split(" + "))), posterior[k]) for k in keys]
    return SimpleNamespace(
        posterior=posterior, chosen=SimpleNamespace(names=names), alternatives=sets, probabilities=chances
    )


@pytest.mark.parametrize(
    ("posterior", "offered"),
    [
        ({"a": 0.75, "b": 0.25}, 0),  # three quarters to the dot
        ({"a": 0.7, "b": 0.3}, 1),
        ({"a": 0.5, "b": 0.25, "c": 0.25}, 1),
        ({"a": 0.5, "b": 0.2, "c": 0.15, "d": 0.15}, 2),
        ({"a": 0.375, "b": 0.125, "": 0.5}, 0),  # of what has a name
        ({"b": 0.5, "c": 0.5}, 2),  # the chosen one was never weighed
    ],
)
def test_alternatives_are_offered_till_what_has_a_name_is_covered(posterior, offered):
    j = given("a", posterior)
    assert covering(j, CRITERIA) == tuple(j.alternatives[:offered])


def test_nine_tenths_are_covered_where_nothing_else_is_said():
    j = given("a", {"a": 0.85, "b": 0.08, "c": 0.07})
    assert [s.keys for s, _ in covering(j)] == [("b",)]
    assert undecided(j) == (("b",),)


@pytest.mark.parametrize(
    ("chosen", "posterior", "kinds", "still_open"),
    [
        ("b + a", {"a + b": 0.75, "c": 0.25}, {}, ()),
        ("b + a", {"a + b": 0.7, "c": 0.3}, {}, (("c",),)),
        ("a", {"a": 0.5, "b": 0.2, "": 0.3}, {"NOTHING": 0.3, "UNEXPLAINED": 0.2}, ((),)),
        ("a", {"a": 0.4, "b": 0.35, "": 0.25}, {"NOTHING": 0.3, "UNEXPLAINED": 0.2}, (("b",),)),
        ("a", {"a": 0.3, "b": 0.4, "": 0.3}, {"NOTHING": 0.3, "UNEXPLAINED": 0.2}, (("b",), ())),
        ("a", {"a": 0.5, "b": 0.2, "": 0.3}, {"NOTHING": 0.2, "UNEXPLAINED": 0.2}, (("b",),)),
        ("a", {"a": 0.525, "b": 0.175, "": 0.3}, {"UNEXPLAINED": 0.3}, ()),
        ("", {"": 0.6, "a": 0.4}, {"NOTHING": 0.6}, (("a",),)),
        ("a", {"a": 0.125, "b": 0.125, "": 0.75}, {"UNEXPLAINED": 0.75}, ()),
        ("a", {"a": 0.15, "b": 0.125, "": 0.725}, {"UNEXPLAINED": 0.725}, (("b",),)),
    ],
)
def test_what_is_undecided_covers_all_accounts_that_say_what_would_come_next(chosen, posterior, kinds, still_open):
    """The base is one where what it leaves is likelier negligible than not, and it is never its own rival."""
    assert undecided(given(chosen, posterior, **kinds), CRITERIA) == still_open


def test_the_entropy_of_equal_shares_is_the_logarithm_of_their_number():
    assert entropy(given("a", dict.fromkeys("abcd", 0.25))) == pytest.approx(math.log(4))
    assert entropy(given("a", {"a": 1.0, "b": 0.0})) == 0.0
    assert entropy(given("a", {"a": 0.9, "b": 0.1})) == pytest.approx(-0.9 * math.log(0.9) - 0.1 * math.log(0.1))


def test_how_large_a_rest_is_with_what_scatters_and_is_no_noise():
    s = replace(weighed([], 0.0, rest=9e-6), scattered=(0.25, 28e-6))
    assert s.rest_size == pytest.approx(4e-3)
    assert replace(s, scattered=(0.0, 1.0)).rest_size == pytest.approx(3e-3)


def test_evidence_is_read_as_it_was_written(tmp_path):
    s = replace(weighed(["slack", "drift"], 2.5), scattered=(0.1, 1e-5), numerical=1e-3, free=("mu", "slack.x"))
    whole = Evidence((weighed([], 0.0), s), {"slack": 1}, ("p", "q"), ("r",), True, True, ("slack",))
    path = write_evidence(whole, tmp_path / "evidence.json")
    assert read_evidence(path) == whole
    assert whole.as_dict()["sets"][1]["log_evidence"] == 2.5
    plain = replace(whole, exhausted=False, simulated=False, faults=())
    assert read_evidence(write_evidence(plain, path)) == plain
    assert Evidence((), {}, (), ()) == Evidence((), {}, (), (), exhausted=False, simulated=False, faults=())
    assert (weighed([], 0.0).scattered, weighed([], 0.0).numerical, weighed([], 0.0).free) == ((0.0, 0.0), 0.0, ())


def test_files_of_before_are_read_as_what_was_meant_then(tmp_path):
    told = evidence(weighed(["slack"], 1.0)).as_dict()
    told["sets"] = [{**s, "held": None} for s in told["sets"]]
    for later in ("simulated", "faults"):
        del told[later]
    for later in ("scattered", "numerical", "free"):
        del told["sets"][0][later]
    path = tmp_path / "evidence.json"
    path.write_text(json.dumps(told))
    assert read_evidence(path) == evidence(weighed(["slack"], 1.0))


@pytest.mark.parametrize("text", [None, "{", "{}", "[]", '{"sets": [{"nothing": 1}]}'])
def test_what_is_no_evidence_is_refused(tmp_path, text):
    path = tmp_path / "evidence.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(InputError, match="no evidence of a diagnosis"):
        read_evidence(path)


def test_probabilities_of_all_kinds_are_kept_in_order():
    j = judge(evidence(weighed([], 0.0), weighed(["slack"], 1.0), weighed(["drift"], 3.0)))
    assert list(j.inclusion.values()) == sorted(j.inclusion.values(), reverse=True)
    assert j.confidence == j.probabilities[j.kind] == max(j.probabilities.values())
    assert np.isclose(sum(j.probabilities.values()), 1.0)


RECORDS = [SetEvidence, Evidence, Judgement, Beforehand, Linear, Marginal, Blocked, Widths, Weighed, Round, Start]


@pytest.mark.parametrize("record", [*RECORDS, Blocks, State, Setup])
def test_what_sets_share_is_never_changed(record):
    made = object.__new__(record)
    with pytest.raises(FrozenInstanceError):
        setattr(made, next(iter(record.__dataclass_fields__)), None)

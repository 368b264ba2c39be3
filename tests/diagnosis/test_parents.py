"""Which sets a search grows: a law that is anything smooth, and one of a few terms beside it."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.judgement.explore import Exploration
from tissuejax.diagnosis.judgement.scales import Scales

WIDE, TERMS, HUM = "law/smooth", "law/terms", "hum"


def candidate(key: str) -> SimpleNamespace:
    return SimpleNamespace(name=key.split("/")[0], widens={"law": 0.1} if key == WIDE else {})


def weighed(key: tuple[str, ...], worth: float, wide: bool) -> SimpleNamespace:
    names = tuple(k.split("/")[0] for k in key)
    evidence = SimpleNamespace(keys=key, names=names, void=False, log_evidence=worth)
    return SimpleNamespace(evidence=evidence, v=np.array([0.25 if wide else 1e-6]))


def explored(values: dict[tuple[str, ...], float], wide: bool) -> Exploration:
    bench = SimpleNamespace(candidates={k: candidate(k) for k in (WIDE, TERMS, "law/others", HUM)})
    scales = Scales(bench, None, ("slow",), None, None, {}, np.zeros(1), 1.0)
    sets = {frozenset(key): weighed(key, worth, wide) for key, worth in values.items()}
    found = Exploration(bench, Criteria(), Effort(), scales, weighed=sets)
    found.__dict__["before"] = SimpleNamespace(log_prior=lambda evidence: 0.0)
    return found


SINGLES = {(): -90.0, (WIDE,): -50.0, (TERMS,): -51.0, ("law/others",): -52.0, (HUM,): -53.0}


def test_a_law_of_a_few_terms_is_grown_beside_one_that_is_anything_smooth():
    e = explored(SINGLES, wide=False)
    assert e.ranked(1) == [{WIDE}, {HUM}]  # of each effect one, for its other forms
    assert e.near(1) == [{WIDE}, {HUM}]
    assert e.parents(1) == [{WIDE}, {TERMS}, {HUM}]


@pytest.mark.parametrize(("wide", "grown"), [(False, [{WIDE}, {TERMS}]), (True, [{WIDE}, {TERMS}, {HUM}])])
def test_what_lies_far_behind_is_grown_where_a_rest_is_strange(wide, grown):
    e = explored({**SINGLES, (HUM,): -80.0}, wide)
    assert e.parents(1) == grown


def test_pairs_are_told_apart_too_and_void_sets_are_not_grown():
    pairs = {(WIDE, HUM): -40.0, (TERMS, HUM): -41.0, ("law/others", HUM): -math.inf}
    e = explored({**SINGLES, **pairs}, wide=False)
    assert e.ranked(2) == [{WIDE, HUM}]
    assert e.parents(2) == [{WIDE, HUM}, {TERMS, HUM}]


def test_a_family_with_a_name_may_be_wide_without_it_only_beside_another_form_of_that_name():
    e = explored(SINGLES, wide=False)
    scales, c = replace(e.scales, families=("law", "slow")), Criteria()
    assert scales.priors(c).chance.tolist() == [0.0, c.unknown]
    assert scales.priors(c, (TERMS,)).chance.tolist() == [c.partly, c.unknown]
    widened = scales.priors(c, (WIDE,))
    assert widened.chance.tolist() == [0.0, c.unknown]
    assert widened.width.tolist() == [0.1, c.shares["slow"]]


def test_how_large_an_effect_may_be_goes_by_the_stress_that_it_acts_on():
    """Two blocks at 100 Pa that it leaves alone, two at 2 Pa of which each changes by 1 Pa per unit."""
    moved = np.array([[0.0], [0.0], [1.0], [1.0]])
    bench = SimpleNamespace(columns=lambda values, wanted: moved, free={"offset": SimpleNamespace(scale=7.0)})
    cut = SimpleNamespace(mean=lambda x: x)
    scales = Scales(bench, None, (), cut, None, {}, np.array([100.0, 100.0, 2.0, 2.0]), 100.0)
    one = SimpleNamespace(amplitudes=("offset",), shapes=(), grid=({},), rig=False)
    size = scales.effect_size(one, {}, Criteria())["offset"]
    assert size == pytest.approx(Criteria().usual(False) * math.sqrt((2.0**2 + 2.0**2) / (1.0**2 + 1.0**2)))

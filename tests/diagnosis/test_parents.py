"""Which sets a search grows: a law that is anything smooth, and one of a few terms beside it."""

import math
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

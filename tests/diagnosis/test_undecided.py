"""What a further recording would have to decide between: arithmetic on plain numbers."""

import math

import pytest
from weighed_sets import evidence, weighed

from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.judge import Kind, judge, undecided


@pytest.mark.parametrize(
    ("base", "slack", "drift", "still_open"),
    [
        (0.0, 30.0, -9.0, []),
        (0.0, 2.0, -9.0, [()]),
        (0.0, 4.0, 4.0, [("drift",)]),
        (3.0, 4.0, 4.0, [(), ("drift",)]),
        (-9.0, 4.0, 4.0, [("drift",)]),
        (4.0, 2.0, -9.0, []),
    ],
)
def test_a_further_recording_has_to_decide_between_what_covers_nine_tenths(base, slack, drift, still_open):
    """Odds of the base, of slack (a third of the prior of one effect) and of one form in three of drift (a ninth) are
    e^base, e^slack / 3 and e^drift / 9: 1 to 2.5 leaves the base open, 1 to 18 to 6 the base not, 20 to 18 to 6 all."""
    sets = (weighed([], base), weighed(["slack"], slack), weighed(["drift"], drift))
    j = judge(evidence(*sets), Criteria(coarse=1e12))
    odds = {(): math.exp(base), ("slack",): math.exp(slack) / 3, ("drift",): math.exp(drift) / 9}
    whole = sum(odds.values())
    assert list(undecided(j)) == still_open
    assert sum(odds[k] for k in (j.chosen.keys, *still_open)) >= 0.9 * whole
    assert sum(odds[k] for k in (j.chosen.keys, *still_open[:-1])) < 0.9 * whole or not still_open


@pytest.mark.parametrize(("rest", "still_open"), [(1e-8, [(), ("drift",)]), (1e-3, [("drift",)])])
def test_a_base_that_leaves_something_of_note_predicts_nothing_and_is_not_asked_about(rest, still_open):
    sets = (weighed([], 3.0, rest), weighed(["slack"], 4.0), weighed(["drift"], 4.5))
    assert list(undecided(judge(evidence(*sets), Criteria(coarse=1e12)))) == still_open


@pytest.mark.parametrize(("base", "still_open"), [(4.5, [("drift",)]), (6.0, [])])
def test_names_that_are_improbable_together_are_not_asked_about(base, still_open):
    """Odds of the base are 90 and 403 to 18 and 6 of the names: 24 of 114, and 24 of 427, less than a tenth."""
    sets = (weighed([], base, 1e-3), weighed(["slack"], 4.0), weighed(["drift"], 4.0))
    j = judge(evidence(*sets), Criteria(coarse=1e12))
    assert j.kind is Kind.UNEXPLAINED
    assert list(undecided(j)) == still_open

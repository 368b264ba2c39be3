"""The exact edge of every rule that takes a step or ends a descent: what lies on it, a little below, a little above."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tissuejax.estimation.ending import Ending
from tissuejax.estimation.rules import Damping, InChiSquare, InErrors, Precise, Proposal, sizes

ENDS = {True: Ending.CONVERGED, False: None}


def step(cost=10.0, promised=1.0, errors=1.0, length=1.0, whole=True, lacking=False, runs=5) -> Proposal:
    return Proposal(cost, promised, errors, length, whole, lacking, runs)


def test_a_column_is_at_least_a_thousand_millionth_of_the_longest_and_a_millionth_of_a_unit():
    jacobian = np.array([[3e5, 0.0, 1e-7, 0.0], [4e5, 0.0, 0.0, 2.0]])
    found = sizes(jacobian, np.array([1.0, 0.01, 1e3, 5.0]))
    np.testing.assert_allclose(found, [5e5, 5e-4 + 1e-4, 5e-4 + 1e-9, 2.0], rtol=1e-12)
    assert sizes(np.zeros((3, 0)), np.zeros(0)).shape == (0,)


def damping(**what) -> Damping:
    return replace(Damping(1.0, 0.25, 0.5, falls=4.0, least=0.05, doubted=3.0, rises=10.0, from_rise=0.5), **what)


def test_a_step_is_taken_and_trusted_for_more_than_its_share_of_the_promise():
    assert [damping().takes(drop, 2.0) for drop in (0.4375, 0.5, 0.5625)] == [False, False, True]
    assert [damping().after(1.0, drop, 2.0) for drop in (0.9375, 1.0, 1.0625)] == [3.0, 3.0, 0.25]
    assert damping().after(0.125, 2.0, 2.0) == 0.05
    assert [damping(trusted=None).after(held, 0.0, 2.0) for held in (1.0, 0.1)] == [0.25, 0.05]
    assert [damping().raised(held) for held in (0.04, 0.05, 0.0625)] == [0.5, 0.5, 0.625]
    assert not damping().of_start


@pytest.mark.parametrize(("cost", "ends"), [(0.99, False), (1.0, True), (1.01, True)])
def test_a_promise_of_just_the_tolerance_is_the_end(cost, ends):
    """Half of a residual of 1 can go, 0.5; half of the cost is allowed."""
    told = Precise(0.5, runs=9).here(cost, np.array([1.0, 0.0]), np.array([[1.0], [0.0]]), np.ones(1))
    assert told is ENDS[ends]


@pytest.mark.parametrize(("times", "ends"), [(0.99, True), (1.0, False), (1.01, False)])
def test_a_misfit_below_rounding_is_the_end_whatever_is_promised(times, ends):
    r = np.full(5, 1e-12)
    told = Precise(1e-9, runs=9).here(times * (1e-26 * 5), r, np.eye(5)[:, :2], np.ones(2))
    assert told is ENDS[ends]


@pytest.mark.parametrize(("small", "ends"), [(0.9e-9, True), (1.1e-9, False)])
def test_a_direction_is_seen_from_a_thousand_millionth_of_the_largest_on(small, ends):
    """In units of each column's own size: columns of 7e8 and 1, as large as each other by their size."""
    r, jacobian = np.array([0.0, 1.0, 2.0]), np.diag([7e8, small, 1.0])[:, :2]
    assert Precise(0.1, runs=9).here(2.5, r, jacobian, np.array([7e8, 1.0])) is ENDS[ends]
    assert Precise(0.1, runs=9).here(2.5, r, jacobian, np.array([7e8, small])) is None
    assert Precise(0.1, runs=9).here(2.5, r, np.zeros((3, 0)), np.ones(0)) is Ending.CONVERGED


def test_of_oblique_columns_the_promise_is_that_of_the_projection(rng):
    """Half the square of what least squares takes away, on either side of a tolerance."""
    jacobian, r = rng.normal(size=(9, 3)) * [1.0, 50.0, 0.02], rng.normal(size=9)
    left = r - jacobian @ np.linalg.lstsq(jacobian, r, rcond=None)[0]
    cost = 0.5 * float(r @ r)
    share = (cost - 0.5 * float(left @ left)) / cost
    size = np.linalg.norm(jacobian, axis=0)
    for times, ends in ((0.999, False), (1.001, True)):
        assert Precise(times * share, runs=9).here(cost, r, jacobian, size) is ENDS[ends]


CREEPS = {"cost": 95.0, "runs": 40, "points": 30, "to_beat": 1.0}


@pytest.mark.parametrize(("change", "given_up"), [
    ({}, True),
    ({"cost": 90.0}, False),  # a tenth less than it was twenty points ago
    ({"cost": 90.1}, True),
    ({"runs": 30}, False),
    ({"runs": 39}, False),
    ({"runs": 41}, False),  # looked at every ten
    ({"runs": 45}, False),
    ({"runs": 50}, True),
    ({"runs": 60}, True),
    ({"to_beat": 95.0}, False),
    ({"to_beat": 94.5}, False),  # a hundredth above it
    ({"to_beat": 94.0}, True),
    ({"points": 21}, True),
    ({"points": 20}, False),  # there is no earlier point to compare with
    ({"points": 13}, False),
    ({"points": 12}, True),  # hardly a step was taken
    ({"points": 0}, True),
    ({"points": 0, "to_beat": np.inf}, False),
])  # fmt: skip
def test_a_creeping_start_is_given_up_where_all_three_signs_agree(change, given_up):
    what = CREEPS | change
    trace = [(120.0 - i, np.zeros(1)) for i in range(what["points"], 0, -1)]
    if len(trace) >= 20:
        assert trace[-20][0] == 100.0
    rule = Precise(1e-9, 1000, what["to_beat"])
    told = rule.before(step(cost=what["cost"], runs=what["runs"]), trace)
    assert told is (Ending.BEHIND if given_up else None)
    spent = Precise(1e-9, what["runs"], what["to_beat"]).before(step(cost=what["cost"], runs=what["runs"]), trace)
    assert spent is (Ending.BEHIND if given_up else Ending.SPENT)


def test_just_a_hundredth_above_another_start_is_not_behind():
    creeping = step(cost=1.01 * 50.0, runs=40)
    assert Precise(1e-9, 1000, 50.0).before(creeping, []) is None
    assert Precise(1e-9, 1000, 50.0).before(step(cost=math.nextafter(50.5, 51), runs=40), []) is Ending.BEHIND
    assert Precise(1e-9, 1000).before(step(cost=1e300, runs=40), []) is None  # no other start


@pytest.mark.parametrize(("runs", "ending"), [(6, None), (7, Ending.SPENT), (8, Ending.SPENT)])
def test_a_search_is_spent_with_its_last_run(runs, ending):
    assert Precise(1e-3, runs=7).before(step(runs=runs), []) is ending


def test_a_gain_of_just_the_tolerance_is_little():
    rule = Precise(0.25, runs=7)
    assert [rule.little(drop, 8.0, 3, step()) for drop in (1.9375, 2.0, 2.0625)] == [True, True, False]
    assert [rule.after(quiet, 0.0, 1.0) for quiet in (2, 3, 4)] == [None, Ending.CONVERGED, Ending.CONVERGED]


@pytest.mark.parametrize(("change", "ends"), [
    ({"errors": 0.25}, False),
    ({"errors": 0.2499}, True),
    ({"errors": 0.2499, "whole": False}, False),
    ({"promised": 1e-9 * 10.0}, False),
    ({"promised": 0.999e-8}, True),
    ({"promised": 0.999e-8, "whole": False}, False),
    ({"promised": 0.0, "cost": 1.0}, True),
])  # fmt: skip
def test_a_step_of_just_the_asked_share_of_an_error_is_still_taken(change, ends):
    assert InErrors(fraction=0.25, last=0.5).before(step(**change), []) is ENDS[ends]


def test_a_step_just_as_long_as_the_last_may_be_is_not_the_last():
    rule = InErrors(fraction=0.1, last=0.5)
    assert [rule.little(9.0, 10.0, 3, step(errors=e)) for e in (0.4999, 0.5, 0.5001)] == [True, False, False]
    finer = InErrors(fraction=math.nextafter(0.1, 0), last=0.5)
    assert not finer.little(9.0, 10.0, 3, step(errors=0.4))
    assert [rule.after(quiet, 9.0, 1.0) for quiet in (0, 1, 2)] == [Ending.CONVERGED] * 3


@pytest.mark.parametrize(("promised", "lacking", "costly", "ends"), [
    (0.4999, False, True, True),
    (0.5, False, True, False),  # twice it is the tolerance
    (0.5001, False, True, False),
    (0.4999, True, True, False),
    (0.4999, False, False, False),
])  # fmt: skip
def test_of_costly_predictions_none_is_made_for_less_than_the_tolerance(promised, lacking, costly, ends):
    assert InChiSquare(1.0, costly).before(step(promised=promised, lacking=lacking), []) is ENDS[ends]
    if not costly:
        assert InChiSquare(1.0).before(step(promised=promised, lacking=lacking), []) is None


def test_a_gain_of_chi_square_of_just_the_tolerance_is_not_little():
    rule = InChiSquare(1.0)
    assert [rule.little(drop, 10.0, 15, step()) for drop in (0.4999, 0.5, 0.5001)] == [True, False, False]
    hopeless = 2e-3 * (2 * 5000.0 - 1000)  # 18, twice the drop
    assert [rule.little(drop, 5000.0, 1000, step()) for drop in (8.999, hopeless / 2, 9.001)] == [True, False, False]


@pytest.mark.parametrize(("quiet", "drop", "held", "ends"), [
    (0, 0.5, 1.0, False),
    (1, 0.5, 1.0, False),
    (2, 0.5, 1.0, True),
    (3, 0.5, 1.0, True),
    (1, 1e-3 / 2, 1.0, False),  # a thousandth of the tolerance
    (1, 0.999e-3 / 2, 1.0, True),
    (1, 0.5, 1e-4, False),
    (1, 0.5, 0.999e-4, True),
])  # fmt: skip
def test_a_descent_in_chi_square_ends_beyond_each_of_three_edges(quiet, drop, held, ends):
    assert InChiSquare(1.0).after(quiet, drop, held) is ENDS[ends]

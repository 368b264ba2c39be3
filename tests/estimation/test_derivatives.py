"""A Jacobian that is computed, corrected, doubted and computed again; what a step promises and how long it is."""

import math

import numpy as np
import pytest

from tissuejax.estimation.derivatives import AGE, Corrected, Exact
from tissuejax.estimation.descent import Ended, _proposal, descend
from tissuejax.estimation.ending import Ending
from tissuejax.estimation.methods import trust_region
from tissuejax.estimation.posed import LeastSquares
from tissuejax.estimation.reach import Reach

J = np.array([[2.0, 0.0], [0.0, 3.0], [1.0, 1.0]])


class Plane(LeastSquares):
    """Residuals J y - 1; counts its Jacobians."""

    def __init__(self, jacobian=J):
        self.slope, self.asked = jacobian, 0

    def residuals(self, y):
        return self.slope @ y - 1.0

    def jacobian(self, y):
        self.asked += 1
        return self.slope.copy()


def test_an_exact_one_is_computed_at_every_point():
    of = Exact(Plane())
    for count in (1, 2, 3):
        jacobian, seen = of.at(np.zeros(2), np.ones(2))
        assert jacobian is seen
        assert of.count == of.problem.asked == count
    of.moved(np.ones(2), np.ones(3), True)
    of.forget()
    assert of.exact
    assert not of.corrected
    assert not of.renewed(5)


def test_one_is_corrected_along_steps_that_keep_their_promise_three_times_in_a_row():
    of, step, missed = Corrected(Plane()), np.array([0.5, -1.0]), np.array([0.1, 0.2, -0.3])
    known = J
    of.at(np.zeros(2), np.ones(2))
    for k in range(AGE):
        assert (of.age, of.exact) == (k, k == 0)
        of.moved(step, missed, True)
        known = known + np.outer(missed, step) / 1.25
        np.testing.assert_allclose(of.at(step, np.ones(2))[0], known)
    assert of.count == 1
    of.moved(step, missed, True)  # a fourth time it is computed
    np.testing.assert_allclose(of.at(step, np.ones(2))[0], J)
    assert (of.count, of.age) == (2, 0)


@pytest.mark.parametrize(("step", "kept"), [([0.5, -1.0], False), ([0.0, 0.0], True)])
def test_a_step_that_broke_its_promise_or_went_nowhere_corrects_nothing(step, kept):
    of = Corrected(Plane())
    of.at(np.zeros(2), np.ones(2))
    of.moved(np.array(step), np.ones(3), kept)
    np.testing.assert_allclose(of.at(np.zeros(2), np.ones(2))[0], J)
    assert of.count == 2


def test_a_given_one_is_good_for_one_step():
    of = Corrected(Plane(), known=10 * J)
    np.testing.assert_allclose(of.at(np.zeros(2), np.ones(2))[0], 10 * J)
    assert (of.count, of.lacking, of.exact) == (0, True, False)
    of.moved(np.ones(2), np.ones(3), True)
    np.testing.assert_allclose(of.at(np.zeros(2), np.ones(2))[0], J)
    assert (of.count, of.lacking, of.exact) == (1, False, True)


def test_columns_that_vanish_at_the_start_may_come_in_and_later_ones_may_not():
    of = Corrected(Plane(J * [1.0, 0.0]))
    of.at(np.zeros(2), np.ones(2))
    assert of.lacking
    of.moved(np.ones(2), np.ones(3), True)  # nothing is corrected then
    of.at(np.zeros(2), np.ones(2))
    assert (of.count, of.lacking, of.age) == (2, False, 0)
    assert not Corrected(Plane()).lacking


@pytest.mark.parametrize(("scale", "left"), [(0.9e-5, False), (1.1e-5, True), (1.0, True)])
def test_a_column_that_is_all_error_is_left_out_of_steps(scale, left):
    """Each moved by its scale: less than 1e-5 of what the other does."""
    of = Corrected(Plane(np.eye(2)))
    jacobian, seen = of.at(np.zeros(2), np.array([1.0, scale]))
    np.testing.assert_allclose(jacobian, np.eye(2))
    np.testing.assert_allclose(seen, np.diag([1.0, float(left)]))


def test_a_better_one_is_computed_where_it_was_corrected_and_made_sharp_once():
    sharpened = []
    of = Corrected(Plane(), sharpen=lambda: sharpened.append(1))
    of.at(np.zeros(2), np.ones(2))
    assert not of.renewed(0)  # the first step may still be shortened
    of.moved(np.ones(2), np.ones(3), True)
    assert of.renewed(0)  # corrected: a true one first
    of.at(np.zeros(2), np.ones(2))
    assert (sharpened, of.count) == ([], 2)
    assert of.renewed(1)
    assert sharpened == [1]
    of.at(np.zeros(2), np.ones(2))
    assert of.count == 3
    assert not of.renewed(1)
    assert not Corrected(Plane()).renewed(1)


def test_a_proposal_by_hand():
    """At (4, 1) residuals of length 2: a step of (-2, 0.5) that a straight line takes to length 1."""
    r, foretold = np.array([2.0, 0.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0, 0.0])
    reach = Reach(np.full(2, -9.0), np.full(2, 9.0), np.array([1.0, 5.0]), longest=4.0)
    found = _proposal(np.array([4.0, 1.0]), np.array([-2.0, 0.5]), r, 2.0, foretold, 1e-3, reach, True, 17)
    assert found.cost == 2.0
    assert found.promised == pytest.approx(1.5)
    assert found.errors == pytest.approx(math.sqrt(5) / math.sqrt(2))  # 4 of two degrees of freedom
    assert found.length == pytest.approx(0.5)  # 2 of 4, 0.5 of 5
    assert (found.whole, found.lacking, found.runs) == (True, True, 17)
    held = _proposal(np.ones(2), np.ones(2), r, 2.0, foretold, 1.1e-3, reach, False, 1)
    long = _proposal(np.ones(2), np.array([3.97, 0.0]), r, 2.0, foretold, 0.0, reach, False, 1)
    assert (held.whole, long.whole) == (False, False)
    few = _proposal(np.ones(2), np.ones(2), r[:2], 2.0, foretold[:2], 0.0, reach, False, 1)
    assert few.errors == pytest.approx(math.sqrt(5) / 2)  # one degree at least


def test_a_linear_problem_is_solved_and_told_of_point_by_point():
    problem, told = Plane(), []
    found = descend(problem, np.array([5.0, -4.0]), trust_region(2), lambda *point: told.append(point))
    best = np.linalg.lstsq(J, np.ones(3), rcond=None)[0]
    assert found.converged
    assert found.y == pytest.approx(best, abs=1e-6)
    assert found.cost == pytest.approx(0.5 * np.sum((J @ best - 1) ** 2))
    np.testing.assert_allclose(found.residuals, J @ found.y - 1)
    assert found.jacobians == problem.asked
    assert [(cost, tuple(y)) for _, cost, y in told] == [(cost, tuple(y)) for cost, y in found.trace]
    assert told[0][:2] == (1, pytest.approx(0.5 * np.sum((J @ [5.0, -4.0] - 1) ** 2)))
    costs = [cost for _, cost, _ in told]
    assert costs == sorted(costs, reverse=True)
    assert told[-1][0] <= found.runs


def test_an_ending_by_its_runs_says_how_many():
    spent = Ended(np.zeros(1), 1.0, Ending.SPENT, np.zeros(1), np.zeros((1, 1)), 12, 3)
    assert spent.reason == "no convergence after 12 evaluations"
    assert not spent.converged
    other = Ended(np.zeros(1), 1.0, Ending.CONVERGED, np.zeros(1), np.zeros((1, 1)), 12, 3)
    assert other.reason == str(Ending.CONVERGED)

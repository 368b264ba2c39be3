"""Where a descent ends, by each rule: numbers on either side of what its text says."""

import numpy as np
import pytest

from tissuejax.estimation.ending import Ending
from tissuejax.estimation.rules import HOPELESS, InChiSquare, InErrors, Precise, Proposal


def step(cost=10.0, promised=1.0, errors=1.0, length=1.0, whole=True, lacking=False, runs=5) -> Proposal:
    return Proposal(cost, promised, errors, length, whole, lacking, runs)


@pytest.mark.parametrize(
    ("tolerance", "along", "ends"),
    [
        (1e-6, 0.9e-3, True),  # half its square, of a misfit of a half
        (1e-6, 1.1e-3, False),
        (1e-8, 0.9e-3, False),
    ],
)
def test_where_a_straight_line_promises_less_than_a_share_of_the_misfit_it_is_the_end(tolerance, along, ends):
    """Residuals of length one, `along` of it where the one column leads."""
    r = np.array([along, np.sqrt(1 - along**2), 0.0])
    jacobian = np.array([[3.0], [0.0], [0.0]])
    told = Precise(tolerance, runs=9).here(0.5, r, jacobian, np.array([3.0]))
    assert told is (Ending.CONVERGED if ends else None)


def test_a_direction_that_is_rounding_promises_nothing():
    """Two columns that differ by 1e-10 along the second entry, where the residual lies."""
    r = np.array([0.0, 1.0, 1.0])
    for apart, ends in ((1e-10, True), (1e-6, False)):
        jacobian = np.array([[1.0, 1.0], [0.0, apart], [0.0, 0.0]])
        told = Precise(1e-6, runs=9).here(1.0, r, jacobian, np.ones(2))
        assert told is (Ending.CONVERGED if ends else None)
    nothing = Precise(1e-6, runs=9).here(1.0, r, np.zeros((3, 2)), np.ones(2))
    assert nothing is Ending.CONVERGED  # no column does anything


def test_a_misfit_of_rounding_is_the_end():
    r, jacobian = np.full(4, 1e-13), np.eye(4)[:, :1]
    assert Precise(1e-9, runs=9).here(0.9 * 4e-26, r, jacobian, np.ones(1)) is Ending.CONVERGED
    assert Precise(1e-9, runs=9).here(1.1 * 4e-26, r, jacobian, np.ones(1)) is None


def test_a_precise_descent_ends_with_its_runs_or_after_three_steps_of_little_gain():
    rule = Precise(1e-3, runs=7)
    assert rule.before(step(runs=6), []) is None
    assert rule.before(step(runs=7), []) is Ending.SPENT
    assert rule.little(0.9e-2, 10.0, 3, step())
    assert not rule.little(1.1e-2, 10.0, 3, step())
    assert [rule.after(quiet, 0.0, 1.0) for quiet in (1, 2, 3, 4)] == [None, None, Ending.CONVERGED, Ending.CONVERGED]
    assert rule.stuck is Ending.CONVERGED
    assert rule.shortest == 1e-14


def test_in_standard_errors_a_whole_step_that_is_short_is_the_end():
    rule = InErrors(fraction=0.2, last=0.5)
    assert rule.here(1.0, np.ones(2), np.ones((2, 1)), np.ones(1)) is None
    assert rule.before(step(errors=0.19), []) is Ending.CONVERGED
    assert rule.before(step(errors=0.21), []) is None
    assert rule.before(step(errors=0.19, whole=False), []) is None
    assert rule.before(step(errors=0.3, promised=0.9e-8), []) is Ending.CONVERGED  # less than 1e-9 of the cost of 10
    assert rule.before(step(errors=0.3, promised=1.1e-8), []) is None
    assert rule.little(0.0, 10.0, 3, step(errors=0.49))
    assert not rule.little(0.0, 10.0, 3, step(errors=0.51))
    assert not rule.little(0.0, 10.0, 3, step(errors=0.49, whole=False))
    assert not InErrors(fraction=0.09, last=0.5).little(0.0, 10.0, 3, step(errors=0.49))  # asked for more than that
    assert InErrors(fraction=0.1, last=0.5).little(0.0, 10.0, 3, step(errors=0.49))
    assert rule.after(1, 0.0, 1.0) is Ending.CONVERGED
    assert (rule.stuck, rule.shortest) == (Ending.NOTHING_BETTER, 0.0)


def test_in_chi_square_two_steps_of_little_gain_are_the_end():
    """Chi-square is twice the cost. Of 10 with 15 residuals 5 exceed noise: too little to be hopeless."""
    rule = InChiSquare(tolerance=0.1)
    assert rule.here(1.0, np.ones(2), np.ones((2, 1)), np.ones(1)) is None
    assert rule.before(step(promised=0.0), []) is None  # a prediction costs nothing
    assert rule.little(0.049, 10.0, 15, step())
    assert not rule.little(0.051, 10.0, 15, step())
    assert pytest.approx(3.97) == HOPELESS * (2 * 1000.0 - 15)
    assert rule.little(1.98, 1000.0, 15, step())  # of what exceeds noise
    assert not rule.little(1.99, 1000.0, 15, step())
    assert rule.after(1, 0.04, 1.0) is None
    assert rule.after(2, 0.04, 1.0) is Ending.CONVERGED
    assert rule.after(1, 0.49e-4, 1.0) is Ending.CONVERGED  # a thousandth of the tolerance
    assert rule.after(1, 0.51e-4, 1.0) is None
    assert rule.after(1, 0.04, 0.9e-4) is Ending.CONVERGED  # a step of a true Jacobian, hardly damped
    assert rule.after(1, 0.04, 1.1e-4) is None
    assert (rule.stuck, rule.shortest) == (Ending.CONVERGED, 1e-9)


def test_where_predictions_are_costly_none_is_made_for_a_step_that_promises_too_little():
    rule = InChiSquare(tolerance=0.1, costly=True)
    assert rule.before(step(promised=0.049), []) is Ending.CONVERGED
    assert rule.before(step(promised=0.051), []) is None
    assert rule.before(step(promised=0.049, lacking=True), []) is None

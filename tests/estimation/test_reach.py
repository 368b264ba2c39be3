"""Steps that must stay inside something, against scipy's minimiser with constraints."""

import numpy as np
import pytest
from scipy.optimize import minimize

from tissuejax.estimation.reach import TURN, Reach, Whole


@pytest.mark.parametrize(("most", "size"), [(0.8, 1.0), (0.5, 1.0), (0.5, 1e5)])
def test_parts_that_would_be_more_than_the_whole_become_just_that_as_well_as_may_be(rng, most, size):
    """min |T s - aim|^2 + |damped s|^2 where two coordinates may together not exceed a whole; a second whole is far."""
    triangle, damped = np.triu(rng.normal(size=(5, 5))) + 2 * np.eye(5), np.full(5, 0.3)
    y, aim = np.array([0.2, 0.1, -0.4, 0.05, 0.05]), 3.0 * rng.normal(size=5)
    aim[:2] = 2.0
    reach = Reach(np.full(5, -2.0), np.full(5, 2.0), np.ones(5), wholes=(Whole((0, 1), most), Whole((3, 4), 50.0)))

    def cost(s):
        return np.sum((triangle @ s - aim) ** 2) + np.sum((damped * s) ** 2)

    free = minimize(cost, np.zeros(5), bounds=[(-2 - v, 2 - v) for v in y], tol=1e-14)
    assert np.sum((y + free.x)[:2]) > most, "the free step would exceed the whole"
    held = minimize(
        cost, np.zeros(5), bounds=[(-2 - v, 2 - v) for v in y], tol=1e-14, method="SLSQP",
        constraints={"type": "ineq", "fun": lambda s: most - np.sum((y + s)[:2])},
    )  # fmt: skip
    found = reach.trial(size * triangle, size * aim, size * damped, y, 0)  # whatever the size of the residuals
    assert found == pytest.approx(y + held.x, abs=1e-5)
    assert np.sum(found[:2]) == pytest.approx(most, abs=1e-12)


def test_a_free_step_is_the_normal_equations(rng):
    triangle, damped, aim = (
        np.triu(rng.normal(size=(3, 3))) + 2 * np.eye(3),
        np.array([0.1, 0.5, 1.0]),
        rng.normal(size=3),
    )
    y = np.array([1.0, -2.0, 0.5])
    by_hand = np.linalg.solve(triangle.T @ triangle + np.diag(damped**2), triangle.T @ aim)
    assert Reach.anywhere(3).trial(triangle, aim, damped, y, 0) == pytest.approx(y + by_hand)


def test_the_box_of_a_step_ends_at_bounds_at_the_longest_step_and_for_angles_sooner_each_time():
    turns = np.array([False, False, True])
    reach = Reach(np.array([0.0, -9.0, -9.0]), np.array([1.0, 9.0, 9.0]), np.ones(3), longest=2.0, turns=turns)
    for attempt, turn in ((0, TURN), (1, TURN / 4), (2, TURN / 16)):
        low, high = reach.box(np.array([0.25, 8.0, 0.0]), attempt)
        assert low == pytest.approx([-0.25, -2.0, -turn])
        assert high == pytest.approx([0.75, 1.0, turn])


def test_parts_are_shrunk_in_proportion_and_only_where_they_exceed_the_whole():
    whole = Whole((0, 2), 0.6)
    y = np.array([0.3, 5.0, 0.9])
    assert whole.excess(y) == pytest.approx(0.6)
    assert whole.shrunk(y) == pytest.approx([0.15, 5.0, 0.45])
    inside = np.array([0.1, 5.0, 0.2])
    assert whole.shrunk(inside) == pytest.approx(inside)

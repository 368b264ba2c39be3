"""One descent, three choices of its parts: each reaches the least-squares solution that scipy finds, in its own way."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from tissuejax.errors import UnstableSimulation
from tissuejax.estimation.derivatives import AGE, NOTHING, Corrected
from tissuejax.estimation.descent import descend
from tissuejax.estimation.ending import Ending
from tissuejax.estimation.methods import broyden, marquardt, trust_region
from tissuejax.estimation.posed import LeastSquares, half_square
from tissuejax.estimation.reach import Reach, bounded
from tissuejax.estimation.rules import CREEP, Damping, Precise, Proposal

T = np.linspace(0, 3, 120)
DATA = 2.0 * np.exp(-1.3 * T) + 0.01 * np.random.default_rng(3).normal(size=T.size)
START = np.log([4.0, 0.5])


class Decay(LeastSquares):
    """a exp(-b t) against noisy data, in logarithms of a and b; counts what is asked."""

    def __init__(self):
        self.asked = {"residuals": 0, "jacobian": 0}

    def residuals(self, y):
        self.asked["residuals"] += 1
        a, b = np.exp(y)
        return (a * np.exp(-b * T) - DATA) / 0.01

    def jacobian(self, y):
        self.asked["jacobian"] += 1
        a, b = np.exp(y)
        one = a * np.exp(-b * T) / 0.01
        return np.stack([one, -b * T * one], 1)


def boxed(low, high, **options):
    reach = Reach(np.array(low, float), np.array(high, float), np.ones(2))
    return broyden(reach, 40, 1e-6, **options)


@pytest.mark.parametrize(
    ("method", "error"), [(trust_region(2), 1e-3), (marquardt(2, fraction=1e-3), 1e-2), (boxed([-9, -9], [9, 9]), 1e-2)]
)
def test_every_method_reaches_the_solution_of_scipy(method, error):
    problem = Decay()
    found = descend(problem, START, method)
    answer = least_squares(Decay().residuals, START, Decay().jacobian, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    J = Decay().jacobian(answer.x)
    std = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    assert found.ending is Ending.CONVERGED
    assert (np.abs(found.y - answer.x) < error * std).all()
    assert found.cost == pytest.approx(answer.cost, rel=1e-4)
    assert (found.runs, found.jacobians) == (problem.asked["residuals"], problem.asked["jacobian"])
    assert [c for c, _ in found.trace] == sorted((c for c, _ in found.trace), reverse=True)


def test_a_corrected_jacobian_is_computed_less_often():
    few, many = descend(Decay(), START, boxed([-9, -9], [9, 9])), descend(Decay(), START, trust_region(2))
    assert few.jacobians < many.jacobians


def test_what_rests_on_a_bound_solves_the_bounded_problem():
    low, high = [-9.0, -9.0], [9.0, np.log(1.1)]
    found = descend(Decay(), START, boxed(low, high))
    answer = least_squares(Decay().residuals, START, Decay().jacobian, bounds=(low, high), xtol=1e-14, ftol=1e-14)
    assert found.y[1] == high[1]
    assert found.y[0] == pytest.approx(answer.x[0], abs=1e-4)


def test_a_jacobian_from_elsewhere_is_good_for_one_step_only():
    wrong = np.zeros((T.size, 2))
    wrong[:, 0] = 1.0
    found = descend(Decay(), START, boxed([-9, -9], [9, 9], known=wrong))
    right = descend(Decay(), START, trust_region(2))
    assert found.cost == pytest.approx(right.cost, rel=1e-4)


class Columns(LeastSquares):
    """Three columns of lengths 5, 13 and 25, whatever the place."""

    J = np.array([[3.0, 5.0, 7.0], [4.0, 12.0, -24.0]])

    def residuals(self, y):
        return self.J @ y

    def jacobian(self, y):
        return self.J


def test_a_column_that_is_nothing_but_error_calls_for_no_step():
    """Below a hundred-thousandth of the largest effect, length times scale: here of 5 x 2."""
    source = Corrected(Columns())
    scale = np.array([2.0, 0.9 * NOTHING * 10 / 13, 1.1 * NOTHING * 10 / 25])
    whole, cleared = source.at(np.zeros(3), scale)
    np.testing.assert_array_equal(whole, Columns.J)
    np.testing.assert_array_equal(cleared, Columns.J * [1, 0, 1])


def test_a_correction_foretells_the_step_and_leaves_what_is_across_it(rng):
    """Broyden's: J s grows by what was missed, J v stays for v across s; three in a row, then it is computed anew."""
    source, y, ones = Corrected(Columns()), np.zeros(3), np.ones(3)
    before = source.at(y, ones)[0]
    for age in range(AGE):
        step, missed = rng.normal(size=3), 0.01 * rng.normal(size=2)
        source.moved(step, missed, kept=True)
        after = source.at(y, ones)[0]
        np.testing.assert_allclose((after - before) @ step, missed, atol=1e-14)
        across = np.cross(step, [1.0, 2.0, 3.0])
        np.testing.assert_allclose(after @ across, before @ across, atol=1e-12)
        assert (source.age, source.count, source.exact) == (age + 1, 1, False)
        before = after
    for kept, count in ((True, 2), (False, 3)):  # a fourth correction; then a step that broke its promise
        source.moved(step, missed, kept)
        np.testing.assert_array_equal(source.at(y, ones)[0], Columns.J)
        assert (source.age, source.count, source.exact) == (0, count, True)


class Cliff(Decay):
    """The same, but nothing can be predicted beyond b = 1.6: `how` says in which way."""

    def __init__(self, how):
        super().__init__()
        self.how = how

    def residuals(self, y):
        if y[1] > np.log(1.6):
            if self.how == "raises":
                raise UnstableSimulation("blew up")
            return np.full(T.size, np.nan)
        return super().residuals(y)


@pytest.mark.parametrize("how", ["raises", "nan"])
@pytest.mark.parametrize("method", [trust_region(2), marquardt(2), boxed([-9, -9], [9, 9])])
def test_where_nothing_can_be_predicted_no_step_is_taken(method, how):
    found = descend(Cliff(how), np.log([4.0, 0.2]), method)
    assert found.converged
    assert np.exp(found.y[1]) == pytest.approx(1.3, abs=0.05)


def test_damping_follows_what_a_step_kept_of_its_promise():
    damping = Damping(1.0, 0.1, trusted=0.5, falls=4.0, least=0.05, doubted=3.0, rises=10.0, from_rise=0.5)
    assert [damping.takes(drop, 2.0) for drop in (0.19, 0.21)] == [False, True]
    assert damping.after(1.0, 1.1, 2.0) == 1.0 / 4  # more than half of it: held back less
    assert damping.after(0.1, 1.1, 2.0) == 0.05  # but not below the least
    assert damping.after(1.0, 0.9, 2.0) == 3.0  # less: held back more
    assert damping.raised(1.0) == 10.0
    assert damping.raised(0.01) == 0.5


def test_endings_are_sentences():
    nowhere = descend(Cliff("nan"), np.log([4.0, 2.0]), trust_region(2))
    assert nowhere.reason == "the model has no finite prediction at the start"
    cut = descend(Decay(), START, trust_region(2, runs=3))
    assert cut.ending is Ending.SPENT
    assert cut.reason == "no convergence after 3 evaluations"
    assert not cut.converged

    class Steep(Decay):
        def jacobian(self, y):
            return np.full((T.size, 2), np.inf)

    assert descend(Steep(), START, marquardt(2)).ending is Ending.NO_DERIVATIVE


def test_a_start_that_creeps_behind_another_is_given_up():
    """Along a curved valley a thousand times as steep as it is long every step gains little."""

    class Valley(LeastSquares):
        def residuals(self, y):
            return np.array([1 - y[0], 1e3 * (y[1] - y[0] ** 2)])

        def jacobian(self, y):
            return np.array([[-1.0, 0.0], [-2e3 * y[0], 1e3]])

    start = np.array([-6.0, 36.0])
    alone = descend(Valley(), start, trust_region(2, runs=4000))
    behind = descend(Valley(), start, trust_region(2, runs=4000, to_beat=1e-3))
    assert alone.converged
    assert alone.y == pytest.approx([1, 1], abs=1e-6)
    assert behind.ending is Ending.BEHIND
    assert behind.runs < 0.5 * alone.runs


@pytest.mark.parametrize(("cost", "runs", "points", "given_up"), [
    (50.0, CREEP, 30, False),  # a tenth and more below where it was half the watch ago
    (54.1, CREEP, 30, True),
    (54.1, CREEP - 10, 30, False),  # not watched yet
    (0.001, CREEP, 30, False),  # below the other's
    (54.1, CREEP, CREEP // 2 + 1, True),
    (54.1, CREEP, CREEP // 2, False),  # no point so far back to compare with
    (54.1, CREEP, CREEP // 3 - 1, True),  # few steps were taken at all
])  # fmt: skip
def test_a_creeping_start_is_told_by_what_half_the_watch_gained(cost, runs, points, given_up):
    """60 then, and another start has come to 1: it has to have come below 54."""
    trace = [(60.0, START)] * points
    trace[-CREEP // 2 + 1 :] = [(cost, START)] * min(points, CREEP // 2 - 1)
    step = Proposal(cost, 1.0, 1.0, 1.0, True, False, runs)
    told = Precise(1e-9, runs=1000, to_beat=1.0).before(step, trace)
    assert told is (Ending.BEHIND if given_up else None)


def test_bounded_steps_are_those_of_scipy(rng):
    from scipy.optimize import lsq_linear

    a, b = rng.normal(size=(30, 4)), rng.normal(size=30)
    for low, high in ((-np.inf, np.inf), (-0.05, 0.05), (0.0, 0.02)):
        step = bounded(a, b, np.full(4, low), np.full(4, high))
        assert step == pytest.approx(lsq_linear(a, b, (low, high), tol=1e-14).x, abs=1e-7)


def test_half_the_squares_of_what_is_not_finite_are_infinite():
    assert half_square(np.array([3.0, 4.0])) == 12.5
    assert half_square(np.array([1.0, np.nan])) == np.inf
    assert half_square(np.array([1e200, 1.0])) == np.inf

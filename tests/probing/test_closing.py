"""The last steps of a probing's fit, on a line whose answer is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from tissuejax.estimation.numerical import Changes
from tissuejax.fitting.closing import close, reach

TRUE = np.array([3.0, 2.0])


class Line:
    """A problem of two parameters whose residuals are J (x - TRUE) and what J does not reach."""

    free = ("slope", "height")
    predictor = SimpleNamespace(settings=None)

    def __init__(self, rng, lower=(-9.0, -9.0)):
        self.J = rng.normal(size=(30, 2)) * [1.0, 4.0]
        across = rng.normal(size=30)
        self.across = across - self.J @ np.linalg.lstsq(self.J, across)[0]
        self.lower, self.asked = dict(zip(self.free, lower, strict=True)), []

    def bound(self, path):
        return self.lower[path], 9.0

    def values(self, x):
        return x

    def at(self, x):
        return self.J @ (x - TRUE) + self.across

    def all(self, predictors, x):
        """As simulations would: what is asked is noted."""
        self.asked.append(x)
        return [x for _ in predictors]

    def misfit(self, predicted, values):
        return self.at(predicted)

    def closed(self, start, jacobian, **more):
        return close(self, start, jacobian, Changes(self.at(start), self.at(start), {}), self, False, **more)


def test_one_chord_step_leads_to_the_solution_where_the_derivatives_are_right(rng):
    line, taken = Line(rng), []
    end = line.closed(TRUE + [5.0, -2.5], line.J, on_accept=lambda x, cost: taken.append((x, cost)))
    assert end.x == pytest.approx(TRUE)
    assert end.left == pytest.approx(0.0, abs=1e-9)
    ((x, cost),) = taken
    assert x == pytest.approx(TRUE)
    assert cost == pytest.approx(0.5 * line.across @ line.across)


def test_no_step_is_taken_where_it_would_be_shorter_than_a_standard_error(rng):
    line = Line(rng)
    std = np.sqrt(np.diag(np.linalg.inv(line.J.T @ line.J)) * (line.across @ line.across) / 28)
    near = line.closed(TRUE + 0.3 * std, line.J)
    assert line.asked == []
    assert near.x == pytest.approx(TRUE + 0.3 * std)


def test_a_step_that_would_pass_a_bound_ends_there(rng):
    line = Line(rng, lower=(4.0, -9.0))
    end = line.closed(np.array([8.0, -0.5]), line.J)
    assert end.x == pytest.approx([4.0, 2.0])


@pytest.mark.parametrize("error", [0.3, 4.0])
def test_derivatives_that_lead_astray_are_taken_again_where_it_was_best(rng, error):
    """Steeper than they are, a step goes 0.3 of the way; flatter, four times as far, where it is worse."""
    line, derived = Line(rng), []
    wrong = line.J / error

    def derive(x):
        derived.append(x)
        return line.J

    start = TRUE + [5.0, -2.5]
    end = line.closed(start, wrong, derive=derive)
    assert len(derived) == 1
    best = TRUE + (1 - error) * (start - TRUE) if error < 1 else start
    assert derived[0] == pytest.approx(best)
    assert end.x == pytest.approx(TRUE)
    assert line.closed(start, wrong).x == pytest.approx(best), "without them it ends there"


def test_reach_is_the_step_in_standard_errors(rng):
    x = np.linspace(-1, 1, 400)
    J = np.stack([np.ones_like(x), x], 1)
    r = J @ [0.3, 0.0] + rng.normal(0, 0.1, x.size)
    std = np.sqrt(np.linalg.inv(J.T @ J)[0, 0] * (r @ r) / (x.size - 2))
    assert reach(J, J @ [0.3, 0.0], r) == pytest.approx(0.3 / std)  # orthogonal columns: the other has no share
    assert reach(J, r - J @ np.linalg.lstsq(J, r)[0], r) == pytest.approx(0.0, abs=1e-9)


def test_what_one_sample_leaves_over_speaks_for_the_noise():
    """Two samples and one parameter: all of the misfit's square is one degree of freedom. With none to spare, one
    is taken, not none."""
    assert reach(np.array([[2.0], [0.0]]), np.array([3.0, 4.0])) == pytest.approx(3 / 5)
    assert reach(np.array([[2.0]]), np.array([3.0]), np.array([6.0])) == pytest.approx(3 / 6)

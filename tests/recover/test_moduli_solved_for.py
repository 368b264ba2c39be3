"""Variable projection on made-up residuals: moduli, forecast and Jacobian in dense matrices, runs counted by hand."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import nnls

from tissuejax.estimation.ending import Ending
from tissuejax.fitting import separable as room
from tissuejax.fitting.separable import NotSeparable, Projection, projected_descent, separable

T = np.linspace(0, 3, 40)
DATA = 2.0 * np.exp(-1.3 * T) + 0.5 + 0.05 * np.random.default_rng(7).normal(size=40)


class Decay:
    """a exp(-k t) + c - data with moduli c, a >= 0 and k between 0 and 9; what is told last happens at every run."""

    free = ("c", "k", "a")
    moduli = ("c", "a")
    loss, stiffness, priors = "squares", 0.0, {}

    def __init__(self, low=(0.0, 0.0), high=(np.inf, np.inf), change=lambda n, r, J: (r, J)):
        self.runs, self.ends, self.change = 0, dict(zip(self.moduli, zip(low, high, strict=True), strict=True)), change

    def bound(self, path):
        return self.ends.get(path, (0.0, 9.0))

    def scale(self, path):
        return 1.0

    def sticks(self, free):
        assert tuple(free) == tuple(p for p in self.free if p not in self.moduli)
        return ()

    def values(self, x):
        return dict(zip(self.free, map(float, x), strict=True))

    def at(self, x):
        c, k, a = x
        return c + a * np.exp(-k * T) - DATA

    def linearised(self, values):
        self.runs += 1
        c, k, a = (values[p] for p in self.free)
        e = np.exp(-k * T)
        return self.change(self.runs, self.at((c, k, a)), np.stack([np.ones(40), -a * T * e, e], 1))


def decay(*given, **options) -> Any:
    return Decay(*given, **options)


def k_of(y: float) -> float:
    return 9 / (1 + np.exp(-y))


@pytest.mark.parametrize(("what", "worth"), [
    ({}, True),
    ({"loss": "cauchy"}, False),
    ({"stiffness": 1.0}, False),
    ({"moduli": ()}, False),
    ({"priors": {"a": (1.0, 1.0)}}, False),
    ({"priors": {"k": (1.0, 1.0)}}, True),
])  # fmt: skip
def test_projection_is_for_plain_squares_of_free_moduli(what, worth):
    usual = {"loss": "squares", "stiffness": 0.0, "moduli": ("c", "a"), "priors": {}}
    posed: Any = SimpleNamespace(**usual | what)
    assert separable(posed) is worth


def test_a_trial_solves_for_the_moduli_and_its_jacobian_is_kaufman_s():
    posed = decay()
    of = Projection(posed, np.array([3.0, 1.0, 5.0]))
    y = np.array([-1.5])
    k = k_of(-1.5)
    C = np.stack([np.ones(40), np.exp(-k * T)], 1)
    moduli, norm = nnls(C, DATA)
    r = of.residuals(y)
    np.testing.assert_allclose(r, C @ moduli - DATA, atol=1e-12)
    assert (of.n, posed.runs) == (2, 2)
    assert of.best == pytest.approx(norm**2)
    np.testing.assert_allclose(of.x, [moduli[0], k, moduli[1]], rtol=1e-10)
    slope = 9 * np.exp(1.5) / (1 + np.exp(1.5)) ** 2
    column = -moduli[1] * T * np.exp(-k * T) * slope
    expected = column - C @ np.linalg.lstsq(C, column, rcond=None)[0]
    np.testing.assert_allclose(of.jacobian(y)[:, 0], expected, atol=1e-10)
    worse = of.residuals(np.array([3.0]))  # foretold, and not predicted again
    C = np.stack([np.ones(40), np.exp(-k_of(3.0) * T)], 1)
    np.testing.assert_allclose(worse, C @ nnls(C, DATA)[0] - DATA, atol=1e-9)
    assert float(worse @ worse) > norm**2
    assert (of.n, of.best) == (3, pytest.approx(norm**2))
    assert of.x[1] == pytest.approx(k)
    np.testing.assert_allclose(of.points[np.array([3.0]).tobytes()][[0, 2]], nnls(C, DATA)[0], atol=1e-9)


@pytest.mark.parametrize(("low", "high", "held"), [
    ((0.0, 0.0), (0.7, 1.1), [0.7, 1.1]), ((1.3, 1.2), (np.inf, np.inf), [1.3, 1.2]),
])  # fmt: skip
def test_a_modulus_at_its_bound_is_that_very_number_and_no_longer_projected_out(low, high, held):
    of = Projection(decay(low, high), np.array([1.4, 1.0, 0.5]))
    y = np.array([-1.0])
    r = of.residuals(y)
    assert of.x[[0, 2]].tolist() == held
    np.testing.assert_allclose(r, held[0] + held[1] * np.exp(-k_of(-1.0) * T) - DATA, atol=1e-12)
    slope = 9 * np.exp(1.0) / (1 + np.exp(1.0)) ** 2
    np.testing.assert_allclose(of.jacobian(y)[:, 0], -held[1] * T * np.exp(-k_of(-1.0) * T) * slope, rtol=1e-9)


@pytest.mark.parametrize(("by", "linear"), [(0.98, True), (1.02, False)])
def test_what_differs_from_the_straight_line_by_a_millionth_is_not_linear(by, linear):
    """Of the forecast's norm and a thousandth a sample."""
    k = k_of(-1.5)
    C = np.stack([np.ones(40), np.exp(-k * T)], 1)
    norm = nnls(C, DATA)[1]
    off = np.zeros(40)
    off[7] = by * 1e-6 * (norm + 1e-3 * np.sqrt(40))
    posed = decay(change=lambda n, r, J: (r + (n == 2) * off, J))
    of = Projection(posed, np.array([3.0, 1.0, 5.0]))
    if linear:
        np.testing.assert_allclose(of.residuals(np.array([-1.5])), C @ nnls(C, DATA)[0] - DATA + off, atol=1e-12)
    else:
        with pytest.raises(NotSeparable):
            of.residuals(np.array([-1.5]))


NAN = {"r": lambda r, J: (r * np.nan, J), "J": lambda r, J: (r, J + np.inf), "big": lambda r, J: (r * 1e200, J)}


@pytest.mark.parametrize("what", NAN)
@pytest.mark.parametrize("run", [1, 2, 3, 4])
def test_where_nothing_can_be_predicted_residuals_are_infinite_or_it_is_given_up(what, run):
    """In the second run, at the first moduli that were solved for, it is; in the fourth they are worse than others."""
    posed = decay(change=lambda n, r, J: NAN[what](r, J) if n == run else (r, J))
    of = Projection(posed, np.array([3.0, 1.0, 5.0]))
    first, second = np.array([-3.0]), np.array([-1.7])
    if run == 2:
        with pytest.raises(NotSeparable):
            of.residuals(first)
        return
    assert np.isinf(of.residuals(first)).all() == (run == 1)
    if run > 2:
        assert np.isinf(of.residuals(second)).all()
        assert of.x[1] == pytest.approx(k_of(-3.0))
    assert posed.runs == of.n == run


def test_moduli_that_do_the_same_share_it_and_one_that_does_nothing_stays():
    """Least squares of least norm in units of each column's own size; from a million millionth on they differ."""
    solver: Any = SimpleNamespace(low=np.full(3, -np.inf), high=np.full(3, np.inf))
    e = np.eye(4)
    for apart, split in ((1.9e-12, False), (2.1e-12, True)):
        columns = np.stack([1e3 * e[0], e[0] + apart * e[1], 0 * e[0]], 1)
        target = e[0] * 5.0 + e[1] * apart
        solved, left, inside = Projection.solve(
            solver, columns @ [0.0, 0.0, 2.0] - target, columns, np.array([0, 0, 2])
        )
        found = [solved[0] * 1e3, solved[1], solved[2]]
        np.testing.assert_allclose(found, [4.0, 1.0, 0.0] if split else [2.5, 2.5, 0.0], rtol=2e-3, atol=1e-9)
        np.testing.assert_allclose(left, columns @ solved - target, atol=1e-12)
        assert inside.all()


def test_just_on_a_bound_that_is_the_solution_without_it_nothing_is_held():
    """Columns of 4 and 1/4; without a bound each modulus is its own target."""
    solver: Any = SimpleNamespace(low=np.array([2.0, -9.0]), high=np.array([9.0, 3.0]))
    J, now = np.diag([4.0, 0.25]), np.array([5.0, 0.0])
    solved, left, inside = Projection.solve(solver, J @ (now - [2.0, 3.0]), J, now)
    assert solved.tolist() == [2.0, 3.0]
    assert left.tolist() == [0.0, 0.0]
    assert inside.tolist() == [True, True]
    for target, expected, held in (([1.0, 1.0], [2.0, 1.0], [False, True]), ([4.0, 8.0], [4.0, 3.0], [True, False])):
        solved, left, inside = Projection.solve(solver, J @ (now - target), J, now)
        np.testing.assert_allclose(solved, expected, rtol=1e-12)
        np.testing.assert_allclose(left, J @ (np.array(expected) - target), atol=1e-12)
        assert inside.tolist() == held


@pytest.mark.parametrize(("apart", "left"), [(1.9e-12, 1), (2.1e-12, 0)])
def test_columns_of_moduli_count_from_a_million_millionth_on(apart, left):
    """Columns of unit length that differ by `apart`: singular values sqrt(2) and apart / sqrt(2)."""
    of: Any = SimpleNamespace(linear=np.array([True, False, True]), low=np.zeros(2), high=np.full(2, 9.0))
    jacobian = np.zeros((3, 3))
    jacobian[0], jacobian[1, 2], jacobian[1:, 1] = [7.0, 3.0, 1.0], apart, [1.0, 1.0]
    found = Projection._projected(of, jacobian, np.ones(3))
    np.testing.assert_allclose(found[:, 0], [0.0, left, 1.0], atol=1e-3)
    jacobian[:, 0] = 0.0  # a modulus that does nothing takes nothing away
    found = Projection._projected(of, jacobian, np.ones(3))
    np.testing.assert_allclose(found[:, 0], [0.0, 1.0, 1.0], atol=1e-3)
    jacobian[:, 2] = 0.0
    np.testing.assert_array_equal(Projection._projected(of, jacobian, np.ones(3))[:, 0], jacobian[:, 1])


def begun(posed, x=(3.0, 1.0, 5.0), **options):
    said = []
    options = {"max_steps": 200, "tolerance": 1e-9, "to_beat": np.inf} | options
    told = lambda n, cost, x: said.append((n, cost, tuple(x), posed.runs))  # noqa: E731
    return projected_descent(posed, np.array(x), on_accept=told, **options), said


class Linear(Decay):
    """The same with k = 1 and nothing but moduli."""

    free = ("c", "a")

    def linearised(self, values):
        self.runs += 1
        C = np.stack([np.ones(40), np.exp(-T)], 1)
        return self.change(self.runs, C @ [values["c"], values["a"]] - DATA, C)


def linear(**options) -> Any:
    return Linear(**options)


def test_where_all_is_linear_two_runs_are_all():
    posed = linear()
    found, said = begun(posed, (3.0, 5.0))
    C = np.stack([np.ones(40), np.exp(-T)], 1)
    moduli, norm = nnls(C, DATA)
    np.testing.assert_allclose(found.y, moduli, rtol=1e-10)
    np.testing.assert_allclose(found.residuals, C @ moduli - DATA, atol=1e-12)
    assert (found.ending, found.runs, found.jacobians, found.jacobian.shape) == (Ending.CONVERGED, 2, 0, (40, 0))
    assert found.cost == pytest.approx(norm**2 / 2)
    assert said == [(2, found.cost, tuple(found.y), 2)]
    ((cost, at),) = found.trace
    assert (cost, tuple(at)) == (found.cost, tuple(found.y))
    quiet = projected_descent(
        linear(), np.array([3.0, 5.0]), max_steps=9, tolerance=1e-9, on_accept=None, to_beat=np.inf
    )
    assert quiet.cost == found.cost


@pytest.mark.parametrize(("kind", "x"), [(linear, (3.0, 5.0)), (decay, (3.0, 1.0, 5.0))])
def test_where_nothing_is_predicted_at_the_start_it_stays_there(kind, x):
    found, said = begun(kind(change=lambda n, r, J: (r * np.nan, J)), x)
    assert (found.ending, found.runs, found.trace, said) == (Ending.NO_PREDICTION, 1, [], [])
    assert found.cost == np.inf
    assert tuple(found.y) == x


def test_a_descent_reports_parameters_and_counts_every_run():
    posed = decay()
    found, said = begun(posed)
    assert found.ending is Ending.CONVERGED
    assert found.runs == posed.runs
    assert len(said) == len(found.trace) > 2
    for (n, cost, x, runs), (traced, at) in zip(said, found.trace, strict=True):
        assert (n, cost, x) == (runs, traced, tuple(at))
        assert cost == pytest.approx(0.5 * np.sum(posed.at(x) ** 2), rel=1e-9)
        C = np.stack([np.ones(40), np.exp(-x[1] * T)], 1)
        np.testing.assert_allclose([x[0], x[2]], nnls(C, DATA)[0], rtol=1e-8)
    assert tuple(found.y) == said[-1][2]
    assert said[0][2][1] == pytest.approx(1.0)
    quiet = projected_descent(
        decay(), np.array([3.0, 1.0, 5.0]), max_steps=200, tolerance=1e-9, on_accept=None, to_beat=np.inf
    )
    assert tuple(quiet.y) == tuple(found.y)


@pytest.mark.parametrize(("max_steps", "trials"), [(1, 1), (2, 1), (3, 1), (4, 2), (5, 2), (6, 3)])
def test_a_trial_is_two_runs_of_those_allowed(monkeypatch, max_steps, trials):
    asked, made = [], []
    own, method = Projection.residuals, room.trust_region
    monkeypatch.setattr(Projection, "residuals", lambda self, y: asked.append(y) or own(self, y))
    monkeypatch.setattr(room, "trust_region", lambda *given: made.append(given) or method(*given))
    found, _ = begun(decay(), (3.0, 0.1, 5.0), max_steps=max_steps, tolerance=1e-12, to_beat=4.5)
    assert (len(asked), found.ending) == (trials, Ending.SPENT)
    assert made == [(1, trials, 1e-12, 4.5)]

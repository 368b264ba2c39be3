"""The course of a fit: where a descent ends, what it reports, what is tried and counted; against algebra and scipy."""

import itertools
import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.optimize
from toy import TRUE, problem, toy_sample

from tissuejax.errors import InputError, NotConverged
from tissuejax.estimation.descent import Ended
from tissuejax.estimation.ending import Ending
from tissuejax.estimation.transforms import Box
from tissuejax.fitting import least_squares as room
from tissuejax.fitting.least_squares import InBox, descend, fit, required
from tissuejax.fitting.options import Search

T = np.linspace(0, 3, 40)
DATA = 2.0 * np.exp(-1.3 * T) + 0.5 + 0.05 * np.random.default_rng(7).normal(size=40)
SIGMA = 0.05


class Decay:
    """(a exp(-k t) + c - data) / sigma with k between 0 and 9, beside a constant that is not free."""

    free = ("a", "k", "c")
    start = {"a": 4.0, "k": 0.4, "c": 0.0, "fixed": 7.0}
    stiffness, priors = 0.0, {}

    def __init__(self, moduli=(), loss="squares"):
        self.moduli, self.loss, self.runs = moduli, loss, 0
        self.box = Box([-np.inf, 0.0, -np.inf], [np.inf, 9.0, np.inf], [1.0, 1.0, 1.0])

    def bound(self, path):
        return (0.0, 9.0) if path == "k" else (-np.inf, np.inf)

    def scale(self, path):
        return 1.0

    def sticks(self, free):
        return ()

    def vector(self, values):
        return np.array([values[p] for p in self.free])

    def values(self, x):
        return self.start | dict(zip(self.free, map(float, x), strict=True))

    def at(self, x):
        a, k, c = x
        return (a * np.exp(-k * T) + c - DATA) / SIGMA

    def slopes(self, x):
        a, k, _ = x
        e = np.exp(-k * T)
        return np.stack([e, -a * T * e, np.ones_like(T)], 1) / SIGMA

    def linearised(self, values):
        assert values["fixed"] == 7.0
        self.runs += 1
        x = self.vector(values)
        return self.at(x), self.slopes(x)


class Valley(Decay):
    """Along a curved valley a thousand times as steep as it is long every step gains little."""

    free, start = ("x", "y"), {"x": -6.0, "y": 36.0, "fixed": 7.0}

    def __init__(self):
        super().__init__()
        self.box = Box([-np.inf] * 2, [np.inf] * 2, [1.0, 1.0])

    def at(self, x):
        return np.array([1 - x[0], 1e3 * (x[1] - x[0] ** 2)])

    def slopes(self, x):
        return np.array([[-1.0, 0.0], [-2e3 * x[0], 1e3]])


def decay(moduli: tuple[str, ...] = (), loss: str = "squares") -> Any:
    return Decay(moduli, loss)


def valley() -> Any:
    return Valley()


def promised(x) -> float:
    """By how much a straight line lowers half the sum of squares, as a share of it."""
    r, J = decay().at(x), decay().slopes(x)
    left = r - J @ np.linalg.lstsq(J, r, rcond=None)[0]
    return 1 - float(left @ left) / float(r @ r)


@pytest.mark.parametrize(("told", "tolerance"), [({}, 1e-9), ({"tolerance": 1e-4}, 1e-4), ({"tolerance": 0.03}, 0.03)])
def test_a_descent_ends_at_the_first_point_from_which_little_is_promised(told, tolerance):
    found = descend(decay(), **told)
    assert found.ending is Ending.CONVERGED
    shares = [promised(x) for _, x in found.trace]
    assert shares[-1] <= tolerance
    assert min(shares[:-1]) > tolerance
    np.testing.assert_array_equal(found.y, found.trace[-1][1])
    assert found.cost == pytest.approx(0.5 * np.sum(decay().at(found.y) ** 2), rel=1e-12)


@pytest.mark.parametrize(("told", "most"), [({}, 200), ({"max_steps": 7}, 7)])
def test_a_descent_computes_two_hundred_predictions_at_most_unless_told(told, most):
    posed = valley()
    found = descend(posed, **told)
    assert (found.ending, found.runs, posed.runs) == (Ending.SPENT, most, most)


@pytest.mark.parametrize("moduli", [(), ("a", "c"), ("k",), ("a", "k", "c")])
def test_any_division_into_moduli_and_others_leads_to_the_solution_of_scipy(moduli):
    """That of k, in which nothing is linear, is given up for a search in all."""
    slopes: Any = decay().slopes
    answer = scipy.optimize.least_squares(decay().at, [2.0, 1.3, 0.5], slopes, xtol=1e-15, ftol=1e-15)
    begun = {"a": 4.0, "k": 0.4, "c": 0.3, "fixed": 7.0}
    found = descend(decay(moduli), begun)
    assert found.ending is Ending.CONVERGED
    std = np.sqrt(np.diag(np.linalg.inv(answer.jac.T @ answer.jac)))
    assert np.all(np.abs(found.y - answer.x) < 1e-3 * std)


@pytest.mark.parametrize("moduli", [(), ("a", "c"), ("k",)])
def test_every_accepted_point_is_reported_with_its_runs_chi_square_and_values(moduli):
    posed, told, begun = decay(moduli), [], {"a": 3.0, "k": 0.7, "c": 0.1, "fixed": 7.0}
    found = descend(posed, begun, on_accept=lambda *said: told.append((*said, posed.runs)))
    assert len(told) == len(found.trace) > 2
    for (n, chi2, values, counted), (cost, x) in zip(told, found.trace, strict=True):
        assert n == counted - (2 if moduli == ("k",) else 0)  # two were spent on a projection that failed
        assert chi2 == 2 * cost == pytest.approx(float(np.sum(posed.at(x) ** 2)), rel=1e-12)
        assert values == posed.values(x)
    assert all(later < earlier for (_, earlier, *_), (_, later, *_) in itertools.pairwise(told))
    if not moduli:
        assert told[0][:3] == (1, pytest.approx(np.sum(posed.at([3.0, 0.7, 0.1]) ** 2)), pytest.approx(begun))


def test_every_run_of_a_full_search_is_told():
    posed, runs = decay(), []
    found = descend(posed, on_run=lambda: runs.append(posed.runs))
    assert runs == list(range(1, found.runs + 1))
    descend(decay(("a",)), on_run=lambda: pytest.fail("a projection has runs of its own"))


def test_a_gradient_method_gets_what_was_asked_and_answers_in_parameters(monkeypatch):
    posed, asked, said = decay(), [], []

    def made(posed, y, method, *, max_steps, tolerance, on_accept):
        asked.append((method, max_steps, tolerance))
        on_accept(3, 12.0, y + 0.1)
        return Ended(y + 0.2, 4.0, Ending.SPENT, np.zeros(0), np.zeros((0, 3)), 5, 0, [(8.0, y), (4.0, y + 0.2)])

    monkeypatch.setattr(room, "gradient_descent", made)
    found = descend(
        posed, method="lbfgs", max_steps=9, tolerance=0.25, on_accept=lambda n, c, v: said.append((n, c, v))
    )
    descend(decay(("a",)), method="adam", on_accept=lambda *_: None)  # no projection either
    assert asked == [("lbfgs", 9, 0.25), ("adam", 200, 1e-9)]
    middle = np.log(0.4 / 8.6)  # of k = 9 / (1 + exp(-y)); a and c are y themselves
    moved = [np.array([4.0 + d, 9 / (1 + np.exp(-middle - d)), d]) for d in (0.0, 0.1, 0.2)]
    np.testing.assert_allclose(found.y, moved[2], rtol=1e-12)
    np.testing.assert_allclose([x for _, x in found.trace], [moved[0], moved[2]], rtol=1e-12, atol=1e-15)
    assert [cost for cost, _ in found.trace] == [8.0, 4.0]
    ((n, chi2, values),) = said
    assert (n, chi2) == (3, 24.0)
    assert values == pytest.approx(posed.values(moved[1]))
    with pytest.raises(InputError, match="unknown method 'newton'; one of levenberg-marquardt, adam, lbfgs"):
        descend(posed, method="newton")


@pytest.mark.parametrize("loss", ["squares", "soft-l1", "cauchy"])
def test_in_coordinates_without_bounds_residuals_are_bent_and_derivatives_are_differences(loss):
    posed, runs = decay(loss=loss), []
    box = InBox(posed, lambda: runs.append(1))
    y = np.array([1.7, -1.5, 0.4])
    k = 9 / (1 + np.exp(1.5))
    r = (1.7 * np.exp(-k * T) + 0.4 - DATA) / SIGMA
    rho = {"squares": r**2, "soft-l1": 2 * (np.sqrt(1 + r**2) - 1), "cauchy": np.log1p(r**2)}[loss]
    J = box.jacobian(y)
    np.testing.assert_allclose(box.residuals(y), np.sign(r) * np.sqrt(rho), rtol=1e-9)
    assert (posed.runs, len(runs)) == (1, 1)  # both from one run
    steps = 1e-6 * np.eye(3)
    numeric = np.stack([(box.residuals(y + h) - box.residuals(y - h)) / 2e-6 for h in steps], 1)
    np.testing.assert_allclose(J, numeric, rtol=1e-5, atol=1e-6 * np.max(np.abs(numeric)))
    assert (posed.runs, len(runs)) == (7, 7)


@pytest.mark.parametrize(("value", "slope", "finite"), [
    (1.0, 2.0, True), (np.nan, 2.0, False), (1.0, np.nan, False), (1e200, 2.0, False), (np.inf, np.nan, False),
])  # fmt: skip
def test_where_either_is_not_finite_nothing_is_predicted(value, slope, finite):
    posed = decay()
    posed.linearised = lambda values: (np.array([value, 1.0]), np.array([[slope, 1.0, 1.0], [1.0, 1.0, 1.0]]))
    box = InBox(posed)
    expected = [value, 1.0] if finite else [np.inf, np.inf]
    np.testing.assert_array_equal(box.residuals(np.zeros(3)), expected)


def told(monkeypatch, name: str, change=None) -> list:
    """Calls of a function of the room, and what came back (from `change` of it)."""
    calls, own = [], getattr(room, name)

    def called(*given, **options):
        back = own(*given, **options) if change is None else change(own, *given, **options)
        calls.append((given, options, back))
        return back

    monkeypatch.setattr(room, name, called)
    return calls


@pytest.mark.parametrize(("search", "n"), [(None, 4), (Search(multistart=1), 1), (Search(multistart=3, seed=5), 3)])
def test_a_fit_is_the_best_of_its_starts_and_counts_them_all(rng, monkeypatch, search, n):
    """No effects here, no idle modulus and a recorded noise: what is tried are the starts alone."""
    calls = told(monkeypatch, "descend")
    wakings = told(monkeypatch, "_awake")
    varied = told(monkeypatch, "variations")
    p = problem(toy_sample(rng, TRUE, n=30), ("energy.a", "energy.b", "energy.rate"), start={"energy.rate": 0.3})
    begun = time.perf_counter()
    accepted = []
    found = fit(p, search=search, on_accept=lambda *said: accepted.append(said))
    assert 0 < found.seconds <= time.perf_counter() - begun
    assert len(found.starts) == n == len(calls)
    assert calls[0][0][1] == p.start
    ((given, _, _),) = varied
    assert given[2:] == (n - 1, 5 if n == 3 else 0)
    assert found.starts == [2 * back.cost for *_, back in calls]
    assert [options["to_beat"] for _, options, _ in calls] == [
        min([back.cost for *_, back in calls[:i]], default=np.inf) for i in range(n)
    ]
    assert found.chi2 == min(found.starts) == pytest.approx(np.sum(p.residuals(found.values) ** 2), rel=1e-9)
    assert found.n_evaluations == sum(back.runs for *_, back in calls)
    assert len(wakings) == (n > 1)
    assert len(accepted) == sum(len(back.trace) for *_, back in calls)
    assert [i.n_evaluations for i in found.trace] == list(range(1, len(found.trace) + 1))
    for i in found.trace:
        assert i.chi2 == pytest.approx(np.sum(p.residuals(i.values) ** 2), rel=1e-9)
    assert (found.method, found.status, found.converged) == ("levenberg-marquardt", "converged", True)


@pytest.mark.parametrize("start", [None, {"energy.a": 9.0}])
def test_moduli_are_solved_for_where_no_start_is_given_and_the_search_does_not(rng, monkeypatch, start):
    calls = told(monkeypatch, "descend")
    rousing = told(monkeypatch, "roused")
    p = problem(
        toy_sample(rng, TRUE, n=30),
        ("energy.a", "energy.b", "energy.rate"),
        start={"energy.a": 1.0, "energy.b": 1.0},
        loss="soft-l1",
    )
    fit(p, start=start, search=Search(multistart=1))
    first = calls[0][0][1]
    (given, options, _), *_ = rousing
    assert given[1] == first
    assert options["told"] == frozenset(start or ())
    if start is None:
        t = np.concatenate([r.channels["nominal_stress"].time for r in p.predictor.sample.recordings.values()])
        y = np.concatenate([r.channels["nominal_stress"].values for r in p.predictor.sample.recordings.values()])
        columns = np.exp(-TRUE["energy.rate"] * t[:, None] * [1, 3])
        solved = scipy.optimize.nnls(columns, y - TRUE["energy.offset"])[0]
        assert [first["energy.a"], first["energy.b"]] == pytest.approx(solved, rel=1e-6)
    else:
        assert first == p.start | start


@pytest.mark.parametrize(("start", "multistart", "more"), [(None, 2, 1), (None, 1, 0), ({"energy.a": 90.0}, 2, 0)])
def test_a_smaller_model_is_fitted_first_and_its_end_is_one_more_start(rng, monkeypatch, start, multistart, more):
    calls = told(monkeypatch, "descend")
    monkeypatch.setattr(room, "neutral", lambda p: [("energy.offset", "energy.b")])
    p = problem(toy_sample(rng, TRUE, n=30), tuple(TRUE))
    found = fit(p, start=start, search=Search(multistart=multistart, max_steps=50))
    assert len(found.starts) == multistart + more
    assert found.n_evaluations == sum(back.runs for *_, back in calls)
    smaller = [(given, options, back) for given, options, back in calls if len(given[0].free) == 2]
    assert len(smaller) == more
    for (inside, _), options, back in smaller:
        assert inside.free == ("energy.a", "energy.rate")
        assert options["max_steps"] == 50
        assert any(given[1] == inside.values(back.y) for given, *_ in calls if len(given[0].free) == 4)


def test_a_smaller_model_without_a_finite_end_is_no_start(rng, monkeypatch):
    nowhere = lambda own, p, *a, **o: SimpleNamespace(cost=np.inf, runs=5) if len(p.free) == 2 else own(p, *a, **o)  # noqa: E731
    calls = told(monkeypatch, "descend", nowhere)
    monkeypatch.setattr(room, "neutral", lambda p: [("energy.offset", "energy.b")])
    found = fit(problem(toy_sample(rng, TRUE, n=30), tuple(TRUE)), search=Search(multistart=2))
    assert len(found.starts) == 2
    assert found.n_evaluations == sum(back.runs for *_, back in calls)


def test_of_equal_ends_the_one_that_converged_is_taken(rng, monkeypatch):
    ends = iter([Ending.SPENT, Ending.CONVERGED, Ending.BEHIND])

    def ended(own, p, start, **options):
        x = p.vector(TRUE)
        return Ended(x, 40.0, next(ends), np.zeros(0), np.zeros((0, 1)), 3, 1, [(40.0, x)])

    calls = told(monkeypatch, "descend", ended)
    monkeypatch.setattr(room, "_awake", lambda p, best, options: (best, 11))
    found = fit(problem(toy_sample(rng, TRUE, n=30), ("energy.a",)), search=Search(multistart=3))
    assert found.status == "converged"
    assert (len(calls), found.n_evaluations) == (3, 9 + 11)
    ends = iter([Ending.SPENT])
    found = fit(problem(toy_sample(rng, TRUE, n=30), ("energy.a",)), search=Search(multistart=1))
    assert found.status == "no convergence after 3 evaluations"
    with pytest.raises(NotConverged, match="did not converge .no convergence after 3 evaluations."):
        required(found)


def test_a_start_where_nothing_is_predicted_is_refused_with_its_values(rng, monkeypatch):
    nowhere = Ended(np.zeros(2), np.inf, Ending.NO_PREDICTION, np.zeros(0), np.zeros((0, 1)), 1, 0)
    told(monkeypatch, "descend", lambda *given, **options: nowhere)
    p = problem(toy_sample(rng, TRUE, n=30), ("energy.a", "energy.rate"), start={"energy.a": 12.5})
    with pytest.raises(InputError, match=r"start was energy.a = 12.5, energy.rate = 0.7; change it with --start"):
        fit(p, search=Search(multistart=2))

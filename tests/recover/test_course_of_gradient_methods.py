"""Adam against its formulas in numpy, and the ends of both gradient methods, on misfits made up."""

from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from toy import TRUE, ToyModel, ToyPredictor, problem, toy_sample

from tissuejax.estimation.ending import Ending
from tissuejax.fitting import gradient_descent as room
from tissuejax.fitting.gradient_descent import gradient_descent, objective
from tissuejax.parameters import Parameter


def descended(monkeypatch, loss, y, method, **options):
    """From `y` on a misfit, and what was reported of every accepted point."""
    monkeypatch.setattr(room, "objective", lambda problem: loss)
    said = []
    options = {"max_steps": 10, "tolerance": 1e-9} | options
    none: Any = None
    found = gradient_descent(none, np.array(y), method, on_accept=lambda *told: said.append(told), **options)
    assert [(cost, tuple(x)) for _, cost, x in said] == [(cost, tuple(x)) for cost, x in found.trace]
    assert (found.residuals.shape, found.jacobian.shape, found.jacobians) == ((0,), (0, len(y)), 0)
    return found, [n for n, *_ in said]


def rates(steps: int) -> np.ndarray:
    """From 0.05 down to a hundredth of it by a cosine; steps down a slope of one are so long but for Adam's 1e-8."""
    return 0.05 * (0.01 + 0.99 * (1 + np.cos(np.pi * np.arange(steps) / steps)) / 2)


def test_adam_s_steps_are_those_of_its_formula(monkeypatch, rng):
    """Kingma and Ba 2015, algorithm 1, at a rate that falls by a cosine; ten steps for each that is asked for."""
    A, b = rng.normal(size=(6, 3)), rng.normal(size=6)
    found, numbers = descended(
        monkeypatch, lambda y: 0.5 * jnp.sum((A @ y - b) ** 2), [1.0, -2.0, 0.5], "adam", max_steps=4, tolerance=0.0
    )
    y, m, v, costs, points = np.array([1.0, -2.0, 0.5]), 0.0, 0.0, [], []
    for k, rate in enumerate(rates(40), start=1):
        costs.append(0.5 * np.sum((A @ y - b) ** 2))
        points.append(y)
        g = A.T @ (A @ y - b)
        m, v = 0.9 * m + 0.1 * g, 0.999 * v + 0.001 * g**2
        y = y - rate * (m / (1 - 0.9**k)) / (np.sqrt(v / (1 - 0.999**k)) + 1e-8)
    better = [k for k in range(40) if costs[k] < min(costs[:k], default=np.inf)]
    assert numbers == [k + 1 for k in better]
    np.testing.assert_allclose([cost for cost, _ in found.trace], np.array(costs)[better], rtol=1e-9)
    np.testing.assert_allclose([x for _, x in found.trace], np.array(points)[better], rtol=1e-9)
    assert (found.runs, found.ending) == (40, Ending.CONVERGED)
    assert found.cost == pytest.approx(min(costs), rel=1e-9)
    np.testing.assert_allclose(found.y, points[better[-1]], rtol=1e-9)


@pytest.mark.parametrize(("max_steps", "tolerance"), [(10, 1e-3), (10, 1e-4), (10, 4e-4), (4, 1e-3), (3, 3e-4)])
def test_adam_ends_after_twenty_steps_of_little_gain_in_its_second_half(monkeypatch, max_steps, tolerance):
    """Down a slope of one Adam goes by its rate at every step."""
    steps = 10 * max_steps
    value = 100 - np.concatenate([[0.0], np.cumsum(rates(steps)) / (1 + 1e-8)])[:-1]
    gained = np.flatnonzero(value[1:] < value[:-1] * (1 - tolerance)) + 2  # numbers of the steps that gain enough
    end = max([*gained, 1]) + 20
    expected = min(max(end, steps // 2 + 1), steps)
    found, numbers = descended(
        monkeypatch, lambda y: 100 - y[0], [0.0], "adam", max_steps=max_steps, tolerance=tolerance
    )
    assert (found.runs, found.ending) == (expected, Ending.CONVERGED)
    assert numbers == list(range(1, expected + 1))
    np.testing.assert_allclose([cost for cost, _ in found.trace], value[:expected], rtol=1e-12)


def test_lbfgs_ends_after_twenty_steps_of_little_gain_or_with_its_steps(monkeypatch):
    flat = lambda y: 3.0 + jnp.sum(y**2)  # noqa: E731
    found, numbers = descended(monkeypatch, flat, [0.0, 0.0], "lbfgs", max_steps=40)
    assert (found.runs, found.ending, numbers) == (21, Ending.CONVERGED, [1])
    assert found.cost == 3.0
    assert found.trace[0][1].tolist() == [0.0, 0.0]
    spent, _ = descended(monkeypatch, flat, [1.0, 2.0], "lbfgs", max_steps=20)
    assert (spent.runs, spent.ending) == (20, Ending.SPENT)
    assert spent.cost == pytest.approx(3.0)
    np.testing.assert_allclose(spent.y, 0.0, atol=1e-6)


def test_a_misfit_that_is_no_number_is_the_end(monkeypatch):
    """Adam is beyond 0.2 after five steps of nearly 0.05."""
    found, numbers = descended(monkeypatch, lambda y: jnp.where(y[0] > 0.2, jnp.nan, 100 - y[0]), [0.0], "adam")
    assert (found.runs, found.ending, numbers) == (6, Ending.BROKEN, [1, 2, 3, 4, 5])
    assert found.y[0] == pytest.approx(np.sum(rates(100)[:4]) / (1 + 1e-8), rel=1e-12)
    assert found.cost == pytest.approx(100 - found.y[0], rel=1e-12)
    nowhere, numbers = descended(monkeypatch, lambda y: jnp.inf * (1 + y[0] ** 2), [0.5], "adam")
    assert (nowhere.runs, nowhere.ending, numbers, nowhere.cost) == (1, Ending.NO_PREDICTION, [], np.inf)
    assert nowhere.y.tolist() == [0.5]


def test_a_modulus_over_decades_stays_finite_however_far_it_is_sent(rng):
    """Half the squares of an offset of 0.005 sinh(y), y no further than 60 on either side."""
    p = problem(toy_sample(rng, TRUE, n=9, noise=2.0), ("energy.offset",))
    recordings = [r.channels["nominal_stress"] for r in p.predictor.sample.recordings.values()]
    t, y = (np.concatenate([getattr(c, what) for c in recordings]) for what in ("time", "values"))
    rest = 80 * np.exp(-0.7 * t) + 40 * np.exp(-2.1 * t) - y
    misfit = objective(p)
    for at, reached in ((3.0, 3.0), (59.5, 59.5), (61.0, 60.0), (-59.5, -59.5), (-75.0, -60.0)):
        expected = 0.5 * np.sum(((rest + 5e-3 * np.sinh(reached)) / 2) ** 2)
        assert float(misfit(jnp.array([at]))) == pytest.approx(expected, rel=1e-9)


class Beside(ToyPredictor):
    """Beside the curve's constants some that only priors tell of: two parts of a whole and every kind of bound."""

    class model(ToyModel):  # noqa: N801
        parameters = ToyModel.parameters | {
            "effects.e.g1": Parameter("g1", "1", 0.1, lower=0.0, upper=1.0),
            "effects.e.g2": Parameter("g2", "1", 0.2, lower=0.0, upper=1.0),
            "effects.e.above": Parameter("above", "1", 4.0, lower=2.5),
            "effects.e.below": Parameter("below", "1", -2.0, upper=1.5),
            "effects.e.any": Parameter("any", "1", 3.0),
            "effects.e.held": Parameter("held", "1", -3.0, lower=-7.0, upper=2.0),
        }
        effects = (SimpleNamespace(name="e", shares=("g1", "g2")),)


@pytest.mark.parametrize("seed", [0, 1])
def test_every_kind_of_bound_has_its_formula_in_a_traced_misfit(seed):
    """Half the squares of priors' deviations at coordinates drawn at random, beside data that fit."""
    y = 1.5 * np.random.default_rng(seed).normal(size=6)
    names = ("g1", "g2", "above", "below", "any", "held")
    free = tuple(f"effects.e.{n}" for n in names)
    share = 1 / (1 + np.exp(-y))
    f1, f2 = 0.999 * share[:2]
    x = [f1, (1 - f1) * f2, 2.5 + 4 * np.log1p(np.exp(y[2])), 1.5 - 2 * np.log1p(np.exp(-y[3])), 3 * y[4]]
    x.append(-7 + 9 * share[5])
    exact = toy_sample(np.random.default_rng(0), TRUE, n=7, noise=0.0, recorded=False)
    for name, at in zip(free, x, strict=True):
        p = problem(exact, free, Beside, priors={name: (0.3, 0.05)})
        assert float(objective(p)(jnp.asarray(y))) == pytest.approx(0.5 * ((at - 0.3) / 0.05) ** 2, rel=1e-9)

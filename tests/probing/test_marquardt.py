"""Marquardt's descent, few simulations: the answer with few Jacobians, and rejected steps cost a forward run."""

import numpy as np
import pytest

from tissuejax.errors import UnstableSimulation
from tissuejax.estimation.descent import descend
from tissuejax.estimation.methods import marquardt
from tissuejax.estimation.posed import LeastSquares

T = np.linspace(0, 3, 200)
TRUTH = np.log([2.0, 1.3])


def model(y):
    a, b = np.exp(y)
    return a * np.exp(-b * T)


def jacobian(y):
    a, b = np.exp(y)
    return np.stack([model(y), -b * T * model(y)], 1)


class Posed(LeastSquares):
    """Residuals and their derivative as functions."""

    def __init__(self, derivative, residuals):
        self.derivative, self.function = derivative, residuals

    def residuals(self, y):
        return self.function(y)

    def jacobian(self, y):
        return self.derivative(y)


def descended(derivative, residuals, y):
    return descend(Posed(derivative, residuals), y, marquardt(len(y)))


@pytest.mark.parametrize("start", [(4.0, 0.5), (0.3, 6.0)])
def test_finds_the_answer_with_few_jacobians(rng, start):
    data = model(TRUTH) + rng.normal(0, 0.01, T.size)
    calls = {"jacobian": 0, "forward": 0}

    def residuals(y):
        calls["forward"] += 1
        return (model(y) - data) / 0.01

    def derivative(y):
        calls["jacobian"] += 1
        return jacobian(y) / 0.01

    out = descended(derivative, residuals, np.log(start))
    assert np.array_equal(out.residuals, residuals(out.y))
    assert out.jacobian.shape == (T.size, 2)
    J = jacobian(TRUTH) / 0.01
    std = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    assert out.converged
    assert (np.abs(out.y - TRUTH) < 4 * std).all()
    assert calls["jacobian"] <= 8
    assert (out.jacobians, out.runs) == (calls["jacobian"], calls["forward"] - 1)  # this test asked once itself


def test_unstable_trials_are_rejected_not_masked(rng):
    data = model(TRUTH) + rng.normal(0, 0.01, T.size)

    def residuals(y):
        if y[1] > np.log(1.6):
            raise UnstableSimulation("blew up")
        return (model(y) - data) / 0.01

    out = descended(lambda y: jacobian(y) / 0.01, residuals, np.log([4.0, 0.4]))
    assert out.converged
    assert np.abs(out.y - TRUTH).max() < 0.05


def test_a_start_without_prediction_says_so():
    out = descended(lambda y: np.ones((3, 1)), lambda y: np.full(3, np.nan), np.zeros(1))
    assert not out.converged
    assert "no finite prediction" in out.reason

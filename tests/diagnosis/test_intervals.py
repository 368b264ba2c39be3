"""Intervals of a diagnosis' fits against the truth, 400 draws each: neither too wide nor too narrow."""

import numpy as np
import pytest

from tissuejax.diagnosis.bench import Bench, Free
from tissuejax.diagnosis.misfit import white
from tissuejax.diagnosis.refit import refit
from tissuejax.estimation.series import Segment

X = np.linspace(0.0, 1.0, 8)
TRUTH = {"a": 3.0, "b": 5.0}
SIGMA, DRAWS = 0.2, 400
CHANCE = 0.03  # of 400 right intervals of 95 %, all but one in 200 such counts lie within it


class Parabola(Bench):
    """y = a x + b x^2 at eight samples; b moves in logarithm."""

    def predict(self, values, recordings=None):
        return values["a"] * X + values["b"] * X**2

    def jacobian(self, values, paths, recordings=None):
        return np.stack([{"a": X, "b": X**2}[p] for p in paths], axis=1)


def measured(rng, stated, estimated):
    segments = [Segment("r", "force", "", slice(0, len(X)), X, "N", X, "shear", "1")]
    y = TRUTH["a"] * X + TRUTH["b"] * X**2 + SIGMA * rng.normal(size=len(X))
    free = {"a": Free(-np.inf, np.inf, 1.0), "b": Free(1e-3, 1e3, 1.0, log=True)}
    sigma = np.full(len(X), stated * SIGMA)
    bench = Parabola(segments, y, sigma, ("r",), (), ("a", "b"), free, {"a": 1.0, "b": 1.0}, {})
    bench.estimated = estimated
    return bench


def covered(stated, estimated):
    """Share of 95 % intervals that hold the truth, and scatter over the mean stated variance."""
    rng = np.random.default_rng(4)
    held, miss, variance = [], [], []
    for _ in range(DRAWS):
        bench = measured(rng, stated(rng), estimated)
        fit = refit(bench, white(bench), (), TRUTH, tolerance=1e-9)
        ends = fit.intervals
        held.append([low < TRUTH[p] < high for p, (low, high) in ends.items()])
        miss.append([fit.values[p] - TRUTH[p] for p in TRUTH])
        variance.append([fit.std[p] ** 2 for p in TRUTH])
    return np.mean(held, 0), np.sqrt(np.mean(np.square(miss), 0) / np.mean(variance, 0))


def test_a_guessed_noise_level_gives_way_to_what_is_left():
    """The guess is off by up to three either way and eight samples tell: Student's intervals hold all the same."""
    share, scatter = covered(lambda rng: np.exp(rng.uniform(-1.1, 1.1)), True)
    assert share == pytest.approx(0.95, abs=CHANCE)
    assert scatter == pytest.approx(1.0, abs=0.1)


def test_a_level_recorded_right_is_kept():
    """Widened in draws that scatter more by chance, never narrowed: 95 % and a little more."""
    share, scatter = covered(lambda rng: 1.0, False)
    assert np.all(share > 0.95 - CHANCE)
    assert np.all(share < 0.985)
    assert np.all((scatter > 0.75) & (scatter < 1.0))


def test_a_level_recorded_at_a_third_is_made_up_for():
    share, scatter = covered(lambda rng: 1 / 3, False)
    assert share == pytest.approx(0.95, abs=CHANCE)
    assert scatter == pytest.approx(1.0, abs=0.1)

"""Noise in time against dense matrices: draws as a linear map, samples that share a time, and where white begins."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import cholesky, solve_triangular
from scipy.stats import multivariate_normal

from tissuejax.errors import InputError
from tissuejax.estimation.noise import NEGLIGIBLE, Noise

UNEVEN = np.array([0.0, 0.3, 0.35, 1.0, 2.7, 2.9, 3.0])


def dense(white: float, correlated: float, tau: float, order: int, time: np.ndarray) -> Any:
    d = np.abs(np.subtract.outer(time, time)) / tau
    faded = np.exp(-d) * (1.0 if order == 1 else 1 + d)
    return correlated**2 * faded + white**2 * np.eye(len(time))


class Unit:
    """Draws of zeros but for one: what a linear map gives of it is a column of the map."""

    def __init__(self, one: int):
        self.one, self.drawn = one, 0

    def normal(self, size: int) -> np.ndarray:
        out = np.zeros(size)
        if self.drawn <= self.one < self.drawn + size:
            out[self.one - self.drawn] = 1.0
        self.drawn += size
        return out


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("white", [0.0, 0.6])
def test_draws_are_a_linear_map_whose_square_is_the_covariance(order, white):
    noise, columns, one = Noise(white, 1.7, 0.8, order), [], 0
    while True:
        unit = Unit(one)
        columns.append(noise.sample(unit, UNEVEN))  # pyright: ignore[reportArgumentType]
        one += 1
        if one >= unit.drawn:
            break
    assert len(columns) == (order + 1) * len(UNEVEN)
    made = np.transpose(columns)
    np.testing.assert_allclose(made @ made.T, dense(white, 1.7, 0.8, order, UNEVEN), atol=1e-13)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("time", [UNEVEN, UNEVEN[:2], 4.0 + UNEVEN], ids=["seven", "two", "later"])
def test_every_operation_is_that_of_the_matrix(order, time, rng):
    noise, c = Noise(0.4, 1.7, 0.8, order), dense(0.4, 1.7, 0.8, order, time)
    n = len(time)
    factor = cholesky(c, lower=True)
    np.testing.assert_allclose(noise.whiten(np.eye(n), time), np.linalg.inv(factor), atol=1e-12)
    np.testing.assert_allclose(noise.times(np.eye(n), time), c, atol=1e-13)
    np.testing.assert_allclose(noise.covariance(time), c, atol=1e-14)
    assert noise.log_determinant(time) == pytest.approx(np.linalg.slogdet(c)[1], abs=1e-12)
    assert noise.squares(time) == pytest.approx(np.sum(c**2), rel=1e-13)
    assert noise.effective(time) == pytest.approx(noise.std**2 * np.sum(np.linalg.inv(c)), rel=1e-12)
    x = rng.normal(size=(n, 2, 3))
    np.testing.assert_allclose(
        noise.whiten(x, time).reshape(n, 6), solve_triangular(factor, x.reshape(n, 6), lower=True), atol=1e-12
    )
    law = multivariate_normal(np.zeros(n), c)
    densities = sum(float(law.logpdf(x[:, i, j])) for i in (0, 1) for j in range(3))
    assert noise.log_density(x, time) == pytest.approx(densities, abs=1e-11)
    assert noise.log_density(x[:, 0, 0], time) == pytest.approx(float(law.logpdf(x[:, 0, 0])), abs=1e-12)
    other = np.array([0.1, 3.0])
    across = dense(0.0, 1.7, 0.8, order, np.concatenate([time, other]))[:n, n:]
    np.testing.assert_allclose(noise.covariance(time, other), across, atol=1e-14)
    lags = np.array([-0.8, 0.0, 0.35, 2.0])
    np.testing.assert_allclose(
        noise.correlation(lags),
        dense(0.0, 1.7, 0.8, order, np.append(lags, 0.0))[-1, :-1] / (1.7**2 + 0.16),
        atol=1e-14,
    )


@pytest.mark.parametrize("order", [1, 2])
def test_two_samples_at_one_time_are_one_with_half_the_white_variance(order, rng):
    time, x = np.array([0.0, 0.5, 0.5, 0.9]), rng.normal(size=4)
    noise = Noise(0.4, 1.7, 0.8, order)
    found = noise.log_density(x, time)
    law = multivariate_normal(np.zeros(4), dense(0.4, 1.7, 0.8, order, time))
    assert found == pytest.approx(float(law.logpdf(x)), abs=1e-12)


@pytest.mark.parametrize("order", [1, 2])
def test_without_a_white_part_a_sample_repeated_says_nothing_new(order):
    """What is left of the variance is a million millionth: two that tell the same at one time are no trouble, and two
    that don't are far apart."""
    noise = Noise(0.0, 2.0, 0.8, order)
    time = np.array([0.0, 0.0, 0.8])
    again = 1.0 if order == 1 else 2.0
    foretold = again / math.e
    left = 4.0 * (1 - foretold**2)
    expected = [1.5 / 2.0, 0.0, (1.0 - 1.5 * foretold) / math.sqrt(left)]
    np.testing.assert_allclose(noise.whiten(np.array([1.5, 1.5, 1.0]), time), expected, atol=1e-9)
    assert noise.whiten(np.array([1.5, 1.5 + 2e-6, 1.0]), time)[1] == pytest.approx(1.0, rel=1e-6)
    apart = math.log(4.0) + math.log(1e-12 * 4.0) + math.log(left)
    assert noise.log_determinant(time) == pytest.approx(apart, abs=1e-9)


@pytest.mark.parametrize("order", [1, 2])
def test_noise_is_white_below_a_thousandth_of_the_variance_or_of_correlation_of_neighbours(order, rng):
    assert NEGLIGIBLE == 1e-3
    time = np.array([5.0, 6.0, 6.25, 9.0])
    below, at = Noise.shaped(0.9e-3, 1e9, 2.0, order), Noise.shaped(1.1e-3, 1e9, 2.0, order)
    assert (below.is_white(time), at.is_white(time)) == (True, False)
    lag = 6.9077552789821368 if order == 1 else 9.2334134764515  # exp(-d), (1 + d) exp(-d) = 1e-3
    close, far = Noise(0.0, 3.0, 0.25 / (lag * 0.999), order), Noise(0.0, 3.0, 0.25 / (lag * 1.001), order)
    assert (close.is_white(time), far.is_white(time)) == (False, True)
    assert close.is_white(time[:2])
    assert close.is_white(time[:1])
    assert close.is_white(time[:0])
    assert Noise(0.0, 1.0, 1e9, order).is_white(time[:1])
    assert not Noise(0.0, 1.0, 1e9, order).is_white(time[:2])
    x = rng.normal(size=(4, 2))
    np.testing.assert_array_equal(far.whiten(x, time), x / 3.0)
    assert far.log_determinant(time) == pytest.approx(8 * math.log(3.0), rel=1e-14)
    assert abs(close.log_determinant(time) - 8 * math.log(3.0)) > 1e-9
    assert far.log_density(x, time) == pytest.approx(
        -np.sum(x**2) / 18 - 8 * math.log(3.0) - 4 * math.log(2 * math.pi), rel=1e-13
    )
    assert far.log_density(np.zeros((0, 2)), time[:0]) == 0.0


@pytest.mark.parametrize("order", [1, 2])
def test_neighbours_decide_by_the_least_gap(order):
    noise = Noise(0.0, 1.0, 1.0, order)
    assert noise.is_white(np.array([0.0, 20.0, 40.0]))
    assert not noise.is_white(np.array([0.0, 20.0, 20.5, 40.0]))


def test_the_share_at_the_limit_is_not_white():
    white, correlated = 1.0, math.sqrt(NEGLIGIBLE / (1 - NEGLIGIBLE))
    noise = Noise(white, correlated, 1e9)
    while noise.share < NEGLIGIBLE:
        noise = Noise(white, math.nextafter(noise.correlated, 1.0), 1e9)
    assert noise.share == pytest.approx(NEGLIGIBLE, rel=1e-14)
    assert not noise.is_white(np.zeros(2)), "samples that share a time correlate by the share"
    least = 2 * NEGLIGIBLE
    assert Noise.shaped(least, 1.0).is_white(np.array([0.0, math.log(2.0) + 0.01]))
    assert not Noise.shaped(least, 1.0).is_white(np.array([0.0, math.log(2.0) - 0.01]))


def test_defaults_are_white_noise_of_one():
    assert Noise() == Noise(1.0, 0.0, 1.0, 1)
    assert (Noise().std, Noise().share) == (1.0, 0.0)
    shaped = Noise.shaped(0.36, 2.0)
    assert (shaped.white, shaped.correlated, shaped.tau, shaped.order) == pytest.approx((0.8, 0.6, 2.0, 1))
    shaped = Noise.shaped(0.36, 2.0, 5.0, 2)
    assert (shaped.white, shaped.correlated, shaped.tau, shaped.order) == pytest.approx((4.0, 3.0, 2.0, 2))
    assert (shaped.std, shaped.share) == pytest.approx((5.0, 0.36))
    assert shaped.scaled(3.0) == Noise(12.0, 9.0, 2.0, 2)
    assert (shaped.unit.white, shaped.unit.correlated, shaped.unit.order) == pytest.approx((0.8, 0.6, 2))


@pytest.mark.parametrize(
    "what", [(-1e-9, 1.0, 1.0), (1.0, -1e-9, 1.0), (0.0, 0.0, 1.0), (1.0, 1.0, 0.0), (2.0, -1.0, 1)]
)
def test_what_is_no_noise_is_refused_with_its_numbers(what):
    white, correlated, tau = what
    with pytest.raises(InputError) as refused:
        Noise(*what)
    assert str(refused.value) == (
        f"noise with white part {white}, correlated part {correlated}, time {tau} s: standard deviations must not be "
        "negative nor both zero, the time must be positive"
    )


def test_the_least_that_is_noise():
    assert Noise(0.0, 1.0, 1e-300).std == 1.0
    assert Noise(1.0, 0.0, 0.5).std == 1.0
    assert Noise(1e-300, 0.0).white == 1e-300
    assert Noise(0.25, 0.0, 0.5, 2).order == 2
    for order in (0, 3):
        with pytest.raises(InputError, match=f"^noise behind a low-pass of order {order}; 1 and 2 are known$"):
            Noise(1.0, 1.0, 1.0, order)


@pytest.mark.parametrize("order", [1, 2])
def test_times_that_run_backwards_are_refused_where_they_turn(order):
    noise = Noise(0.5, 1.0, 1.0, order)
    turning = np.array([0.0, 0.5, 2.25, 1.0, 0.5])
    for run in (lambda: noise.whiten(np.zeros(5), turning), lambda: noise.log_determinant(turning)):
        with pytest.raises(InputError) as refused:
            run()
        assert str(refused.value) == "time runs backwards after sample 2 (2.25 s); sort the samples"
    with pytest.raises(InputError, match=r"^4 samples at 5 times; one time a sample is needed$"):
        noise.whiten(np.zeros(4), turning)
    assert np.all(np.isfinite(noise.whiten(np.ones(3), np.array([0.0, 0.0, 1.0]))))

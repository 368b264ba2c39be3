"""Noise in time against dense linear algebra, its own moments, and independent draws of autoregressions."""

import numpy as np
import pytest
from scipy.linalg import cholesky, solve_triangular, toeplitz
from scipy.signal import lfilter
from scipy.stats import multivariate_normal

from tissuejax.errors import InputError
from tissuejax.estimation.noise import Noise

EVEN = np.arange(60) * 0.04
LOGS = np.concatenate([[0.0], np.geomspace(0.01, 300.0, 59)])
NOISES = [Noise(), Noise(0.3, 0.8, 0.2), Noise(0.0, 2.0, 5.0), Noise(1.0, 0.1, 1e-4), Noise(0.5, 0.5, 1e4)]


@pytest.mark.parametrize("time", [EVEN, LOGS], ids=["even", "logarithmic"])
@pytest.mark.parametrize("noise", NOISES, ids=str)
def test_whitening_is_the_inverse_cholesky_factor(rng, noise, time):
    x = rng.normal(size=(60, 2, 3))
    factor = cholesky(noise.covariance(time), lower=True)
    dense = solve_triangular(factor, x.reshape(60, 6), lower=True).reshape(x.shape)
    np.testing.assert_allclose(noise.whiten(x, time), dense, rtol=0, atol=3e-3 if noise.is_white(time) else 1e-8)
    assert noise.log_determinant(time) == pytest.approx(2 * np.sum(np.log(np.diag(factor))), abs=1e-4)


@pytest.mark.parametrize("time", [EVEN, LOGS], ids=["even", "logarithmic"])
def test_density_is_that_of_the_multivariate_normal(rng, time):
    noise, x = Noise(0.3, 0.8, 0.2), rng.normal(size=60)
    theirs = multivariate_normal(np.zeros(60), noise.covariance(time)).logpdf(x)
    assert noise.log_density(x, time) == pytest.approx(theirs, abs=1e-8)
    two = np.stack([x, 2 * x], 1)
    more = theirs + multivariate_normal(np.zeros(60), noise.covariance(time)).logpdf(2 * x)
    assert noise.log_density(two, time) == pytest.approx(more, abs=1e-8)


def test_on_even_samples_it_is_a_first_order_autoregression():
    """rho = exp(-dt/tau): the matrix that the filter x[k] = rho x[k-1] + e[k] belongs to."""
    rho = np.exp(-0.04 / 0.3)
    np.testing.assert_allclose(Noise(0, 1, 0.3).covariance(EVEN), toeplitz(rho ** np.arange(60)), atol=1e-12)
    made = np.random.default_rng(1).normal(size=(60, 4000))
    made[1:] *= np.sqrt(1 - rho**2)
    z = Noise(0, 1, 0.3).whiten(lfilter([1.0], [1.0, -rho], made, axis=0), EVEN)
    np.testing.assert_allclose(np.corrcoef(z)[5, 4:8], [0, 1, 0, 0], atol=0.06)
    np.testing.assert_allclose(np.var(z, axis=1), 1.0, atol=0.11)


@pytest.mark.parametrize("time", [EVEN, LOGS], ids=["even", "logarithmic"])
@pytest.mark.parametrize("noise", NOISES, ids=str)
def test_products_with_the_covariance(rng, noise, time):
    x, dense = rng.normal(size=(60, 3)), noise.covariance(time)
    np.testing.assert_allclose(noise.times(x, time), dense @ x, atol=1e-9)
    assert noise.squares(time) == pytest.approx(np.sum(dense**2), rel=1e-9)


def test_draws_have_the_covariance_that_is_said():
    noise, time, rng = Noise(0.6, 0.9, 0.5), np.array([0.0, 0.1, 0.15, 1.0, 1.0 + 1e-9]), np.random.default_rng(2)
    draws = np.stack([noise.sample(rng, time) for _ in range(20000)])
    np.testing.assert_allclose(np.cov(draws.T), noise.covariance(time), atol=0.04)


def test_effective_samples_are_the_variance_of_the_best_mean():
    rho, n = np.exp(-0.04 / 0.3), 5000
    time = np.arange(n) * 0.04
    assert Noise(0, 3, 0.3).effective(time) == pytest.approx(n * (1 - rho) / (1 + rho), rel=0.02)
    assert Noise(2.0).effective(time) == pytest.approx(n)
    apart = Noise(0, 1, 0.3).effective(np.arange(50) * 30.0)
    assert apart == pytest.approx(50, rel=1e-3), "samples a hundred times tau apart are independent"


def test_shape_and_level_are_kept_apart():
    noise = Noise.shaped(0.25, 2.0, std=4.0)
    assert (noise.std, noise.share, noise.tau) == pytest.approx((4.0, 0.25, 2.0))
    assert noise.unit.std == pytest.approx(1.0)
    assert noise.unit.share == pytest.approx(0.25)
    assert noise.scaled(0.5).std == pytest.approx(2.0)
    assert noise.correlation(2.0) == pytest.approx(0.25 / np.e)
    assert noise.covariance(np.array([0.0]), np.array([2.0]))[0, 0] == pytest.approx(4.0 / np.e)


def test_refusals():
    with pytest.raises(InputError, match="must not be negative nor both zero"):
        Noise(0.0, 0.0)
    with pytest.raises(InputError, match="time must be positive"):
        Noise(1.0, 1.0, 0.0)
    with pytest.raises(InputError, match="runs backwards after sample 2"):
        Noise(0.1, 1.0, 1.0).whiten(np.zeros(4), np.array([0.0, 0.0, 1.0, 0.5]))
    with pytest.raises(InputError, match="3 samples at 2 times"):
        Noise().whiten(np.zeros(3), np.zeros(2))


@pytest.mark.parametrize("order", [1, 2])
def test_every_operation_against_the_covariance_matrix(order, rng):
    """Factor, determinant, product, squares and draws by dense linear algebra, at uneven times."""
    time = np.sort(rng.uniform(0, 12, 40))
    noise = Noise(0.4, 1.1, 0.8, order)
    d = np.abs(time[:, None] - time) / 0.8
    c = 1.21 * (np.exp(-d) if order == 1 else (1 + d) * np.exp(-d)) + 0.16 * np.eye(40)
    x = rng.normal(size=(40, 3))
    np.testing.assert_allclose(noise.covariance(time), c, rtol=1e-12)
    np.testing.assert_allclose(noise.whiten(x, time), np.linalg.solve(np.linalg.cholesky(c), x), rtol=1e-8, atol=1e-10)
    assert noise.log_determinant(time) == pytest.approx(np.linalg.slogdet(c)[1], rel=1e-9)
    np.testing.assert_allclose(noise.times(x, time), c @ x, rtol=1e-9, atol=1e-9)
    assert noise.squares(time) == pytest.approx(np.sum(c**2), rel=1e-9)
    draws = np.array([noise.sample(rng, time) for _ in range(1500)])
    np.testing.assert_allclose(draws.T @ draws / 1500, c, atol=0.2)


@pytest.mark.parametrize("order", [1, 2])
def test_nothing_to_multiply_or_whiten_is_nothing(order):
    """No columns (a fit at whose end nothing is free): LAPACK without a right-hand side spoils memory, and the process
    came to an abort some calls later."""
    time, noise = np.linspace(0, 7, 70), Noise(0.4, 1.1, 0.8, order)
    assert noise.times(np.zeros((70, 0)), time).shape == (70, 0)
    assert noise.whiten(np.zeros((70, 0)), time).shape == (70, 0)


def test_other_orders_are_refused():
    with pytest.raises(InputError, match="order 3"):
        Noise(0.4, 1.1, 0.8, 3)

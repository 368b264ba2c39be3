"""The noise is told from a mismatch: its correlation in seconds is found although the prediction is wrong.

Noise is drawn here by filters and random walks of the test's own, at even, mixed and logarithmic sampling.
"""

import math

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.signal import butter, lfilter
from scipy.stats import norm

from tissuejax.estimation import correlation
from tissuejax.estimation.correlation import Series, estimate
from tissuejax.estimation.noise import Noise
from tissuejax.estimation.whiteness import portmanteau

FAST, SLOW = np.arange(626) * 0.04, np.arange(200) * 1.0  # 25 and 1 Hz
LOGS = np.concatenate([[0.0], np.geomspace(0.02, 200.0, 249)])


def wandering(rng, time, tau):
    """Ornstein-Uhlenbeck noise of unit variance, by its exact transition."""
    x = rng.normal(size=len(time))
    for k, dt in enumerate(np.diff(time)):
        x[k + 1] = np.exp(-dt / tau) * x[k] + np.sqrt(1 - np.exp(-2 * dt / tau)) * x[k + 1]
    return x


def autoregression(rng, n, rho):
    return lfilter([np.sqrt(1 - rho**2)], [1, -rho], rng.normal(size=n + 500))[500:]


def mismatch(time):
    """What an elastic law leaves of a test with ramps and holds: smooth, with kinks where a ramp ends."""
    r = np.interp(time / time[-1], [0, 0.04, 0.32, 0.64, 0.92, 1], [0, 0, 1, 1, 0, 0])
    return r**2 - 0.5 * r + 0.3 * np.sin(3 * r)


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("size", [0.0, 1.5, 30.0])
def test_correlation_is_found_beside_a_mismatch(rng, rho, size):
    series = [
        Series(FAST, (autoregression(rng, 626, rho) + size * (1 + 0.2 * i) * mismatch(FAST))[:, None]) for i in range(3)
    ]
    found = estimate(series)
    assert found.common
    assert float(found.noises[0].correlation(0.04)) == pytest.approx(rho, abs=0.09)
    assert found.levels == pytest.approx([1.0] * 3, rel=0.15)


def test_white_and_correlated_parts_are_told_apart():
    time, found = np.arange(1500) * 0.04, []
    for trial in range(4):
        rng = np.random.default_rng(trial)
        draws = [np.sqrt(0.5) * (wandering(rng, time, 0.4) + rng.normal(size=1500)) for _ in range(2)]
        noise = estimate([Series(time, x[:, None]) for x in draws]).noises[0]
        found.append((noise.share, noise.tau))
    share, tau = np.mean(found, axis=0)
    assert share == pytest.approx(0.5, abs=0.05)
    assert tau == pytest.approx(0.4, rel=0.25)


@pytest.mark.parametrize("size", [1.0, 3.0, 100.0])
def test_a_mismatch_with_kinks_is_not_taken_for_correlated_noise(rng, size):
    """Its spectrum falls as f^-4; a nuisance that falls less would leave some of it to the noise."""
    series = [Series(FAST, (rng.normal(size=626) + size * mismatch(FAST))[:, None]) for _ in range(3)]
    assert estimate(series).noises[0].share < 0.02


@pytest.mark.parametrize("third", [FAST, SLOW, LOGS], ids=["25 Hz", "1 Hz", "logarithmic"])
def test_noise_with_a_time_constant_is_judged_noise_at_any_sampling(third):
    """Nulls: two recordings at 25 Hz beside one at 25 Hz, 1 Hz or with samples that grow sparse."""
    sizes, correlations = [], []
    for trial in range(6):
        rng = np.random.default_rng(trial)
        times = (FAST, FAST, third)
        series = [Series(t, wandering(rng, t, 0.4)[:, None]) for t in times]
        found = estimate(series)
        white = [n.whiten(s.values[:, 0], s.time) for n, s in zip(found.noises, series)]
        n = sum(len(w) for w in white)
        sizes.append((sum(w @ w for w in white) - n) / np.sqrt(2 * n))
        correlations.append(portmanteau(white))
        assert found.common
        assert found.noises[0].tau == pytest.approx(0.4, rel=0.5)
    assert np.all(np.abs(correlations) < 3.5)
    assert abs(np.mean(correlations)) < 1.3  # a z-value: six of them have a mean of standard deviation 0.4
    assert np.all(np.abs(sizes) < 5)


def test_recordings_of_two_sensors_get_a_noise_each(rng):
    series = [
        Series(FAST, rng.normal(size=(626, 1))),
        Series(FAST, wandering(rng, FAST, 0.5)[:, None]),
    ]
    found = estimate(series)
    assert not found.common
    assert found.noises[0].share < 0.05
    assert found.noises[1].tau == pytest.approx(0.5, rel=0.5)


def filtered(rng, n, corner):
    """Behind a digital Butterworth filter of second order, of unit variance, and its autocorrelation by lag."""
    b, a = butter(2, corner)
    answer = lfilter(b, a, np.eye(1, 1000)[0])
    alike = np.correlate(answer, answer, "full")[999:] / (answer @ answer)
    return lfilter(b, a, rng.normal(size=n + 1000))[1000:] / np.sqrt(answer @ answer), alike


@pytest.mark.parametrize("corner", [0.06, 0.2])
@pytest.mark.parametrize("size", [0.0, 1.5, 30.0])
def test_a_filter_of_second_order_is_found_beside_a_mismatch(rng, corner, size):
    """Its corner follows the rate of each recording's converter. What means of 16 samples scatter by is right or too
    large by less than a half (a digital filter lets less through near half the rate than one in time: the time found
    is too long); taken for white it would be 2 to 4 times too small."""
    series, alike = [], np.ones(1)
    for time in (FAST, SLOW, FAST):
        noise, alike = filtered(rng, len(time), corner)
        series.append(Series(time, (noise + size * mismatch(time))[:, None]))
    found = estimate(series, orders=(1, 2))
    assert [n.order for n in found.noises] == [2, 2, 2]
    lag = np.abs(np.subtract.outer(np.arange(16), np.arange(16)))
    for noise, step in zip(found.noises, (0.04, 1.0, 0.04), strict=True):
        scatter = np.sqrt(np.mean(noise.covariance(np.arange(16) * step)) / np.mean(alike[lag]))
        assert 0.85 < scatter < 1.5
    # a series whose mismatch falls like its noise may count all of it as mismatch; the shape is the others'
    assert max(found.levels) == pytest.approx(1.0, rel=0.15)


@pytest.mark.parametrize("rho", [0.0, 0.9])
def test_no_filter_of_second_order_is_found_where_there_is_none(rng, rho):
    series = [Series(FAST, (autoregression(rng, 626, rho) + 5 * mismatch(FAST))[:, None]) for _ in range(3)]
    found = estimate(series, orders=(1, 2)).noises[0]
    assert found.order == 1
    assert float(found.correlation(0.04)) == pytest.approx(rho, abs=0.09)


@pytest.mark.parametrize("level", [0.5, 2.0])
def test_white_noise_of_another_size_than_recorded_stays_white(rng, level):
    found = estimate([Series(FAST, level * rng.normal(size=(626, 1)) + mismatch(FAST)[:, None]) for _ in range(2)])
    assert found.noises[0].share < 0.05
    assert found.levels == pytest.approx([level] * 2, rel=0.08)


def test_correlated_noise_of_less_than_was_recorded_is_found_with_its_size_and_time(rng):
    """A variance over T is known to sqrt(2 tau / T), 13 % here: a level to 6.3 %, three standard errors are 19 %."""
    series = [Series(FAST, 0.6 * wandering(rng, FAST, 0.2)[:, None]) for _ in range(3)]
    found = estimate(series)
    assert found.levels == pytest.approx([0.6] * 3, rel=0.19)
    assert found.noises[0].tau == pytest.approx(0.2, rel=0.25)


def test_what_exceeds_the_recorded_variance_is_no_noise(rng):
    """Correlated on all lags but five times as large as recorded: a mismatch that is no smooth function."""
    left = rng.normal(size=(626, 1)) + 5 * wandering(rng, FAST, 3.0)[:, None]
    found = estimate([Series(FAST, left)])
    assert np.mean(found.noises[0].whiten(left, FAST) ** 2) > 3


def test_whitened_noise_is_white_and_of_unit_variance(rng):
    noise = Noise.shaped(0.8, 0.4)
    mixed = [np.sqrt(0.8) * wandering(rng, LOGS, 0.4) + np.sqrt(0.2) * rng.normal(size=250) for _ in range(12)]
    white = [noise.whiten(x, LOGS) for x in mixed]
    assert np.var(np.concatenate(white)) == pytest.approx(1.0, abs=0.08)
    assert abs(portmanteau(white)) < 3.0
    assert portmanteau(mixed) > 10.0


def test_portmanteau_is_standard_normal_on_white_noise(rng):
    z = [portmanteau([rng.normal(size=400) for _ in range(3)]) for _ in range(200)]
    assert np.mean(z) == pytest.approx(0.0, abs=0.25)
    assert np.std(z) == pytest.approx(1.0, abs=0.15)


def test_series_too_short_to_tell_are_taken_as_white_or_like_the_others(rng):
    short = Series(np.arange(10.0), np.ones((10, 1)))
    assert estimate([short]).noises == (Noise(),)
    beside = estimate([Series(FAST, autoregression(rng, 626, 0.9)[:, None]), short])
    assert beside.noises[0] == beside.noises[1]
    assert beside.noises[0].share > 0.9
    assert estimate([]).noises == ()


def test_nothing_left_is_no_trouble():
    found = estimate([Series(FAST, np.zeros((626, 1)))])
    assert np.isfinite(found.levels[0])


@pytest.mark.slow
@pytest.mark.parametrize("third", [FAST, SLOW, LOGS], ids=["25 Hz", "1 Hz", "logarithmic"])
def test_nulls_of_correlated_noise_are_judged_noise_in_95_of_100(third):
    bad = 0
    for trial in range(100):
        rng = np.random.default_rng(1000 + trial)
        series = [Series(t, wandering(rng, t, 0.4)[:, None]) for t in (FAST, FAST, third)]
        found = estimate(series)
        white = [n.whiten(s.values[:, 0], s.time) for n, s in zip(found.noises, series)]
        bad += portmanteau(white) > 3.5
    assert bad <= 5


@pytest.mark.parametrize("seed", range(3, 6))
def test_noise_that_is_carried_from_sample_to_sample_keeps_its_level_beside_what_could_take_it_up(seed):
    """Behind filters that follow the converters' rates: in seconds the time of one would be right, and a wandering
    mismatch could be all that the other recording shows."""
    rng = np.random.default_rng(seed)
    steps, (b, a) = (0.1, 0.04), butter(2, 0.04)
    size = np.sqrt(np.sum(lfilter(b, a, np.eye(1, 4000)[0]) ** 2))
    noise = [lfilter(b, a, rng.normal(size=4700))[4000:] / size for _ in steps]
    series = [Series(step * np.arange(700), n[:, None]) for step, n in zip(steps, noise, strict=True)]
    found = estimate(series, orders=(1, 2))
    assert min(found.levels) > 0.7
    times = [n.tau / step for n, step in zip(found.noises, steps, strict=True)]
    np.testing.assert_allclose(times, np.mean(times), rtol=1e-6)  # in samples, not in seconds


@pytest.mark.parametrize("order", [1, 2])
def test_the_likelihood_is_that_of_the_dense_covariance(order, rng):
    """At trials of share, time and walk against dense matrices with the same prior, the level at its likeliest:
    log-normal about the recorded one, no more than that."""
    time = np.sort(rng.uniform(0, 20, 80))
    y = rng.normal(size=80) + 5 * np.sin(time)
    surface = correlation._Surface(Series(time, y[:, None]))
    seen = time - time[0]
    kept = surface.padded[0][:80]
    diffuse, span = surface.prior

    def dense(share, tau, walk):
        lesser, greater = np.minimum.outer(seen, seen), np.maximum.outer(seen, seen)
        k = Noise.shaped(share, tau, order=order).covariance(seen)
        k = k + walk * (lesser**2 * greater / 2 - lesser**3 / 6)  # integrated Wiener process, Wahba 1978
        k = k + diffuse * (1 + np.outer(seen, seen) / span**2)
        n = len(seen)
        whole, fixed = kept @ np.linalg.solve(k, kept), np.linalg.slogdet(k)[1]

        def above(log):
            level = norm.logpdf(0.5 * log, scale=math.log(2.0)) - norm.logpdf(0.0, scale=math.log(2.0))
            return 0.5 * (n * log + fixed + whole * math.exp(-log)) - level

        return -minimize_scalar(above, bounds=(-30.0, 0.0), method="bounded", options={"xatol": 1e-10}).fun

    shares, taus = np.linspace(0.1, 0.9, correlation.SHARES), np.geomspace(0.1, 5, correlation.TAUS)
    walks = surface.walks(surface.least, surface.most, correlation.WALKS)
    found, walk, _ = surface(shares, taus, walks, free=True, order=order)
    for i, j in ((0, 0), (3, 5), (5, 6)):
        assert walk[i, j] > 0
        theirs = dense(shares[i], taus[j], walk[i, j])
        assert found[i, j] == pytest.approx(theirs, abs=1e-5)


@pytest.mark.parametrize("order", [1, 2])
def test_the_order_of_a_low_pass_is_told_where_it_is_asked_for(order):
    """Drawn from the covariance matrix; 1.0 s of correlation at 12.5 Hz."""
    time = np.arange(400) * 0.08
    d = np.abs(time[:, None] - time) / 0.4
    factor = np.linalg.cholesky((np.exp(-d) if order == 1 else (1 + d) * np.exp(-d)) + 1e-9 * np.eye(len(time)))
    rng = np.random.default_rng(5)
    found = estimate(
        [Series(time, factor @ rng.normal(size=(400, 1))) for _ in range(2)], recorded=False, orders=(1, 2)
    )
    assert found.noises[0].order == order
    assert found.noises[0].tau == pytest.approx(0.4, rel=0.3)
    assert found.levels[0] == pytest.approx(1.0, rel=0.3)

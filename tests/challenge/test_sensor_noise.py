"""Noise of the challenge's sensors: marginal deviation, correlation in seconds, spectrum of a filter, whole steps."""

import numpy as np
import pytest
from scipy.signal import welch

from tissuejax.challenge.sensor_noise import Chain, chain, correlated, filtered, misstated


def test_correlated_noise_has_the_recorded_marginal_deviation(rng):
    e = correlated(rng, np.arange(200_000) * 0.04, 0.9)
    assert np.std(e) == pytest.approx(1.0, abs=0.03)
    assert np.corrcoef(e[1:], e[:-1])[0, 1] == pytest.approx(0.9, abs=0.01)


def test_correlation_is_told_in_seconds(rng):
    """At 12.5 Hz neighbours are as alike as every second sample at 25 Hz; far apart they know nothing of each other."""
    slow = correlated(rng, np.arange(200_000) * 0.08, 0.9)
    assert np.corrcoef(slow[1:], slow[:-1])[0, 1] == pytest.approx(0.81, abs=0.01)
    uneven = correlated(rng, np.cumsum(np.tile([0.04, 0.4], 50_000)), 0.9)
    assert np.std(uneven) == pytest.approx(1.0, abs=0.03)
    assert np.corrcoef(uneven[0::2], uneven[1::2])[0, 1] == pytest.approx(0.9**10, abs=0.02)
    assert np.corrcoef(uneven[2::2], uneven[1:-1:2])[0, 1] == pytest.approx(0.9, abs=0.01)


def test_a_filter_of_second_order_falls_with_the_fourth_power(rng):
    """|H|^2 = 1 / (1 + (tan(pi f) / tan(pi fc))^4) of the bilinear Butterworth filter, f over the sampling rate."""
    e = filtered(rng, np.arange(400_000) * 0.04, 0.2)
    assert np.std(e) == pytest.approx(1.0, abs=0.03)
    at, power = welch(e, nperseg=2000)
    shape = 1 / (1 + (np.tan(np.pi * at) / np.tan(np.pi * 0.1)) ** 4)
    seen = (at > 0.01) & (at < 0.3)
    ratio = power[seen] / shape[seen]
    np.testing.assert_allclose(ratio / np.median(ratio), 1.0, atol=0.35)


def test_readings_come_in_whole_steps_and_the_level_counts_them(rng):
    sensor = Chain(rounding=2.0)
    true = np.linspace(0.0, 400.0, 50_000)
    seen = sensor.read(rng, np.arange(50_000.0), true, 3.0)
    np.testing.assert_allclose(seen / 6.0, np.round(seen / 6.0), atol=1e-9)
    assert np.std(seen - true) == pytest.approx(3.0 * np.sqrt(1 + 4 / 12), rel=0.02)
    assert sensor.level == pytest.approx(np.sqrt(1 + 4 / 12))


def test_every_kind_of_noise_is_drawn():
    drawn = [chain(np.random.default_rng(i)) for i in range(2000)]
    white = sum(c == Chain() for c in drawn)
    kinds = [sum(getattr(c, k) > 0 for c in drawn) for k in ("correlation", "corner", "rounding")]
    np.testing.assert_allclose(np.array([white, *kinds]) / 2000, [0.4, 0.25, 0.175, 0.175], atol=0.04)


def test_a_level_is_stated_wrong_in_one_of_four_either_way_alike():
    drawn = np.log2([misstated(np.random.default_rng(i)) for i in range(2000)])
    assert np.mean(drawn == 0) == pytest.approx(0.75, abs=0.03)
    assert np.mean(drawn) == pytest.approx(0.0, abs=0.03)
    assert 0.95 < np.max(np.abs(drawn)) <= 1

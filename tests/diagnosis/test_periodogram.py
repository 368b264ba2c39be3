"""Lines in a spectrum: each frequency by its own sum, and a sinusoid where it is, as strong as it is."""

import numpy as np
import pytest

from tissuejax.diagnosis.periodogram import lines, periodogram


@pytest.mark.parametrize("n", [40, 230, 1000])
def test_every_frequency_is_the_sum_over_the_samples(n):
    rng = np.random.default_rng(n)
    series = [(np.append(0, np.sort(rng.uniform(0, 20, n - 1))), rng.standard_normal(n)) for _ in range(2)]
    frequencies, power, whole = periodogram(series)
    expected, squares = np.zeros(len(frequencies)), 0.0
    for t, y in series:
        r = y - np.polyval(np.polyfit(t, y, 2), t)
        squares += float(r @ r)
        expected += [2 * abs(np.sum(r * np.exp(-2j * np.pi * f * t))) ** 2 / n for f in frequencies]
    assert power == pytest.approx(expected, rel=1e-6, abs=1e-8)
    assert whole == pytest.approx(squares)
    assert np.diff(frequencies) == pytest.approx(0.2 / max(t[-1] for t, _ in series))


def test_two_hums_are_found_strongest_first_with_their_power():
    t = np.arange(0, 40, 0.05)
    y = 3 * np.sin(2 * np.pi * 1.7 * t + 0.4) + 5 * np.cos(2 * np.pi * 0.6 * t)
    frequencies, power, _ = periodogram([(t, y)])
    assert lines([(t, y)], 2) == pytest.approx([0.6, 1.7], abs=0.005)
    whole = 25 / 2 * len(t)  # amplitude squared, half of it on average
    nearest = np.sinc(0.1) ** 2  # a frequency between two that are asked is at most a tenth of the resolution off
    assert 0.99 * nearest * whole < np.max(power) < 1.01 * whole


def test_series_too_short_for_a_period_have_no_lines():
    t = np.linspace(0, 1, 5)
    assert lines([(t, t**3)], 3) == []

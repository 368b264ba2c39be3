"""Ljung and Box's statistic against sums done by hand, against a full correlation, and against the chi-square law."""

import math

import numpy as np
import pytest
from scipy.stats import chi2, norm

from tissuejax.estimation.whiteness import portmanteau

TURNING = np.array([1.0, -1.0] * 4)  # r1 = -7/8, r2 = 6/8: Q = 8 * 10 * (49/64/7 + 36/64/6) = 16.25 of 2 lags


def standard(q: float, dof: int) -> float:
    """Wilson and Hilferty's cube root of a chi-square variable over its degrees of freedom."""
    return ((q / dof) ** (1 / 3) - 1 + 2 / (9 * dof)) / math.sqrt(2 / (9 * dof))


def statistic(x: np.ndarray, lags: int) -> float:
    x = x - x.mean()
    r = np.correlate(x, x, "full")[len(x) :][:lags] / np.sum(x**2)
    return float(sum(len(x) * (len(x) + 2) * r[k - 1] ** 2 / (len(x) - k) for k in range(1, lags + 1)))


def test_a_series_that_turns_at_every_sample_by_hand():
    assert portmanteau([TURNING]) == pytest.approx(3 * (8.125 ** (1 / 3) - 8 / 9), rel=1e-13)
    assert portmanteau([5.0 + 3.0 * TURNING]) == pytest.approx(3 * (8.125 ** (1 / 3) - 8 / 9), rel=1e-13)
    one = 8 * 10 * 49 / 64 / 7
    assert portmanteau([TURNING], lags=1) == pytest.approx(standard(one, 1), rel=1e-13)
    assert portmanteau([TURNING[:4]]) == pytest.approx(standard(4 * 6 * (3 / 4) ** 2 / 3, 1), rel=1e-13)


def test_series_add_their_statistics_and_their_lags():
    four = 4 * 6 * (3 / 4) ** 2 / 3
    assert portmanteau([TURNING, TURNING[:4]]) == pytest.approx(standard(16.25 + four, 3), rel=1e-13)


def test_what_is_too_short_or_still_is_left_aside_and_the_rest_counts():
    assert portmanteau([]) == 0.0
    assert portmanteau([TURNING[:3], np.full(50, 2.0), np.zeros(0)]) == 0.0
    beside = portmanteau([TURNING[:3], TURNING, np.full(50, 2.0), TURNING[:4]])
    assert beside == portmanteau([TURNING, TURNING[:4]])


@pytest.mark.parametrize(("n", "asked", "lags"), [(79, None, 19), (80, None, 20), (100, None, 20), (100, 7, 7)])
def test_lags_up_to_a_quarter_of_the_samples_or_to_twenty(rng, n, asked, lags):
    x = 1.0 + rng.normal(size=n)
    found = portmanteau([x]) if asked is None else portmanteau([x], asked)
    q = statistic(x, lags)
    assert found == pytest.approx(standard(q, lags), rel=1e-11)
    assert found == pytest.approx(norm.isf(chi2.sf(q, lags)), abs=0.015), "the cube root of chi-square is near normal"

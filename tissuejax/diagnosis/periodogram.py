"""Lines in the spectrum of several series with phases of their own: least squares of a sinusoid at each frequency."""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Complex, Float

Series = Sequence[tuple[np.ndarray, np.ndarray]]


def periodogram(series: Series) -> tuple[Float[np.ndarray, " f"], Float[np.ndarray, " f"], float]:
    """Frequencies (Hz), summed power of a sinusoid in units of variance, and the whole sum of squares.

    A quadratic trend is removed first, frequencies run from two periods in the longest series to a quarter of the
    sampling rate in steps of a fifth of the resolution.

    Args:
        series: pairs of (time from the beginning in s, values).

    Source: Lomb 1976, Astrophys. Space Sci. 39.
    """
    longest = max(t[-1] for t, _ in series)
    step = max(float(np.median(np.diff(t))) for t, _ in series)
    top = min(0.25 / step, 400 / longest)
    if top <= 1.5 / longest:
        return np.zeros(0), np.zeros(0), 0.0
    frequencies = np.arange(1.5 / longest, top, 0.2 / longest)
    power, whole = np.zeros(len(frequencies)), 0.0
    for t, y in series:
        trend = np.polynomial.legendre.legvander(2 * t / t[-1] - 1, 2)
        r = y - trend @ np.linalg.lstsq(trend, y, rcond=None)[0]
        whole += float(r @ r)
        power += 2 * np.abs(_transform(frequencies, t, r)) ** 2 / len(r)
    return frequencies, power, whole


def _transform(
    frequencies: Float[np.ndarray, " f"], t: Float[np.ndarray, " n"], r: Float[np.ndarray, " n"]
) -> Complex[np.ndarray, " f"]:
    """sum r exp(-2 pi i f t) at evenly spaced frequencies: each is one of a few coarse ones and one of a few steps on,
    so that two tables of a root of their number do for all."""
    width = math.isqrt(len(frequencies) - 1) + 1
    coarse = np.exp(-2j * np.pi * np.outer(frequencies[::width], t)) * r
    fine = np.exp(-2j * np.pi * np.outer(frequencies[:width] - frequencies[0], t))
    return (coarse @ fine.T).ravel()[: len(frequencies)]


def lines(series: Series, most: int) -> list[float]:
    """Frequencies of the strongest separate peaks, Hz, strongest first."""
    frequencies, power, _ = periodogram(series)
    if not len(frequencies):
        return []
    inner = (power[1:-1] >= power[:-2]) & (power[1:-1] >= power[2:])
    peaks = np.flatnonzero(np.r_[True, inner, False])
    return [float(frequencies[i]) for i in peaks[np.argsort(-power[peaks])][:most]]

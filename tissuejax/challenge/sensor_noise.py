"""What a sensor adds to a true stress: noise, white, correlated or behind a filter, and rounding to whole steps."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.signal import butter, lfilter, sosfilt

STEP = 0.04  # s, over which a correlation is told
MEMORY = 4000  # samples after which a filter has forgotten what it was fed


@dataclass(frozen=True)
class Chain:
    """Noise of a sensor, its amplifier and its converter, relative to its standard deviation.

    Attributes:
        correlation: over `STEP` s, of a process of first order; 0 is white.
        corner: of a Butterworth filter of second order that the noise has passed, over half the sampling rate; 0: none.
        rounding: step to which readings are rounded, over the noise's standard deviation; 0: none.
    """

    correlation: float = 0.0
    corner: float = 0.0
    rounding: float = 0.0

    @property
    def level(self) -> float:
        """Standard deviation of all that it adds, rounding too (uniform: Bennett 1948), over that of the noise."""
        return float(np.sqrt(1 + self.rounding**2 / 12))

    def read(
        self, rng: np.random.Generator, time: Float[np.ndarray, " n"], stress: Float[np.ndarray, " n"], std: float
    ) -> Float[np.ndarray, " n"]:
        """What is read of this stress at these times (s); `std` of the noise in its unit."""
        unit = filtered(rng, time, self.corner) if self.corner > 0 else correlated(rng, time, self.correlation)
        seen = stress + std * unit
        step = self.rounding * std
        return step * np.round(seen / step) if step > 0 else seen


def chain(rng: np.random.Generator) -> Chain:
    """White in two of five, of first order in one of four, the others behind a filter or rounded, in equal parts."""
    turn = rng.random()
    if turn < 0.25:
        return Chain(correlation=float(rng.uniform(0.5, 0.95)))
    if turn < 0.425:
        return Chain(corner=float(np.exp(rng.uniform(np.log(0.05), np.log(0.6)))))
    if turn < 0.6:
        return Chain(rounding=float(rng.uniform(1.0, 3.0)))
    return Chain()


def misstated(rng: np.random.Generator) -> float:
    """What is stated of a noise level, over the true one: in one of four wrong, by up to a factor of two."""
    return float(np.exp(rng.uniform(-np.log(2.0), np.log(2.0)))) if rng.random() < 0.25 else 1.0


def correlated(rng: np.random.Generator, time: Float[np.ndarray, " n"], rho: float) -> Float[np.ndarray, " n"]:
    """Noise of unit variance at `time` (s) whose correlation over `STEP` is rho, white at rho = 0.

    A sensor's noise lives in seconds: samples further apart are less alike, rho^(dt/STEP).
    """
    white = rng.standard_normal(len(time))
    keep = rho ** (np.diff(time) / STEP) if rho > 0 else np.zeros(len(time) - 1)
    white[1:] *= np.sqrt(1 - keep**2)
    if np.allclose(keep, keep[:1]):
        return lfilter([1.0], [1.0, -float(keep[0])], white)
    for k, a in enumerate(keep):
        white[k + 1] += a * white[k]
    return white


def filtered(rng: np.random.Generator, time: Float[np.ndarray, " n"], corner: float) -> Float[np.ndarray, " n"]:
    """White noise behind a digital Butterworth filter of second order, of unit variance, at evenly spaced `time`."""
    sections = butter(2, corner, output="sos")
    answer = sosfilt(sections, np.eye(1, MEMORY)[0])
    return sosfilt(sections, rng.standard_normal(MEMORY + len(time)))[MEMORY:] / np.sqrt(np.sum(answer**2))

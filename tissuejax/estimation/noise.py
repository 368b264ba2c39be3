"""Noise of a sensor as a process in time: white, correlated (behind a low-pass of first or second order), or both.

A sensor, its amplifier and its filter have a time constant in seconds; two recordings at different rates, or samples
that grow sparse in a relaxation test, see the same process at other instants. So correlation is a function of the time
between samples, not of their number:

    cov(t, t') = white^2 [t = t'] + correlated^2 c(|t - t'| / tau),

    c(d) = exp(-d)            white noise behind a low-pass of first order (Ornstein-Uhlenbeck),
    c(d) = (1 + d) exp(-d)    behind one of second order, critically damped (Matern's of order 3/2).

The correlated part is Markov, with as many states as its order: with their mean and variance carried from sample to
sample (Kalman 1960), whitening and likelihood cost O(n) at any sampling. The innovations over their standard deviations
are L^-1 x, L the lower Cholesky factor of the covariance matrix.

Sources: Uhlenbeck and Ornstein 1930, Phys. Rev. 36:823; Kalman 1960, J. Basic Eng. 82:35; Jones 1980, Technometrics
22:389 (likelihood of unevenly sampled autoregressions); Hartikainen and Sarkka 2010, MLSP (Matern's in state space).
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float
from scipy.linalg import lapack

from tissuejax.errors import InputError

_banded = getattr(lapack, "dtbtrs")  # noqa: B009  its stubs don't list it

NEGLIGIBLE = 1e-3  # share of the variance, or correlation of neighbours, below which noise is treated as white


@dataclass(frozen=True)
class Noise:
    """White and correlated noise, independent of each other.

    Attributes:
        white: standard deviation of the white part, in the unit of the data (1 where these are scaled by theirs).
        correlated: standard deviation of the correlated part, same unit.
        tau: its correlation time, s: that of the low-pass.
        order: of the low-pass, 1 or 2.
    """

    white: float = 1.0
    correlated: float = 0.0
    tau: float = 1.0
    order: int = 1

    def __post_init__(self):
        if self.order not in (1, 2):
            raise InputError(f"noise behind a low-pass of order {self.order}; 1 and 2 are known")
        if not (self.white >= 0 and self.correlated >= 0 and self.white + self.correlated > 0 and self.tau > 0):
            raise InputError(
                f"noise with white part {self.white}, correlated part {self.correlated}, time {self.tau} s: standard "
                "deviations must not be negative nor both zero, the time must be positive"
            )

    @classmethod
    def shaped(cls, share: float, tau: float, std: float = 1.0, order: int = 1) -> "Noise":
        """Noise of standard deviation `std` of whose variance `share` is correlated over `tau` s."""
        return cls(std * math.sqrt(1 - share), std * math.sqrt(share), tau, order)

    @property
    def std(self) -> float:
        """Standard deviation of a single sample."""
        return math.hypot(self.white, self.correlated)

    @property
    def share(self) -> float:
        """Correlated part of the variance."""
        return self.correlated**2 / self.std**2

    def scaled(self, factor: float) -> "Noise":
        """The noise of data multiplied by `factor`."""
        return Noise(factor * self.white, factor * self.correlated, self.tau, self.order)

    @property
    def unit(self) -> "Noise":
        """The same shape with standard deviation 1."""
        return self.scaled(1 / self.std)

    def correlation(self, lag: Float[np.ndarray, "..."] | float) -> Float[np.ndarray, "..."] | np.floating:
        """Correlation of two different samples `lag` seconds apart."""
        return self.share * self._faded(np.abs(lag) / self.tau)

    def _faded(self, d):
        return np.exp(-d) if self.order == 1 else (1 + d) * np.exp(-d)

    def covariance(
        self, time: Float[np.ndarray, " n"], other: Float[np.ndarray, " m"] | None = None
    ) -> Float[np.ndarray, "n m"]:
        """Covariance matrix of samples at `time`; with `other`, of the correlated parts at two sets of times."""
        time = np.asarray(time, float)
        against = time if other is None else np.asarray(other, float)
        c = self.correlated**2 * self._faded(np.abs(time[:, None] - against[None, :]) / self.tau)
        return c + self.white**2 * np.eye(len(time)) if other is None else c

    def is_white(self, time: Float[np.ndarray, " n"]) -> bool:
        """Whether samples at `time` are as good as independent."""
        if self.share < NEGLIGIBLE or len(time) < 2:
            return True
        return float(self.correlation(np.min(np.diff(time)))) < NEGLIGIBLE

    def whiten(self, x: Float[np.ndarray, "n ..."], time: Float[np.ndarray, " m"]) -> Float[np.ndarray, "n ..."]:
        """L^-1 x, L L' the covariance at `time`: each sample less what those before foretell, over its standard error.

        Args:
            x: series in columns.
            time: s, not decreasing, one a sample: m = n.

        Raises:
            InputError: times that run backwards, or another number of them.
        """
        x = np.asarray(x, float)
        if len(x) != len(time):
            raise InputError(f"{len(x)} samples at {len(time)} times; one time a sample is needed")
        if self.is_white(time) or not x.size:
            return x / self.std
        columns = x.reshape(len(x), -1)
        if self.order == 2:
            foretold, variance = _foretold(self, np.asarray(time, float), columns)
            return ((columns - foretold) / np.sqrt(variance)[:, None]).reshape(x.shape)
        fade, gain, variance = _innovations(self, np.ascontiguousarray(time, float).tobytes())
        # m[k+1] = fade[k] ((1 - gain[k]) m[k] + gain[k] x[k]) is a bidiagonal system
        band = np.zeros((2, len(x)))
        band[0] = 1.0
        band[1, :-1] = -fade * (1 - gain[:-1])
        right = np.zeros_like(columns)
        right[1:] = (fade * gain[:-1])[:, None] * columns[:-1]
        foretold, info = _banded(band, right, uplo="L", diag="U")
        if info != 0:
            raise RuntimeError(f"dtbtrs: {info}")
        return ((columns - foretold) / np.sqrt(variance)[:, None]).reshape(x.shape)

    def log_density(self, x: Float[np.ndarray, "n ..."], time: Float[np.ndarray, " n"]) -> float:
        """Logarithm of the probability density of x, columns independent of each other."""
        z = self.whiten(x, time)
        columns = z.size // max(len(time), 1)
        return -0.5 * float(np.sum(z**2)) - columns * (0.5 * self.log_determinant(time)) - z.size * HALF_LOG_2PI

    def log_determinant(self, time: Float[np.ndarray, " n"]) -> float:
        """Logarithm of the determinant of the covariance at `time`."""
        if self.is_white(time):
            return 2 * len(time) * math.log(self.std)
        if self.order == 2:
            return float(np.sum(np.log(_foretold(self, np.asarray(time, float), np.zeros((len(time), 0)))[1])))
        return float(np.sum(np.log(_innovations(self, np.ascontiguousarray(time, float).tobytes())[2])))

    def effective(self, time: Float[np.ndarray, " n"]) -> float:
        """Independent samples that tell as much of a constant as those at `time`: std^2 1' C^-1 1."""
        return self.std**2 * float(np.sum(self.whiten(np.ones(len(time)), time) ** 2))

    def times(self, x: Float[np.ndarray, "n ..."], time: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n ..."]:
        """Covariance at `time` times x, in O(n): what came before fades forwards, what comes after backwards."""
        columns = np.asarray(x, float).reshape(len(time), -1)
        gaps = np.diff(np.asarray(time, float)) / self.tau
        both = self._before(gaps, columns) + self._before(gaps[::-1], columns[::-1])[::-1]
        return (self.std**2 * columns + self.correlated**2 * both).reshape(np.shape(x))

    def _before(self, gaps: Float[np.ndarray, " m"], x: Float[np.ndarray, "n k"]) -> Float[np.ndarray, "n k"]:
        """Sum over earlier samples of c(d) x, gaps over tau."""
        fade = np.exp(-gaps)
        near = _faded(fade, x)
        return near if self.order == 1 else near + _faded(fade, np.append(gaps, 0.0)[:, None] * (near + x))

    def squares(self, time: Float[np.ndarray, " n"]) -> float:
        """Sum of the squares of the covariance matrix at `time`; n std^4 for white noise."""
        gaps = np.diff(np.asarray(time, float)) / self.tau
        fade, one = np.exp(-2 * gaps), np.ones((len(time), 1))
        before = _faded(fade, one)
        if self.order == 2:  # (1 + d)^2 exp(-2 d), by the sums of d exp(-2 d) and d^2 exp(-2 d)
            wide = np.append(gaps, 0.0)[:, None]
            first = _faded(fade, wide * (before + one))
            second = _faded(fade, wide * (2 * first + wide * (before + one)))
            before = before + 2 * first + second
        return len(time) * self.std**4 + 2 * self.correlated**4 * float(np.sum(before))

    def sample(self, rng: np.random.Generator, time: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """One draw at `time`."""
        time = np.asarray(time, float)
        if self.order == 2:
            return self.correlated * _drawn(rng, np.diff(time) / self.tau) + self.white * rng.normal(size=len(time))
        fade = np.exp(-np.diff(time) / self.tau)
        kick = np.concatenate([[1.0], np.sqrt(-np.expm1(-2 * np.diff(time) / self.tau))]) * rng.normal(size=len(time))
        part = np.empty(len(time))
        last = 0.0
        for k, f in enumerate(np.concatenate([[0.0], fade])):
            last = part[k] = f * last + kick[k]
        return self.correlated * part + self.white * rng.normal(size=len(time))


def _faded(fade: Float[np.ndarray, " m"], x: Float[np.ndarray, "n k"]) -> Float[np.ndarray, "n k"]:
    """m[i] = fade[i-1] (m[i-1] + x[i-1]), m[0] = 0."""
    if not x.size:  # without a right-hand side LAPACK's wrapper writes where it may not, and the process ends later
        return np.zeros_like(x)
    band = np.ones((2, len(x)))
    band[1, :-1] = -fade
    right = np.zeros_like(x)
    right[1:] = fade[:, None] * x[:-1]
    return _banded(band, right, uplo="L", diag="U")[0]


def _second(gap: float) -> tuple[np.ndarray, np.ndarray]:
    """Transition over `gap` (over tau) of the low-pass of second order and of tau times its rate, and what is fresh."""
    move = math.exp(-gap) * np.array([[1 + gap, gap], [-gap, 1 - gap]])
    return move, np.eye(2) - move @ move.T


def _foretold(
    noise: Noise, time: Float[np.ndarray, " n"], x: Float[np.ndarray, "n k"]
) -> tuple[np.ndarray, np.ndarray]:
    """What the samples before say of each, and the variance that is left (n); low-pass of second order."""
    gaps = np.diff(time) / noise.tau
    if np.any(gaps < 0):
        k = int(np.argmax(gaps < 0))
        raise InputError(f"time runs backwards after sample {k} ({time[k]} s); sort the samples")
    white, power, least = noise.white**2, noise.correlated**2, 1e-12 * noise.std**2
    out, variance = np.zeros_like(x), np.empty(len(time))
    mean, spread = np.zeros((2, x.shape[1])), power * np.eye(2)
    for k in range(len(time)):
        variance[k] = max(spread[0, 0] + white, least)
        out[k] = mean[0]
        gain = spread[:, 0] / variance[k]
        mean = mean + gain[:, None] * (x[k] - mean[0])
        spread = spread - np.outer(gain, spread[0])
        if k < len(gaps):
            move, fresh = _second(gaps[k])
            mean, spread = move @ mean, move @ spread @ move.T + power * fresh
    return out, variance


def _drawn(rng: np.random.Generator, gaps: Float[np.ndarray, " m"]) -> Float[np.ndarray, " n"]:
    """One draw of the low-pass of second order, of standard deviation 1."""
    state, out = rng.normal(size=2), np.empty(len(gaps) + 1)
    out[0] = state[0]
    for k, gap in enumerate(gaps, start=1):
        move, fresh = _second(gap)
        values, vectors = np.linalg.eigh(fresh)
        state = move @ state + vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.normal(size=2))
        out[k] = state[0]
    return out


HALF_LOG_2PI = 0.5 * math.log(2 * math.pi)


@lru_cache(maxsize=256)
def _innovations(noise: Noise, times: bytes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fading between samples (n - 1), Kalman gain and variance of the innovation of each (n)."""
    time = np.frombuffer(times)
    steps = np.diff(time)
    if np.any(steps < 0):
        k = int(np.argmax(steps < 0))
        raise InputError(f"time runs backwards after sample {k} ({time[k]} s); sort the samples")
    fade = np.exp(-steps / noise.tau)
    fresh = noise.correlated**2 * -np.expm1(-2 * steps / noise.tau)
    gain, variance = np.empty(len(time)), np.empty(len(time))
    white, known = noise.white**2, noise.correlated**2
    least = 1e-12 * noise.std**2  # two samples at one time without a white part tell the same
    for k, (f, q) in enumerate(zip([*(fade**2).tolist(), 0.0], [*fresh.tolist(), 0.0])):
        v = max(known + white, least)
        g = known / v
        gain[k], variance[k] = g, v
        known = f * (known * (1 - g)) + q
    return fade, gain, variance

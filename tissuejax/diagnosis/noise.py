"""What the sensor's noise looks like, estimated although the prediction is wrong, and whitening by it.

The recorded standard deviation is the marginal one: it says nothing of how the noise at one sample depends on
the noise before. A residual that is smooth because physics is missing must not be taken for correlated noise, or
nothing would ever be found. Two facts keep them apart: the marginal variance is known, and a mismatch driven by
piecewise-smooth motions has a spectrum that falls at least as f^-4 (kinks), while that of exponentially
correlated noise never falls faster than f^-2. So the spectrum of the residual is fitted (Whittle's likelihood) by

    S(f) = (1 - c) + c (1 - rho^2) / (1 - 2 rho cos 2 pi f dt + rho^2) + A f^-4 :

white noise, exponentially correlated noise, their variances adding up to the recorded one, and a nuisance.

Sources: Whittle 1953, Ark. Mat. 2; Percival and Walden 1993, Spectral Analysis for Physical Applications, ch. 9.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float
from scipy.linalg import cholesky, solve_triangular, toeplitz
from scipy.optimize import minimize
from scipy.special import expit

BLOCK = 1024  # samples whitened together: a dense factor of this size costs 0.1 s and 8 MiB


@dataclass(frozen=True)
class Noise:
    """A stationary noise of unit variance: white, exponentially correlated, or both.

    Attributes:
        share: variance of the correlated part over the whole, c.
        rho: its correlation between neighbouring samples.
    """

    share: float = 0.0
    rho: float = 0.0
    _factors: dict = field(default_factory=dict, compare=False, repr=False)

    def correlation(self, n: int) -> Float[np.ndarray, " n"]:
        """Autocorrelation at lags 0 to n - 1."""
        r = self.share * self.rho ** np.arange(n)
        r[0] = 1.0
        return r

    @property
    def inflation(self) -> float:
        """Samples per independent sample, for smooth signals: sum of the autocorrelation over all lags."""
        return 1.0 + 2.0 * self.share * self.rho / (1.0 - self.rho)

    def whiten(self, x: Float[np.ndarray, "n ..."]) -> Float[np.ndarray, "n ..."]:
        """L^-1 x with L L' the correlation matrix, in blocks of at most BLOCK samples."""
        if self.share < 1e-3 or self.rho < 1e-3:
            return x
        out = np.empty_like(x)
        for start in range(0, len(x), BLOCK):
            part = x[start : start + BLOCK]
            n = len(part)
            if n not in self._factors:
                self._factors[n] = cholesky(toeplitz(self.correlation(n)), lower=True)
            out[start : start + n] = solve_triangular(self._factors[n], part, lower=True, check_finite=False)
        return out


def _periodogram(x: Float[np.ndarray, "n k"]) -> tuple[np.ndarray, np.ndarray, int]:
    """Angular frequency per sample, mean power of k series (1 for unit white noise) and k; the ends tapered off."""
    n = len(x)
    window = np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2
    window /= math.sqrt(np.mean(window**2))
    power = np.mean(np.abs(np.fft.rfft(window[:, None] * (x - np.mean(x, axis=0)), axis=0)) ** 2, axis=1) / n
    keep = slice(3, -1)  # the lowest frequencies belong to drifts, the last has another distribution
    return 2 * np.pi * np.arange(n // 2 + 1)[keep] / n, power[keep], x.shape[1]


def estimate(residuals: list[Float[np.ndarray, "n k"]], least: int = 64) -> Noise:
    """Noise correlation common to several series of (prediction - measurement) / noise_std.

    Args:
        residuals: one array a recording, its k columns sampled alike; short ones (< `least`) are left out.

    Returns:
        White noise where nothing else is clearly better (2 Akaike units a parameter beyond its cost).
    """
    spectra = [_periodogram(np.asarray(r)) for r in residuals if len(r) >= least]
    if not spectra:
        return Noise()

    def cost(x: np.ndarray, white: bool) -> float:
        share, rho = (0.0, 0.0) if white else (expit(x[0]), 0.995 * expit(x[1]))
        total = 0.0
        for (w, p, k), a in zip(spectra, x[0 if white else 2 :]):
            s = 1 - share + share * (1 - rho**2) / (1 - 2 * rho * np.cos(w) + rho**2)
            s = s + np.exp(np.clip(a, -60, 60)) * w**-4.0
            total += k * float(np.sum(np.log(s) + p / s))
        return total / 1.5  # the taper makes neighbouring ordinates depend on each other

    start = np.full(len(spectra), -12.0)
    options = {"maxiter": 200}
    best_white = minimize(cost, start, args=(True,), method="L-BFGS-B", options=options)
    trials = [
        minimize(cost, np.r_[a, b, best_white.x], args=(False,), method="L-BFGS-B", options=options)
        for a, b in ((2.0, 0.0), (0.0, 2.5), (3.0, 2.5))
    ]
    best = min(trials, key=lambda t: t.fun)
    if 2 * (best_white.fun - best.fun) < 8.0:
        return Noise()
    return Noise(float(expit(best.x[0])), 0.995 * float(expit(best.x[1])))


def portmanteau(white: list[Float[np.ndarray, " n"]], lags: int = 20) -> float:
    """z-value of Ljung-Box's test that whitened series hold no correlation up to `lags`; about normal under the null.

    Source: Ljung and Box 1978, Biometrika 65.
    """
    q = dof = 0.0
    for x in white:
        n = len(x)
        k = min(lags, n // 4)
        if k < 1:
            continue
        x = x - np.mean(x)
        c0 = float(x @ x)
        if c0 == 0.0:
            continue
        r = np.array([float(x[i:] @ x[:-i]) / c0 for i in range(1, k + 1)])
        q += n * (n + 2) * float(np.sum(r**2 / (n - np.arange(1, k + 1))))
        dof += k
    if dof == 0:
        return 0.0
    return (((q / dof) ** (1 / 3)) - (1 - 2 / (9 * dof))) / math.sqrt(2 / (9 * dof))  # Wilson and Hilferty 1931

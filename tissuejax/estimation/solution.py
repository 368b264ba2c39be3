"""The solution of a least-squares problem, as a fit and a diagnosis share it."""

import abc
import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from tissuejax.estimation.quantile import quantile


class Limits(NamedTuple):
    """Where an estimate may lie, and whether it moves in logarithm (positive over decades)."""

    lower: float
    upper: float
    log: bool = False


class Solution(abc.ABC):
    """Estimates and how sure they are.

    What a user fits is one (`fitting.result.Fit`), and so is every fit of the model with further effects that a
    diagnosis makes (`diagnosis.refit.Refit`).

    Attributes:
        values: by path, SI.
        std: standard errors of those that were estimated; infinite where nothing is seen, NaN on a bound.
        chi2: sum of squared residuals in units of the noise, priors left out by a diagnosis.
    """

    values: Mapping[str, float]
    std: Mapping[str, float]
    chi2: float

    @property
    @abc.abstractmethod
    def freedom(self) -> float:
        """Degrees of freedom of the noise level behind `std`; infinite where the recorded one was used."""

    @abc.abstractmethod
    def limits(self, path: str) -> Limits:
        """Of one estimate."""

    def estimate(self, path: str) -> float:
        """The estimate that `std` belongs to."""
        return self.values[path]

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """95 % intervals by path."""
        return self.within(0.95)

    def within(self, confidence: float) -> dict[str, tuple[float, float]]:
        """Value -+ Student's quantile times standard error, cut at the limits.

        Of paths that move in logarithm the interval is the logarithm's: it never reaches zero.
        """
        q, found = quantile(confidence, self.freedom), {}
        for path, std in self.std.items():
            if math.isnan(std):
                continue
            value, (lower, upper, log) = self.estimate(path), self.limits(path)
            if log:
                with np.errstate(over="ignore"):
                    reach = float(np.exp(q * std / value))
                low, high = value / reach, value * reach
            else:
                low, high = value - q * std, value + q * std
            found[path] = max(low, lower), min(high, upper)
        return found

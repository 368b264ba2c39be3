"""Quantiles of intervals: the normal distribution's where the noise level is known, Student's where it was estimated.

Source: Student 1908, Biometrika 6:1.
"""

import math
from statistics import NormalDist

from scipy.special import stdtrit


def quantile(confidence: float = 0.95, dof: float = math.inf) -> float:
    """Half-width of a two-sided interval over the standard error.

    Args:
        confidence: share of intervals that hold the truth, between 0 and 1.
        dof: degrees of freedom from which the noise level was estimated; infinite where it is known.
    """
    if math.isfinite(dof):
        return float(stdtrit(dof, 0.5 + confidence / 2))
    return NormalDist().inv_cdf(0.5 + confidence / 2)

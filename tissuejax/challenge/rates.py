"""Shares of cases with their intervals, spreads of numbers, and the bins of stated confidence."""

import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np

STATED = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0)  # bins of stated confidence


def rate(marks: Sequence, is_true: Callable[..., bool]) -> dict:
    """Share of cases with Wilson's 95 % interval (Wilson 1927)."""
    n, k = len(marks), sum(is_true(m) for m in marks)
    if n == 0:
        return {"share": None, "low": None, "high": None, "of": 0}
    z, p = 1.96, k / n
    middle, half = p + z * z / (2 * n), z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    low, high = ((middle + side) / (1 + z * z / n) for side in (-half, half))
    return {"share": p, "low": max(low, 0.0), "high": min(high, 1.0), "of": n}  # rounding leaves the ends of 0 and 1


def spread(values: Iterable[float]) -> dict:
    """Median, 90 % quantile, largest, number, and share at most 1.1."""
    x = np.array(list(values), float)
    if not len(x):
        return {"of": 0}
    return {
        "median": float(np.median(x)),
        "q90": float(np.quantile(x, 0.9)),
        "largest": float(x.max()),
        "at_most_1.1": float(np.mean(x <= 1.1)),
        "of": len(x),
    }

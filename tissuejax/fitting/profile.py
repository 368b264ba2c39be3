"""Profile likelihood: how the best misfit grows as one parameter is held away from its estimate.

Unlike the standard error it does not assume a parabola; where the profile stays flat the parameter is not identified,
on that side.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from tissuejax.errors import unknown
from tissuejax.fitting.least_squares import descend
from tissuejax.fitting.result import Fit


@dataclass(frozen=True)
class Profile:
    """Profile of one parameter.

    Attributes:
        path: the parameter.
        values: where it was held, ascending.
        rise: increase of chi-square over the best fit, in units of the noise that the standard errors rest on (its
            level, its correlation).
        interval: where the rise crosses the square of the quantile of the standard error (95 %: 3.84, more where the
            noise's level comes from few residuals); infinite on a side where it does not within the scan.
    """

    path: str
    values: Float[np.ndarray, " n"]
    rise: Float[np.ndarray, " n"]
    interval: tuple[float, float]


def profile(found: Fit, path: str, *, reach: float = 3.0, points: int = 6) -> Profile:
    """The profile likelihood of one free parameter, `points` on either side to `reach` standard errors (further while
    flat).

    Raises:
        InputError: a parameter that was not free.
    """
    if path not in found.free:
        raise unknown("free parameter", path, found.free)
    problem, centre = found.problem, found.values[path]
    lower, upper = problem.bound(path)
    std = found.std[path]
    declared = problem.predictor.model.parameters[path]
    if not np.isfinite(std) or std > 10 * declared.typical + 10 * abs(centre):
        std = max(abs(centre), declared.typical)
    rest = tuple(p for p in problem.free if p != path)
    spread = found.uncertainty
    inflation = 1.0 if spread.inflation is None else float(spread.inflation[found.free.index(path)])
    threshold = spread.quantile() ** 2
    values, rises = [centre], [0.0]
    for side in (-1, 1):
        warm = dict(found.values)
        for k in range(1, 3 * points + 1):
            at = centre + side * reach * std * k / points
            if not lower < at < upper:
                break
            warm = warm | {path: at}
            held = replace(problem, free=rest, start=warm) if rest else None
            if held is None:
                chi2 = float(np.sum(problem.residuals(warm) ** 2))
            else:
                end = descend(held, warm)
                chi2, warm = 2 * end.cost, held.values(end.y)
            values.append(at)
            rises.append((chi2 - found.chi2) / inflation)
            if k >= points and rises[-1] > threshold:
                break
    order = np.argsort(values)
    values, rises = np.asarray(values)[order], np.asarray(rises)[order]
    return Profile(path, values, rises, crossing(values, rises, centre, threshold))


def crossing(values: np.ndarray, rises: np.ndarray, centre: float, threshold: float) -> tuple[float, float]:
    """Where the rise first exceeds the threshold on either side of the centre, by interpolation of its root."""
    ends = []
    for side in (-1, 1):
        walk = [(v, r) for v, r in zip(values, rises, strict=True) if side * (v - centre) >= 0]
        walk.sort(key=lambda vr: side * (vr[0] - centre))
        end = side * float("inf")
        for (v0, r0), (v1, r1) in zip(walk, walk[1:], strict=False):
            if r1 > threshold:  # near the best fit a parabola: straight in the root
                share = (math.sqrt(threshold) - math.sqrt(max(r0, 0))) / (math.sqrt(r1) - math.sqrt(max(r0, 0)))
                end = v0 + (v1 - v0) * share
                break
        ends.append(float(end))
    return ends[0], ends[1]

"""Mass of a set's parameters between the ends of their ranges, where Laplace's method alone knows of no ends.

A share that may not be negative and of which the data say little would else count twice what it has, and the share of
a law, between 0 and 1, as much as its prior is wide: the more such parameters a form has, the likelier it would be.
Of what rests on an end the mass lies beside it; of what lies between, that of a normal density in the box of all ends
(two shares whose sum alone is known cut each other off).

Source: Laplace's method on a bounded domain, Bleistein and Handelsman 1986, sec. 5.1; the mass in a box: Genz and Bretz
2009, Computation of Multivariate Normal and t Probabilities (`scipy.stats.multivariate_normal`).
"""

import math

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import erfcx, log_ndtr
from scipy.stats import multivariate_normal

from tissuejax.diagnosis.judgement.marginal import Blocked, Linear, smooth
from tissuejax.diagnosis.refit import Resting

LEVEL = 1e-6  # nats: what falls by less from one end to the other is flat
UNCUT = 1e-6  # of its mass: what the ends of a parameter's own range cut off less of has no end
DRAWN = 500  # a dimension of a box, at which its mass is asked; right to some thousandths
ROUNDED = 1e-14  # of the largest eigenvalue of a precision that is scaled to one: below that is rounding


def between(low: float, high: float) -> float:
    """Log of the mass of a standard normal density between two ends."""
    if low > 0:
        low, high = -high, -low
    return float(log_ndtr(high) + math.log1p(-math.exp(min(log_ndtr(low) - log_ndtr(high), -1e-12))))


def beside(slope: float, curvature: float, room: float = math.inf) -> float:
    """Log of int_0^room exp(-slope x - curvature x^2 / 2) dx: what a parameter on its bound has beside it."""
    s, h = max(slope, 0.0), max(curvature, 1e-300)
    whole = 0.5 * math.log(math.pi / (2 * h)) + math.log(erfcx(s / math.sqrt(2 * h)))
    if not math.isfinite(room):
        return whole
    if s * room + 0.5 * h * room**2 < LEVEL:
        return math.log(room)
    beyond = -s * room - 0.5 * h * room**2 + beside(s + h * room, h) - whole
    return whole + math.log1p(-math.exp(min(beyond, -1e-12)))


def within(resting: Resting, free: Bool[np.ndarray, " p"], precision: Float[np.ndarray, "q q"]) -> float:
    """Log of the share of mass that the `free` parameters, of that precision, have between the ends of their ranges."""
    if not free.any():
        return 0.0
    unit = 1 / np.sqrt(np.diag(precision))
    sizes, turned = np.linalg.eigh(precision * np.outer(unit, unit))
    covariance = (turned / np.maximum(sizes, ROUNDED * sizes[-1])) @ turned.T
    spread = np.sqrt(np.diag(covariance))
    low, high = -resting.below[free] / (unit * spread), resting.above[free] / (unit * spread)
    own = np.array([between(float(a), float(b)) for a, b in zip(low, high, strict=True)])
    cut = own < math.log1p(-UNCUT)
    if np.sum(cut) < 2:
        return float(np.sum(own[cut]))
    alike = (covariance / np.outer(spread, spread))[np.ix_(cut, cut)]
    box = multivariate_normal.cdf(
        high[cut], cov=alike, allow_singular=True, maxpts=DRAWN * len(alike), lower_limit=low[cut], rng=0
    )
    return math.log(box) if box > 0 else float(np.sum(own[cut]))


def on_bounds(
    blocked: Blocked, parts, v: np.ndarray, every: Linear, resting: Resting, free, precision: Float[np.ndarray, "q q"]
) -> float:
    """Log mass beside the bounds of what rests on them, of `every` parameter of a set.

    Each with the `free` parameters, of that precision, integrated out: what they take up of its curvature is no
    information on it. Of two on their bounds the other is held.
    """
    if not resting.on.any():
        return 0.0
    inverse = [np.linalg.inv(b) for b in blocked.within(parts, v)]
    u = smooth(parts, v)

    def solve(a: np.ndarray) -> np.ndarray:
        return np.concatenate([i @ a[r] for i, r in zip(inverse, blocked.rows, strict=True)])

    g = solve(u)
    inner = np.eye(u.shape[1]) + u.T @ g

    def whole(a: np.ndarray) -> np.ndarray:
        light = solve(a)
        return light - g @ np.linalg.solve(inner, u.T @ light)

    jac, weak, offset = every.jacobian, every.weak, every.offset
    w, total = whole(every.residual), 0.0
    others = whole(jac[:, free])
    for i in np.flatnonzero(resting.on):
        slope = float(resting.side[i]) * float(weak[i] * offset[i] - jac[:, i] @ w)
        shared = jac[:, i] @ others
        taken = shared @ np.linalg.solve(precision, shared) if len(shared) else 0.0
        curvature = float(jac[:, i] @ whole(jac[:, i]) + weak[i] - taken)
        if curvature > 0:
            room = float(resting.below[i] + resting.above[i])
            total += beside(slope, curvature, room) - 0.5 * float(weak[i] * offset[i] ** 2)
    return total

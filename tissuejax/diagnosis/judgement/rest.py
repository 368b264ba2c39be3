"""What a set leaves beside noise: the discrepancy's posterior, its size, and what of it is laid to a simulation."""

import math
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.judgement.marginal import Linear, smooth
from tissuejax.estimation.discrepancy import Part

if TYPE_CHECKING:
    from tissuejax.diagnosis.judgement.criteria import Criteria
    from tissuejax.diagnosis.judgement.scales import Scales

SLICES = 200  # in which an integral over a noise level is taken


def beyond(scales: "Scales", linear: Linear, smoothed: np.ndarray, scatter: np.ndarray) -> tuple[np.ndarray, ...]:
    """The rest and its variance over the size, without what the set's own parameters could take up as well.

    Under the discrepancy parameters may settle off the place that is nearest to the recordings; what lies between is no
    rest: the fit that is shown takes it up. And few recordings of a simulation with a wide law hold neither parameters
    nor law along what they share.
    """
    size = np.full(len(smoothed), scales.peak) if scales.size is None else scales.size
    left, slopes = smoothed / size, linear.jacobian / size[:, None]
    return left - slopes @ np.linalg.lstsq(slopes, left, rcond=None)[0], scatter / size**2


def rest(
    scales: "Scales",
    parts: Sequence[Part],
    v: Float[np.ndarray, " K"],
    residual: Float[np.ndarray, " M"],
    named: Collection[str] = (),
):
    """Posterior mean and variance of the discrepancy at the blocks, without scatter from sample to sample, without
    what has a name and without the known error of a simulation (the variance is that of all together)."""
    white = np.array([p.family == "white" for p in parts])
    noise = scales.blocked
    inverse = [np.linalg.inv(b) for b in noise.within(parts, v)]
    u = smooth(parts, v)
    light = np.concatenate([i @ residual[r] for i, r in zip(inverse, noise.rows, strict=True)])
    g = np.concatenate([i @ u[r] for i, r in zip(inverse, noise.rows, strict=True)])
    inner = np.linalg.inv(np.eye(u.shape[1]) + u.T @ g)
    w = light - g @ (inner @ (g.T @ residual))
    # y = d + e with var(e) = N: mean of d is y - N K^-1 y, its variance N - N K^-1 N
    scattered = noise.within([p for p, x in zip(parts, white, strict=True) if x], v[white])
    meant, wide = residual.copy(), np.empty(len(residual))
    for n, i, r in zip(scattered, inverse, noise.rows, strict=True):
        meant[r] -= n @ w[r]
        own = i - (g[r] @ inner) @ g[r].T
        wide[r] = np.diag(n) - np.einsum("ij,jk,ki->i", n, own, n)
    known = [x * _times(p, noise.rows, w) for p, x in zip(parts, v, strict=True) if p.family in {"numerical", *named}]
    return meant - sum(known), np.maximum(wide, 0.0)


def _times(part: Part, rows: Sequence[slice], w: Float[np.ndarray, " M"]) -> Float[np.ndarray, " M"]:
    if part.factor is not None:
        return part.factor @ (part.factor.T @ w)
    return np.concatenate([b @ w[r] for b, r in zip(part.within, rows, strict=True)])


def wobble(mean: np.ndarray, variance: np.ndarray, alike: int) -> float:
    """Standard deviation of the mean square of a normal vector of which so many neighbours are one."""
    each = 2 * variance**2 + 4 * variance * mean**2
    return math.sqrt(alike * float(np.sum(each))) / len(mean)


def numerical(scales: "Scales", parts: Sequence[Part], v: Float[np.ndarray, " K"]) -> float:
    """Root mean square of what is laid to mesh and step, a share of the peak."""
    squares = [x * np.mean(_variance(p)) for p, x in zip(parts, v, strict=True) if p.family == "numerical"]
    return math.sqrt(float(sum(squares))) / scales.peak


def _variance(part: Part) -> Float[np.ndarray, " M"]:
    if part.factor is not None:
        return np.sum(part.factor**2, axis=1)
    return np.concatenate([np.diag(b) for b in part.within])


def scatter(scales: "Scales", parts: Sequence[Part], v: Float[np.ndarray, " K"]) -> Float[np.ndarray, " M"]:
    """Variance of what scatters from sample to sample beside the stated noise, over the noise's, by block."""
    extra = np.zeros(len(scales.blocked.sigma))
    for part, x in zip(parts, v, strict=True):
        if part.family == "white" and part.within is not None:
            extra += x * _variance(part)
    return extra / scales.blocked.sigma**2


def unlike_noise(
    scales: "Scales", parts: Sequence[Part], v: Float[np.ndarray, " K"], criteria: "Criteria"
) -> tuple[float, float]:
    """Whether something of what scatters from sample to sample is a rest (spikes, teeth of stick and slip): see
    `told_apart`. Nothing where the level was not stated, or is of a simulation too."""
    if scales.bench.estimated or scales.bench.costly:
        return 0.0, 0.0
    stated = float(np.mean(scales.blocked.sigma**2))
    extra = float(np.mean(scatter(scales, parts, v) * scales.blocked.sigma**2))
    return told_apart(math.sqrt(1 + extra / stated), math.sqrt(stated) / scales.peak, criteria)


def told_apart(factor: float, stated: float, criteria: "Criteria") -> tuple[float, float]:
    """Probability that not all is noise where samples scatter by `factor` times a `stated` level (a share of the peak),
    and the mean square of what isn't then, a share of the squared peak.

    One part of it is noise, whose level is some factor of the stated one (`Criteria.misstated`); the other a rest:
    none, or, with the probability of what is unknown, one as large as what is strange.
    """
    if factor <= 1:
        return 0.0, 0.0

    def known(x):
        return normal(np.log(x), math.log(criteria.misstated)) / x

    level = factor * (np.arange(SLICES) + 0.5) / SLICES  # of the noise, over the stated one
    size = stated * np.sqrt(factor**2 - level**2)  # of the rest that this leaves
    strange = 2 * normal(size, criteria.strange * criteria.shares["white"])
    rests = known(level) * strange * stated**2 * factor / size * factor / SLICES  # d size / d factor times d level
    one = criteria.unknown * float(np.sum(rests))
    none = (1 - criteria.unknown) * float(known(factor))
    return one / (one + none), float(rests @ size**2 / np.sum(rests))


def normal(x: Float[np.ndarray, "..."] | float, scale: float) -> Float[np.ndarray, "..."]:
    """Density of a normal distribution about nothing."""
    return np.exp(-0.5 * (np.asarray(x) / scale) ** 2) / (scale * math.sqrt(2 * math.pi))


def level(scales: "Scales", parts: Sequence[Part], v: Float[np.ndarray, " K"]) -> float:
    """What scatters from sample to sample over the stated noise; 1 where that was not stated."""
    return 1.0 if scales.bench.estimated else math.sqrt(1 + float(np.median(scatter(scales, parts, v))))

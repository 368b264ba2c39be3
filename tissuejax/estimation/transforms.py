"""Bounds by change of variable, so that a solver without bounds never leaves the valid range.

With a scale s (the typical magnitude of the parameter) the free variable y gives

    no bound      x = s y
    no bound, and a magnitude that may range over decades (Ogden's mu)      x = 1e-3 s sinh(y)
    lower only    x = lower + s softplus(y)
    upper only    x = upper - s softplus(-y)
    both          x = lower + (upper - lower) sigmoid(y)

Far from a bound these are linear in y, near it exponential. Numpy, not JAX: a solver needs x and dx/dy between two
evaluations of the model, never inside one.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError

FAR = 60.0  # of y, where sinh is still finite
NUDGE = 1e-3  # a start at a bound is moved inside by this share of the scale (or of the width)
DECADES = 1e-3  # share of the scale below which a wide-ranging parameter is linear in y, above it logarithmic
AT_BOUND = 2e-3  # an estimate this near to a bound, as a share of scale or width, is reported as being at it


def checked_bounds(path: str, lower: float, upper: float) -> tuple[float, float]:
    """The pair itself, if it is one.

    Raises:
        InputError: not a number, or lower >= upper.
    """
    if math.isnan(lower) or math.isnan(upper) or not lower < upper:
        raise InputError(f"bounds of {path}: ({lower}, {upper}); lower must be below upper, swap or widen them")
    return float(lower), float(upper)


def width(lower: float, upper: float, scale: float) -> float:
    """The length by which nearness to a bound is measured."""
    return min(upper - lower, scale) if math.isfinite(upper - lower) else scale


WHOLE = 0.999  # most of a whole that its parts may take together


@dataclass(frozen=True)
class Sticks:
    """Parts of one whole, broken off it one after the other: x_i = whole f_i (1 - f_1) ... (1 - f_(i-1)).

    Each fraction f_i lies between 0 and `WHOLE`, so the parts are never negative and never exceed the whole together.

    Attributes:
        members: places of the parts in the vector, in order.
        whole: what there is to share.
    """

    members: tuple[int, ...]
    whole: float = 1.0

    def fractions(self, x: Float[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
        """The vector with parts turned into fractions; parts that exceed the whole are scaled down to fit."""
        out, parts = x.copy(), np.maximum(x[list(self.members)], 0.0)
        parts = parts * min(1.0, 0.98 * self.whole / max(float(np.sum(parts)), 1e-300))
        left = self.whole
        for i, part in zip(self.members, parts, strict=True):
            out[i] = min(part / left, WHOLE)
            left *= 1 - out[i]
        return out

    def parts(self, f: Float[np.ndarray, " p"]) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, "p p"]]:
        """The vector with fractions turned into parts, and its derivative."""
        out, slope, left = f.copy(), np.eye(len(f)), self.whole
        for k, i in enumerate(self.members):
            out[i] = f[i] * left
            slope[i, i] = left
            for j in self.members[:k]:
                slope[i, j] = -out[i] / (1 - f[j])
            left *= 1 - f[i]
        return out, slope


def chained(jacobian: Float[np.ndarray, "n p"], slope: Float[np.ndarray, "..."]) -> Float[np.ndarray, "n p"]:
    """Derivatives by x turned into derivatives by y, with the slope that `Box.bounded` gives."""
    return jacobian * slope if slope.ndim == 1 else jacobian @ slope


def unchained(jacobian: Float[np.ndarray, "n p"], slope: Float[np.ndarray, "..."]) -> Float[np.ndarray, "n p"]:
    """The way back."""
    return jacobian / slope if slope.ndim == 1 else np.linalg.solve(slope.T, jacobian.T).T


class Box:
    """The transform of a vector of parameters with given bounds and scales, some of them parts of a whole."""

    def __init__(
        self,
        lower: list[float],
        upper: list[float],
        scale: list[float],
        wide: list[bool] | None = None,
        sticks: Sequence[Sticks] = (),
    ):
        self.sticks = tuple(sticks)
        self.lower, self.upper = np.array(lower, float), np.array(upper, float)
        for group in self.sticks:  # in the box stand fractions of what is left
            self.upper[list(group.members)] = WHOLE
        self.scale = np.asarray(scale, float)
        low, high = np.isfinite(self.lower), np.isfinite(self.upper)
        self.both, self.only_lower, self.only_upper = low & high, low & ~high, high & ~low
        self.wide = ~low & ~high & np.asarray(wide if wide is not None else [False] * len(self.scale), bool)
        self.small = DECADES * self.scale
        self.span = np.where(self.both, self.upper - self.lower, self.scale)
        self.span = np.where(np.isfinite(self.span), self.span, self.scale)

    def inward(self, x: Float[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
        """`x` moved off (or back inside) its bounds."""
        step = NUDGE * np.minimum(self.span, self.scale)
        return np.clip(x, self.lower + step, self.upper - step)

    def free(self, x: Float[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
        """y of an x strictly inside."""
        x = np.asarray(x, float)
        for group in self.sticks:
            x = group.fractions(x)
        x = self.inward(x)
        y = x / self.scale
        with np.errstate(all="ignore"):
            y = np.where(self.wide, np.arcsinh(x / self.small), y)
            y = np.where(self.only_lower, _inverse_softplus((x - self.lower) / self.scale), y)
            y = np.where(self.only_upper, -_inverse_softplus((self.upper - x) / self.scale), y)
            share = (x - self.lower) / self.span
            return np.where(self.both, np.log(share) - np.log1p(-share), y)

    def bounded(self, y: Float[np.ndarray, " p"]) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, "..."]]:
        """x and dx/dy: (p,), or (p, p) where some are parts of a whole; see `chained`."""
        x, slope = self.scale * y, self.scale.copy()
        grow, fall = _sigmoid(y), _sigmoid(-y)
        with np.errstate(all="ignore"):
            far = np.clip(y, -FAR, FAR)
            x = np.where(self.wide, self.small * np.sinh(far), x)
            slope = np.where(self.wide, self.small * np.cosh(far), slope)
            x = np.where(self.only_lower, self.lower + self.scale * np.logaddexp(0, y), x)
            x = np.where(self.only_upper, self.upper - self.scale * np.logaddexp(0, -y), x)
            x = np.where(self.both, self.lower + self.span * grow, x)
            slope = np.where(self.only_lower, self.scale * grow, slope)
            slope = np.where(self.only_upper, self.scale * fall, slope)
            slope = np.where(self.both, self.span * grow * fall, slope)
        for group in self.sticks:
            x, broken = group.parts(x)
            slope = broken * slope if slope.ndim == 1 else broken @ slope
        return x, slope

    def at_bound(self, x: Float[np.ndarray, " p"]) -> list[str | None]:
        """For each parameter "lower", "upper" or None."""
        near = AT_BOUND * np.minimum(self.span, np.maximum(self.scale, np.abs(x)))
        return [
            "lower" if xi - lo < n else "upper" if hi - xi < n else None
            for xi, lo, hi, n in zip(x, self.lower, self.upper, near, strict=True)
        ]


def _sigmoid(y):
    return 0.5 * (1 + np.tanh(0.5 * y))


def _inverse_softplus(z):
    return np.where(z > 30, z, np.log(np.expm1(np.minimum(z, 30))))

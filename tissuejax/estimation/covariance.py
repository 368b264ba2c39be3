"""How well the data determine the parameters: covariance, correlation, condition, and in words what is not seen.

At the optimum the covariance is (J'J)^-1 in noise units where samples are independent; where noise is correlated it is
(J'J)^-1 J'VJ (J'J)^-1. Where the residuals contradict the recorded noise, or none was recorded, their own scatter says
what a sample is worth; then intervals follow Student's distribution with the residuals' degrees of freedom.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tissuejax.estimation.quantile import quantile

NOT_IDENTIFIED = 1.0  # a combination whose relative standard error exceeds this is called not identified
SHARE = 0.3  # a parameter takes part in a combination from this share of its largest member on


@dataclass(frozen=True)
class Directions:
    """Combinations of parameters by how well residuals see them: J size = u s vt.

    Attributes:
        u, s, vt: singular vectors and values.
        size: what each parameter is measured in; values of s are then of order one over its relative error.
    """

    u: Float[np.ndarray, "n k"]
    s: Float[np.ndarray, " k"]
    vt: Float[np.ndarray, "k p"]
    size: Float[np.ndarray, " p"]

    @classmethod
    def of(cls, jacobian: Float[np.ndarray, "n p"], size: Float[np.ndarray, " p"]) -> "Directions":
        """Of a Jacobian of residuals in units of the noise."""
        return cls(*np.linalg.svd(jacobian * size, full_matrices=False), size)

    @property
    def top(self) -> float:
        """The largest singular value; 1 where nothing is seen at all."""
        return self.s[0] if len(self.s) and self.s[0] > 0 else 1.0

    @property
    def inverse(self) -> Float[np.ndarray, " k"]:
        """1 / s, the smallest no smaller than rounding."""
        return 1 / np.maximum(self.s, 1e-13 * self.top)

    def relative(self, spread: Float[np.ndarray, "k k"] | None = None) -> Float[np.ndarray, "p p"]:
        """Covariance in units of `size`; `spread` is that of the residuals along u, unit where they are independent."""
        if spread is None:
            return (self.vt.T * self.inverse**2) @ self.vt
        return (self.vt.T * self.inverse) @ spread @ (self.inverse[:, None] * self.vt)


def standard_errors(jacobian: Float[np.ndarray, "n p"], weakest: float = 1e-8) -> Float[np.ndarray, " p"]:
    """Standard errors under independent noise of unit size; NaN where a combination is not seen.

    Args:
        weakest: smallest singular value over the largest, columns of unit length, that counts as seen.
    """
    norms = np.linalg.norm(jacobian, axis=0)
    if not np.all(norms > 0):  # a parameter that nothing depends on
        return np.full(len(norms), np.nan)
    found = Directions.of(jacobian, 1 / norms)
    if not found.s[-1] > weakest * found.s[0]:
        return np.full(len(norms), np.nan)
    return np.sqrt(np.diag(found.relative())) / norms


def inflation(chi2: float, n: int, k: int, estimated: bool = False) -> tuple[float, float]:
    """What variances of estimates are multiplied by, and the degrees of freedom behind it.

    A recorded noise level is only widened where the misfit says that it is more; an `estimated` one gives way to what
    the model leaves, in either direction. Intervals then follow Student's distribution.

    Args:
        chi2: of n whitened residuals that k parameters were fitted to.
    """
    dof = max(n - k, 1)
    scale = chi2 / dof
    if not estimated and scale <= 1.0:
        return 1.0, math.inf
    return max(scale, 1e-12), float(dof)


@dataclass(frozen=True)
class Uncertainty:
    """Second-order picture of the misfit around the optimum.

    Attributes:
        std: standard errors, in the parameters' units; infinite where nothing is seen.
        covariance: (p, p).
        correlation: (p, p).
        condition: condition number of the Jacobian with relative parameters as columns.
        sentences: what the data do not tell apart.
        inflation: variances over those that independent samples of the stated noise would give.
        dof: degrees of freedom of the noise's level; infinite where the recorded one was used.
        serial: whether they allow for correlated residuals.
        widening: the noise's standard deviation over the stated one, as the residuals have it.
    """

    std: Float[np.ndarray, " p"]
    covariance: Float[np.ndarray, "p p"]
    correlation: Float[np.ndarray, "p p"]
    condition: float
    sentences: tuple[str, ...]
    inflation: Float[np.ndarray, " p"] | None = None
    dof: float = math.inf
    serial: bool = False
    widening: float = 1.0

    def quantile(self, confidence: float = 0.95) -> float:
        """Half-width of a two-sided interval over the standard error: Student's t, 1.96 where the noise is known."""
        return quantile(confidence, self.dof)


def uncertainty(
    jacobian: Float[np.ndarray, "n p"],
    x: Float[np.ndarray, " p"],
    scale: Float[np.ndarray, " p"],
    labels: tuple[str, ...],
    units: tuple[str, ...],
    widening: float = 1.0,
    *,
    correlated: Callable[[Float[np.ndarray, "n p"]], Float[np.ndarray, "n p"]] | None = None,
    dof: float = math.inf,
) -> Uncertainty:
    """Uncertainty from the Jacobian of the residuals (in units of the noise) at the optimum.

    Args:
        jacobian: residuals to parameters.
        x: the optimum.
        scale: typical magnitudes, used where a parameter is near zero.
        labels: names for the sentences.
        units: their units; a combination of equal units is written as a sum, of different ones as a product.
        widening: factor on the standard errors: the noise's standard deviation over the stated one.
        correlated: multiplies by the covariance matrix of the residuals; none for independent ones.
        dof: degrees of freedom behind `widening`; infinite where the stated noise is used.
    """
    size = np.maximum(np.abs(x), 1e-3 * scale)
    found = Directions.of(jacobian, size)
    s, vt, top = found.s, found.vt, found.top
    floor = 1e-13 * top
    plain = found.relative()
    relative = (plain if correlated is None else found.relative(found.u.T @ correlated(found.u))) * widening**2
    covariance = relative * np.outer(size, size)
    std = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(std, std)
    lost = s <= 1e-10 * top
    if lost.any():  # the direction is flat to rounding: no number for those who take part
        flat = (np.abs(vt[lost]) > 0.01).any(axis=0)
        std = np.where(flat, np.inf, std)
    condition = float(top / s[-1]) if s[-1] > floor else float("inf")
    sentences = tuple(
        unseen(v, size, labels, units, widening / max(value, floor))
        for value, v in zip(s, vt, strict=True)
        if widening / max(value, floor) > NOT_IDENTIFIED
    )
    return Uncertainty(
        std,
        covariance,
        correlation,
        condition,
        sentences,
        np.diag(relative) / np.diag(plain),
        dof,
        correlated is not None,
        widening,
    )


def unseen(
    direction: Float[np.ndarray, " p"], size: Float[np.ndarray, " p"], labels, units, relative_std: float
) -> str:
    """A plain sentence on one direction (in relative parameters) that the data leave open."""
    who = [i for i in np.argsort(-np.abs(direction)) if abs(direction[i]) > SHARE * np.abs(direction).max()]
    how = (
        "hardly shows in the prediction" if relative_std > 10 else f"is known to within {100 * relative_std:.0f} % only"
    )
    if len(who) == 1:
        return f"{labels[who[0]]} is not identified by these recordings: it {how}."
    if len(who) == 2:
        i, j = sorted(map(int, who))
        return (
            f"Only {seen_pair(direction, size, labels, units, i, j)} is seen: a change of one against the other {how}."
        )
    moves = ", ".join(f"{labels[i]} by {100 * direction[i] / np.abs(direction).max():+.0f} %" for i in sorted(who))
    return f"One combination is not identified: a change of {moves} together {how}."


def seen_pair(direction, size, labels, units, i: int, j: int) -> str:
    """The combination of two parameters orthogonal to a flat direction: mu1 + 0.52 mu3, or c * alpha^0.9."""
    if units[i] == units[j] and units[i] != "1":
        weight = -direction[i] * size[i] / (direction[j] * size[j])
        sign, weight = ("+" if weight > 0 else "-"), abs(weight)
        factor = "" if abs(weight - 1) < 0.05 else f"{weight:.2g} "
        return f"{labels[i]} {sign} {factor}{labels[j]}"
    power = -direction[i] / direction[j]
    if abs(power - 1) < 0.05:
        return f"{labels[i]} * {labels[j]}"
    return f"{labels[i]} * {labels[j]}^{power:.2g}"


def autocorrelation(r: Float[np.ndarray, " n"]) -> float:
    """Lag-one correlation of a residual series, 0 for fewer than 8 samples."""
    if len(r) < 8:
        return 0.0
    r = r - r.mean()
    total = float(r @ r)
    return float(r[1:] @ r[:-1]) / total if total > 0 else 0.0

"""Posterior mass over the amplitudes of the discrepancy, over the evidence at its maximum: priors and Occam's factor.

Along each amplitude, the others where they are, the evidence of a smooth part is known in closed form
(`Marginal.along`) and the prior is integrated against it by quadrature. Parts within blocks have no such form: they
are taken at a few amplitudes and interpolated. Correlations of amplitudes that moved come in by their determinant.

Source: Laplace's method for posterior mass, Kass and Raftery 1995, JASA 90, sec. 4.1.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator
from scipy.special import logsumexp

from tissuejax.diagnosis.judgement.marginal import Blocked, Linear, Marginal, Widths, marginal
from tissuejax.estimation.discrepancy import Part

LEAST, TEN, POINTS = 1e-4, 10.0, 500  # of the prior's width; of its widest; amplitudes of the quadrature
KNOTS = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0)  # of its width: amplitudes at which a part at rest is taken
AROUND = (-16, -8, -4, -2, -1, -0.5, 0, 0.5, 1, 2, 4, 8, 16)  # standard errors from where it is, where it moved
FALLEN = -15.0  # nats: what lies beyond is nothing
MOVED = 1e-3  # of the squared width: an amplitude above that is not at rest


def amplitude_mass(
    linear: Linear, parts: Sequence[Part], priors: Widths, blocked: Blocked, v: Float[np.ndarray, " K"], m: Marginal
) -> float:
    """Log of int p(y | a) p(a) da over p(y | v): `m` at `v`; see the module's text."""
    total, factor = 0.0, np.broadcast_to(priors.factor, priors.width.shape)
    for k, part in enumerate(parts):
        grid = np.geomspace(LEAST, TEN * factor[k], POINTS)
        a = priors.width[k] * grid
        if part.factor is not None:
            change = m.along(k, a**2 - v[k])
        else:
            change = _within(linear, parts, priors, blocked, v, m, k)(a**2)
        density = priors.part(k).log_density((a**2)[:, None])[:, 0]
        total += float(logsumexp(change + density + np.log(a))) + math.log(math.log(grid[1] / grid[0]))
    moving = np.flatnonzero((v > MOVED * priors.width**2) & (np.diag(m.fisher) > 0))  # an empty part says nothing
    if len(moving) > 1:
        f = m.fisher[np.ix_(moving, moving)]
        scale = 1 / np.sqrt(np.diag(f))
        total -= 0.5 * float(np.linalg.slogdet(f * np.outer(scale, scale) + 1e-3 * np.eye(len(moving)))[1])
    return total


def _within(linear, parts, priors: Widths, blocked, v, m: Marginal, k: int) -> Callable[[np.ndarray], np.ndarray]:
    """The log evidence over that of `m` along the squared amplitude of a part within blocks."""
    width, here = float(priors.width[k]), math.sqrt(v[k])
    at = [width * knot for knot in KNOTS]
    if v[k] > MOVED * width**2:  # about where it is, in standard errors of its logarithm
        error = float(np.clip(0.5 / (v[k] * math.sqrt(max(m.fisher[k, k], 1e-300))), 0.02, 1.5))
        at = [here * math.exp(error * knot) for knot in AROUND]
    known = [(0.0, _change(linear, parts, blocked, v, m, k, 0.0))]
    for a in at:
        known.append((a, _change(linear, parts, blocked, v, m, k, a**2)))
        if a > here and known[-1][1] < FALLEN:
            break
    x, y = (np.array(c) for c in zip(*known, strict=True))
    unit = KNOTS[0] * width
    last, curve = float(np.arcsinh(x[-1] / unit)), PchipInterpolator(np.arcsinh(x / unit), y)
    slope = min(float(curve(last, 1)), 0.0)

    def change(q: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        w = np.arcsinh(np.sqrt(q) / unit)
        return curve(np.minimum(w, last)) + slope * np.maximum(w - last, 0.0)

    return change


def _change(linear, parts, blocked, v, m: Marginal, k: int, x: float) -> float:
    """Of the log evidence where the squared amplitude k is `x`."""
    return marginal(linear, parts, np.where(np.arange(len(v)) == k, x, v), blocked).value - m.value

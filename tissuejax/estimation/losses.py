"""Robust losses as a change of the residual, so that least squares stays least squares.

For a loss rho(r^2) the residual rt = sign(r) sqrt(rho(r^2)) has sum rt^2 = sum rho exactly, and a derivative that
scales the rows of the Jacobian. `squares` is the plain sum; `soft-l1` and `cauchy` let a few bad samples be
(Huber-like, heavier).
"""

import numpy as np
from jaxtyping import Float

from tissuejax.errors import unknown

LOSSES = ("squares", "soft-l1", "cauchy")


def checked_loss(name: str) -> str:
    """`name` if there is such a loss."""
    if name not in LOSSES:
        raise unknown("loss", name, LOSSES)
    return name


def soften(name: str, r: Float[np.ndarray, " n"]) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """The changed residual and its derivative to r.

    soft-l1: rho = 2 (sqrt(1 + r^2) - 1); cauchy: rho = ln(1 + r^2); r in units of the noise.
    """
    if name == "squares":
        return r, np.ones_like(r)
    root = np.sqrt(1 + r * r)
    if name == "soft-l1":
        size = np.sqrt(2 * r * r / (root + 1))  # = sqrt(2 (root - 1)) without cancellation
        rho_slope = 1 / root
    else:
        size = np.sqrt(np.log1p(r * r))
        rho_slope = 1 / (1 + r * r)
    small = np.abs(r) < 1e-8
    slope = np.where(small, 1.0, rho_slope * np.abs(r) / np.where(small, 1.0, size))
    return np.sign(r) * size, slope

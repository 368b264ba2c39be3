"""Rigid registration of two point sets (Arun), with the residual of every reference marker."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError


class Rigid(NamedTuple):
    """x -> rotation x + translation, and how far each reference marker stays off, m."""

    rotation: Float[np.ndarray, "3 3"]
    translation: Float[np.ndarray, " 3"]
    residuals: Float[np.ndarray, " k"]

    def __call__(self, points: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "... 3"]:
        return points @ self.rotation.T + self.translation


def register(moving: Float[np.ndarray, "k 3"], target: Float[np.ndarray, "k 3"]) -> Rigid:
    """The rotation and translation that bring `moving` onto `target` in least squares.

    With H = sum q q'^T = U S V^T over centred points, R = V diag(1, 1, det(V U^T)) U^T. Source: Arun, Huang, Blostein
    1987; Lister 2012, 2.2.4 prints X = U V^t and, for determinant -1, V' U^t (corrected here).
    Markers that are NaN in either set take no part; their residual is NaN.

    Raises:
        InputError: sets of different size, fewer than three markers seen in both, or markers in one line.
    """
    moving, target = np.asarray(moving, float), np.asarray(target, float)
    if moving.shape != target.shape or moving.ndim != 2 or moving.shape[1] != 3:
        raise InputError(
            f"registration of {moving.shape} onto {target.shape}: expected two (k, 3) sets of the same markers"
        )
    seen = np.isfinite(moving).all(1) & np.isfinite(target).all(1)
    if seen.sum() < 3:
        raise InputError(f"registration needs three markers seen in both sets; {seen.sum()} are")
    a, b = moving[seen], target[seen]
    centre_a, centre_b = a.mean(0), b.mean(0)
    spread = np.linalg.svd(a - centre_a, compute_uv=False)
    if spread[1] < 1e-6 * max(spread[0], 1e-300):
        raise InputError("the reference markers lie in one line, so the rotation about it is unknown; use others")
    U, _, Vt = np.linalg.svd((a - centre_a).T @ (b - centre_b))
    R = Vt.T @ np.diag([1, 1, np.sign(np.linalg.det(Vt.T @ U.T))]) @ U.T
    t = centre_b - R @ centre_a
    return Rigid(R, t, np.linalg.norm(moving @ R.T + t - target, axis=1))

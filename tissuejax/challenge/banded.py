"""Banded tangents of a probed body: assembly, a Cholesky factor that is kept, and systems that lie near it.

Between two iterations the contact changes in a few points, the body little. A tangent once factored as M therefore
serves many steps: with the change P of the contact, (M + P) x = r is solved by conjugate gradients preconditioned by
M (Hestenes and Stiefel 1952), a back-substitution each, where a new factor costs some twenty-five.
"""

import numpy as np
from jaxtyping import Float
from scipy.linalg import blas, lapack

from tissuejax.errors import NotConverged

ROUNDS = 16  # back-substitutions after which a new factor is cheaper
NEAR = 0.05  # of the residual that a solution may leave: an iteration with a kept tangent leaves more than that


class Band:
    """Lower band of a symmetric matrix assembled from blocks."""

    def __init__(self, nodes_of: dict[str, np.ndarray], n_nodes: int):
        dofs = {k: (3 * v[:, :, None] + np.arange(3)).reshape(len(v), -1) for k, v in nodes_of.items()}
        self.n = 3 * n_nodes
        self.width = max(int((d.max(1) - d.min(1)).max()) for d in dofs.values() if len(d))
        self.keep, self.at = {}, {}
        for k, d in dofs.items():
            row, col = np.broadcast_arrays(d[:, :, None], d[:, None, :])
            self.keep[k] = (row >= col).ravel()
            self.at[k] = (col * (self.width + 1) + row - col).ravel()[self.keep[k]]
        self.dofs = dofs

    def matrix(self, name: str, K: np.ndarray, diagonal: np.ndarray) -> np.ndarray:
        """Blocks of one kind and a diagonal as a flat band, column after column, in single precision."""
        size = self.n * (self.width + 1)
        flat = np.bincount(self.at[name], K.ravel()[self.keep[name]], size).astype(np.float32)
        flat[:: self.width + 1] += diagonal.astype(np.float32)
        return flat

    def added(self, flat: np.ndarray, blocks: dict[str, np.ndarray]) -> np.ndarray:
        """(width + 1, n) lower band in Fortran order: a flat one and (few) further blocks."""
        flat = flat.copy()
        for k, K in blocks.items():
            np.add.at(flat, self.at[k], K.ravel()[self.keep[k]].astype(np.float32))
        return flat.reshape(self.n, self.width + 1).T

    def vector(self, blocks: dict[str, np.ndarray]) -> np.ndarray:
        """Sum of block forces, (n,)."""
        total = np.zeros(self.n)
        for k, f in blocks.items():
            total += np.bincount(self.dofs[k].ravel(), f.ravel(), self.n)
        return total


class Kept:
    """A factored tangent: that of the body as a flat band, and of the contact as it was then.

    Raises:
        NotConverged: the tangent stays indefinite.
    """

    def __init__(self, band: Band, flat: np.ndarray, contact: np.ndarray):
        self.band, self.flat, self.contact = band, flat, contact
        whole, shift = band.added(flat, {"sphere": contact}), 0.0
        for _ in range(8):
            trial = whole.copy(order="F")
            trial[0] += np.float32(shift)
            self.factor, info = lapack.spbtrf(trial, lower=1, overwrite_ab=1)
            if info == 0:
                return
            shift = max(10 * shift, 0.05)
        raise NotConverged("probed body: the tangent stays indefinite")

    def back(self, r: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Solution of the system that was factored."""
        return lapack.spbtrs(self.factor, r.astype(np.float32), lower=1)[0].astype(float)

    def times(self, x: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """The body's part of the tangent times `x`."""
        whole = self.flat.reshape(self.band.n, -1).T
        return blas.ssbmv(self.band.width, 1.0, whole, x.astype(np.float32), lower=1).astype(float)

    def solve(self, r: Float[np.ndarray, " n"], contact: Float[np.ndarray, "f 12 12"]) -> np.ndarray | None:
        """Solution with another contact, None where that is too far from the one that was factored."""
        change = contact - self.contact
        some = np.flatnonzero(np.abs(change).max((1, 2)))
        change, dofs = change[some], self.band.dofs["sphere"][some]
        x, left = np.zeros_like(r), r.copy()
        p = z = self.back(left)
        if not len(some):
            return z
        goal = NEAR * np.abs(r).max()
        Mp, before = left.copy(), left @ z
        for _ in range(ROUNDS):
            Ap = Mp + np.bincount(dofs.ravel(), np.einsum("fpq,fq->fp", change, p[dofs]).ravel(), len(r))
            bend = p @ Ap
            if bend <= 0:
                return None
            x += before / bend * p
            left -= before / bend * Ap
            if np.abs(left).max() < goal:
                return x
            z = self.back(left)
            after = left @ z
            p, Mp = z + after / before * p, left + after / before * Mp
            before = after
        return None

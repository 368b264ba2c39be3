"""Banded tangents of a probed body: assembly, and a Cholesky factor that is kept, with its compliance under the probe.

Between two iterations the contact changes much, the body little. With the body's tangent factored once, what the
surface under the probe gives way is a small dense matrix, on which contact is solved for to the end (a Schur
complement: Haynsworth 1968); the body's own forces are then looked at once, and not in every iteration of the contact.
"""

import numpy as np
from jaxtyping import Float
from numpy.lib.stride_tricks import as_strided
from scipy.linalg import blas, lapack

from tissuejax.errors import NotConverged

BLOCK = 128  # columns of a factor that are eliminated at once


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

    def vector(self, blocks: dict[str, np.ndarray]) -> np.ndarray:
        """Sum of block forces, (n,)."""
        total = np.zeros(self.n)
        for k, f in blocks.items():
            total += np.bincount(self.dofs[k].ravel(), f.ravel(), self.n)
        return total


class Kept:
    """A factored tangent of the body without contact, and its compliance at the nodes that may be touched.

    Attributes:
        dofs: those of the nodes that may be touched.
        compliance: what they give way for a force on each of them, m/N.

    Raises:
        NotConverged: the tangent stays indefinite.
    """

    def __init__(self, band: Band, flat: np.ndarray):
        self.width, shift = band.width, 0.0
        self.dofs, self.compliance = np.zeros(0, int), np.zeros((0, 0))
        for _ in range(8):
            trial = flat.reshape(band.n, band.width + 1).T.copy(order="F")
            trial[0] += np.float32(shift)
            self.factor, info = lapack.spbtrf(trial, lower=1, overwrite_ab=1)
            if info == 0:
                return
            shift = max(10 * shift, 0.05)
        raise NotConverged("probed body: the tangent stays indefinite")

    def back(self, r: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """What the body gives way under forces `r`."""
        return lapack.spbtrs(self.factor, r.astype(np.float32), lower=1)[0].astype(float)

    def reach(self, dofs: np.ndarray) -> None:
        """Take these for the dofs that may be touched: compliance Y' Y with L Y = (unit forces), in blocks of rows.

        Row i of column j of the factor L lies at i + j width of its memory: a block of it is a strided view.
        """
        n, w = self.factor.shape[1], self.width
        memory = self.factor.T.reshape(-1)
        Y = np.zeros((n, len(dofs)), np.float32)
        Y[dofs, np.arange(len(dofs))] = 1
        first = int(dofs.min()) // BLOCK * BLOCK
        for j in range(first, n, BLOCK):
            k, end = min(j + BLOCK, n), min(j + BLOCK + w, n)
            whole = as_strided(memory[j + j * w :], (end - j, k - j), (4, 4 * w))
            inside = np.arange(j, end)[:, None] - np.arange(j, k) <= w  # beyond the band lies other columns' memory
            block = np.where(inside, whole, np.float32(0))
            Y[j:k] = blas.strsm(1.0, block[: k - j], Y[j:k], lower=1)
            Y[k:end] -= block[k - j :] @ Y[j:k]
        Y = Y[first:]
        self.dofs, self.compliance = dofs, (Y.T @ Y).astype(float)

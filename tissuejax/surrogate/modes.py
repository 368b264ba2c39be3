"""Few modes that stand for many states: proper orthogonal decomposition by the method of snapshots (Sirovich 1987)."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

BLOCK = 4096  # columns that are worked on in double precision at a time, so that no second copy of all is needed


class Modes(NamedTuple):
    """`shapes` (M, n), orthonormal in the metric `weight`; `lost`: share of the norm of the states that is left out."""

    shapes: Float[np.ndarray, "M n"]
    lost: float


def modes(
    states: Float[np.ndarray, "k n"], tolerance: float, most: int, weight: Float[np.ndarray, " n"] | None = None
) -> Modes:
    """The modes of `states` that leave at most `tolerance` of their root mean square, at most `most` of them."""
    w = np.ones(states.shape[1]) if weight is None else weight
    blocks = [slice(i, i + BLOCK) for i in range(0, states.shape[1], BLOCK)]
    gram = np.zeros((len(states), len(states)))
    for b in blocks:
        some = np.asarray(states[:, b], float)
        gram += (some * w[b]) @ some.T
    square, vectors = np.linalg.eigh(gram)
    order = np.argsort(square)[::-1]
    square, vectors = np.maximum(square[order], 0), vectors[:, order]
    total = max(square.sum(), 1e-300)
    rest = np.sqrt(np.maximum(1 - np.cumsum(square) / total, 0))
    count = min(most, int((rest > tolerance).sum()) + 1, int((square > 1e-12 * square[0]).sum()) or 1)
    scale = np.sqrt(np.maximum(square[:count], 1e-300))
    mixing = vectors[:, :count].T / scale[:, None]
    return Modes(np.concatenate([mixing @ states[:, b] for b in blocks], axis=1), float(rest[count - 1]))

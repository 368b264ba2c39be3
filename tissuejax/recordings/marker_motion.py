"""How far a cloud of markers has gone: every marker along its own way, the direction in which it is farthest out.

Unlike a mean of distances this is zero, but for noise, while nothing moves.
"""

import numpy as np
from jaxtyping import Float

FIRST = 5  # frames whose median is where a marker was first seen


def rest(places: Float[np.ndarray, "n m 3"]) -> Float[np.ndarray, "m 3"]:
    """Where each marker was first seen: the median of its first five frames; NaN for one that never was."""
    seen = np.full(places.shape[1:], np.nan)
    for j in range(places.shape[1]):
        known = places[np.isfinite(places[:, j]).all(1), j]
        if len(known):
            seen[j] = np.median(known[:FIRST], axis=0)
    return seen


def ways(places: Float[np.ndarray, "n m 3"]) -> Float[np.ndarray, "m 3"]:
    """Unit vector of each marker's way: out from its rest, around the frame in which all are farthest out."""
    out = places - rest(places)
    far = int(np.argmax(np.nansum(np.linalg.norm(out, axis=-1), axis=1)))
    way = np.nanmean(out[max(0, far - 2) : far + 3], axis=0)
    return way / np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-300)


def along(places: Float[np.ndarray, "n m 3"], way: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "n m"]:
    """How far each marker has gone from its rest along `way`; NaN where it was lost."""
    return np.einsum("nmi,mi->nm", places - rest(places), way)

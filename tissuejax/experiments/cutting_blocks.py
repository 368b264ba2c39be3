"""Means of a force record over blocks of the blade's way, the same for what was recorded and what is predicted.

A simulated force ripples at the period of the elements along the path, a recorded one does not. Means over one element
of the way hold neither that ripple nor its harmonics, and keep what lasts longer: the work done on the way over its
length. White noise stays white, and sinks by the root of the samples in a block.
"""

from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Float, Int

from tissuejax.experiments.cutting_record import Path

FULL = 0.5  # a block with fewer samples than this share of the usual is left out


class Blocks(NamedTuple):
    """Of one record of n samples: their times (s), the block of each (`count` where it is in none), how many."""

    time: Float[np.ndarray, " n"]
    block: Int[np.ndarray, " n"]
    count: int
    samples: int

    def mean(self, values: Float[Array, " n"]) -> Float[Array, " count"]:
        """Mean of each block."""
        held = np.bincount(self.block, minlength=self.count + 1)[: self.count]
        return jax.ops.segment_sum(values, self.block, self.count + 1)[: self.count] / held


def blocks(path: Path, time: Float[np.ndarray, " n"], length: float) -> Blocks:
    """Blocks of `length` (m) of the way that the blade has gone, there and back counted alike.

    A rest is cut into blocks of as many samples as those of the moving blade have.
    """
    time = np.asarray(time, float)
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(path.x)))])
    at = np.floor(np.interp(time, path.time, way) / length + 1e-9).astype(int)
    _, sizes = np.unique(at, return_counts=True)
    usual = max(1, int(np.median(sizes)))
    block, last, held = np.empty(len(time), int), -1, 0
    for i, here in enumerate(at):
        new = i == 0 or here != at[i - 1] or held >= usual + 1
        last, held = (last + 1, 1) if new else (last, held + 1)
        block[i] = last
    sizes = np.bincount(block)
    kept = sizes >= max(1, FULL * usual)
    number = np.where(kept, np.cumsum(kept) - 1, kept.sum())
    return Blocks(time, number[block], int(kept.sum()), usual)

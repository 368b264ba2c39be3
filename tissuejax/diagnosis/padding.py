"""Series of few lengths: a compiled program serves recordings of one length alone."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tissuejax.effects.material_test import MaterialTest

SHORTEST = 128  # samples that a series is lengthened to


def lengthened(test: MaterialTest, n: int) -> MaterialTest:
    """`test` with its last sample repeated up to `n` samples."""

    def longer(series: np.ndarray) -> np.ndarray:
        return np.concatenate([series, np.repeat(series[-1:], n - len(series), axis=0)])

    return replace(test, time=longer(test.time), drive=longer(test.drive))


def lengths(samples: Sequence[int]) -> list[int]:
    """To how many samples recordings of a sample are lengthened: few lengths, few compilations.

    The longest to the next of 128, 192, 256, 384, 512, ..., the others to that or a half, a quarter, ... of it: a
    program for another length takes as long to compile as it takes to run thousands of times, and a search runs it
    some thousand times.
    """
    power = max(SHORTEST, 2 ** math.ceil(math.log2(max(samples))))
    top = 3 * power // 4 if power > SHORTEST and max(samples) <= 3 * power // 4 else power
    steps = [top >> k for k in range(top.bit_length()) if k == 0 or (top >> k) >= SHORTEST]
    return [min(step for step in steps if step >= n) for n in samples]

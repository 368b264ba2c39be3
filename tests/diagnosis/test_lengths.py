"""To how many samples the series of a diagnosis are lengthened: few lengths, none too long."""

import itertools

import numpy as np
import pytest

from tissuejax.diagnosis.padding import SHORTEST, lengths


@pytest.mark.parametrize("longest", [1, 100, 128, 129, 192, 193, 256, 700, 769, 5000])
def test_the_longest_by_less_than_a_half_and_the_others_by_less_than_twice(longest):
    counts = sorted({max(1, int(longest * share)) for share in np.geomspace(0.001, 1.0, 60)})
    found = lengths(counts)
    assert all(n <= k for n, k in zip(counts, found, strict=True))
    assert found[-1] < 1.5 * max(longest, SHORTEST) or found[-1] == SHORTEST
    assert all(k < 2 * n or k < 2 * SHORTEST for n, k in zip(counts, found, strict=True))
    assert all(b == 2 * a for a, b in itertools.pairwise(sorted(set(found))))


def test_a_length_is_of_the_sample_and_not_of_the_order_of_its_recordings():
    assert lengths([145, 616, 334]) == [lengths([616, 334, 145])[k] for k in (2, 0, 1)]

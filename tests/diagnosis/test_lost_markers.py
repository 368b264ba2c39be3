"""Lost markers: a sample that is not there must not stand at the origin when a clock is shifted."""

import numpy as np

from tissuejax.diagnosis.probing_series import filled


def test_a_lost_sample_lies_between_its_neighbours():
    path = np.stack([np.linspace(0.01, 0.02, 6), np.full(6, 0.03)], 1)[:, None, :]  # (6, 1 marker, 2 axes)
    seen = path.copy()
    seen[[0, 3, 5]] = np.nan
    told = filled(seen)
    np.testing.assert_allclose(told[1:5], path[1:5], atol=1e-15)
    np.testing.assert_allclose(told[0], path[1])
    np.testing.assert_allclose(told[5], path[4])
    np.testing.assert_array_equal(filled(np.full((4, 1, 3), np.nan)), 0.0)
    assert np.isnan(seen[0]).all(), "the recording itself is left as it is"

"""The last steps of a probing's fit, on a line whose answer is known."""

import numpy as np
import pytest

from tissuejax.fitting.closing import reach


def test_reach_is_the_step_in_standard_errors(rng):
    x = np.linspace(-1, 1, 400)
    J = np.stack([np.ones_like(x), x], 1)
    r = J @ [0.3, 0.0] + rng.normal(0, 0.1, x.size)
    std = np.sqrt(np.linalg.inv(J.T @ J)[0, 0] * (r @ r) / (x.size - 2))
    assert reach(J, J @ [0.3, 0.0], r) == pytest.approx(0.3 / std)  # orthogonal columns: the other has no share
    assert reach(J, r - J @ np.linalg.lstsq(J, r)[0], r) == pytest.approx(0.0, abs=1e-9)

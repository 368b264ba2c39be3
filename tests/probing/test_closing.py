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


def test_what_one_sample_leaves_over_speaks_for_the_noise():
    """Two samples and one parameter: all of the misfit's square is one degree of freedom. With none to spare, one
    is taken, not none."""
    assert reach(np.array([[2.0], [0.0]]), np.array([3.0, 4.0])) == pytest.approx(3 / 5)
    assert reach(np.array([[2.0]]), np.array([3.0]), np.array([6.0])) == pytest.approx(3 / 6)

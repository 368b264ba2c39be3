"""The layer law: Hertz for a thick layer, the published correction for a thin one, smooth at first touch."""

import jax
import numpy as np
import pytest

from tissuejax.experiments.layer_indentation import force


def test_thick_layer_is_hertz():
    d = np.array([-1e-3, 0.0, 5e-4, 1e-3])
    E, R = 3e3, 4e-3
    hertz = 4 / 3 * E / (1 - 0.25) * np.sqrt(R) * np.clip(d, 0, None) ** 1.5
    assert np.allclose(force(d, R, E, np.inf), hertz)


def test_thin_layer_is_stiffer_as_published():
    # x = sqrt(R d) / h = 0.5: 1 + 0.5665 + 0.32075 + 0.096125 + 0.00609375
    assert force(1e-3, 4e-3, 3e3, 4e-3) / force(1e-3, 4e-3, 3e3, np.inf) == pytest.approx(1.98946875)


def test_stiffening_and_derivative_at_touch():
    assert force(1e-3, 4e-3, 3e3, np.inf, 5.0) / force(1e-3, 4e-3, 3e3, np.inf) == pytest.approx(np.exp(0.5))
    assert np.isfinite(jax.grad(lambda d: force(d, 4e-3, 3e3, 0.02))(0.0))

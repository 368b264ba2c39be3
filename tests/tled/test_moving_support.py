"""Tissue on a moving support has moved along before the clock begins, and damping does not hold it back."""

import jax.numpy as jnp
import numpy as np

from tests.tled import cases
from tissuejax.mesh.columns import box
from tissuejax.tled.simulate import run


def test_on_a_support_in_steady_motion_the_tissue_keeps_its_shape():
    """Displaced and moving steadily from before the start: a rigid translation, to rounding, however damped."""
    g = box((0.02, 0.02, 0.01), (2, 2, 2))
    times = (np.arange(9) + 0.5) * 0.01
    scene = cases.plain(g, times, mass_damping=200.0, compression=5.0)
    path_time = jnp.array([-1.0, 2.0])
    speed, place = jnp.array([2e-3, 0.0, -1e-3]), jnp.array([1e-3, 0.0, 8e-4])
    path = place + speed * path_time[:, None]
    out = run(scene.put({"support.time": path_time, "support.displacement": path}))
    end = float(out.end_time[-1])
    moved = np.asarray(out.state.u).T
    assert np.abs(moved - np.asarray(place + speed * end)).max() < 1e-12
    assert np.abs(np.asarray(out.reaction)).max() < 1e-9 * 1000.0 * 4e-6 * 9.81

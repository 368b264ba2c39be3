"""A body that slides on a soft bedding in a run faster than life: the damped oscillator of one mass on one spring."""

import jax.numpy as jnp
import numpy as np
import pytest

from tests.tled import cases
from tissuejax.mesh.columns import box
from tissuejax.tled.scene import Markers
from tissuejax.tled.simulate import run

PULL, COMPLIANCE, DAMPING = 0.05, 2e-3, 30.0  # m/s^2, m/Pa, 1/s
SIZE, DENSITY = (0.02, 0.02, 0.01), 1000.0


def oscillator(t: np.ndarray, quicker: float) -> np.ndarray:
    """x'' = s (g - w^2 x) - a x' from rest, with w^2 = area / (c M)."""
    square = quicker / (COMPLIANCE * DENSITY * SIZE[2])
    half = DAMPING / 2
    turn = np.sqrt(complex(square - half**2))
    falling = np.exp(-half * t) * (np.cos(turn * t) + half / turn * np.sin(turn * t))
    return quicker * PULL / square * (1 - falling.real)


@pytest.mark.parametrize("compression", [1.0, 3.0, 10.0])
def test_the_body_slides_as_one_mass_on_one_spring_and_never_lighter_than_in_life(compression):
    """s = (2 a)^2 c M / A = 72 is cut to f^2: at the speed of life the inertia is the body's own."""
    quicker = min(max((2 * DAMPING) ** 2 * COMPLIANCE * DENSITY * SIZE[2], 1.0), compression**2)
    ends = np.arange(1, 61) * 5e-3  # of the frames, on the simulated clock
    scene = cases.plain(
        box(SIZE, (2, 2, 2)),
        (ends - 2.5e-3) * compression,
        gravity=(PULL, 0, 0),
        mass_damping=DAMPING,
        compression=compression,
    )
    body = scene.body.points
    everywhere = Markers(jnp.arange(len(body))[:, None], jnp.ones((len(body), 1)), body)
    out = run(scene.put({"support.compliance": jnp.asarray(COMPLIANCE), "markers": everywhere}))
    moved = np.asarray(out.markers - body)[:, :, 0].mean(1)
    expected = oscillator(ends, quicker)
    assert moved == pytest.approx(expected, abs=0.01 * PULL * COMPLIANCE * DENSITY * SIZE[2])
    sideways = np.asarray(out.markers - body)[:, :, 1].mean(1)
    assert np.abs(sideways).max() < 1e-9

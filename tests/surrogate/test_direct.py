"""The full model in the loop: what it tends to, what it forgets, and when it is refused."""

import jax.numpy as jnp
import numpy as np
import pytest

from tests.surrogate import made
from tissuejax.errors import InputError, UnstableSimulation
from tissuejax.surrogate.live.direct import Direct, Pace, direct_scene, keeps_up, largest, shortened
from tissuejax.surrogate.ramp import ramp
from tissuejax.surrogate.site_mesh import Grid
from tissuejax.tled.stable import critical_steps, fastest


@pytest.mark.slow
def test_a_held_press_tends_to_static_equilibrium_and_rest_forgets():
    direct = Direct(direct_scene(made.matter(), made.SMALL, np.zeros(2)), 1.5e-3)
    begin, touch = direct.at, 0.018
    first = direct.displacement
    path = np.concatenate([np.linspace(begin[2], touch - 1.5e-3, 200), np.full(300, touch - 1.5e-3)])
    force = np.array([direct.move(np.array([0, 0, z])) for z in path])
    static = ramp(made.matter(), made.SMALL, np.zeros(2), touch, np.array([1.5e-3]))  # float64, by another solver
    assert force[-50:, 2].mean() == pytest.approx(static.force[0, 2], rel=0.01)
    assert abs(force[-50:, :2]).max() < 0.01 * static.force[0, 2]
    assert abs(direct.displacement - static.displacement[0]).max() < 3e-5
    with pytest.raises(UnstableSimulation, match="set back to rest"):
        direct.move(np.array([0, 0, np.nan]))
    assert np.array_equal(direct.displacement, first)
    again = np.array([direct.move(np.array([0, 0, z])) for z in path[:250]])
    assert np.array_equal(again, force[:250])


def test_the_step_is_as_short_as_the_pressed_tissue_needs():
    """Linear vibrations whose greatest frequency is known; and a step that is too long is shortened."""
    mass = jnp.array([1.0, 2.0, 4.0])
    stiffness = jnp.array([[4.0, -1.0, 0.0], [-1.0, 8.0, -2.0], [0.0, -2.0, 90.0]])
    held = jnp.zeros((3, 3), bool).at[:, 2].set(True)
    found = fastest(lambda u: u @ stiffness, mass, held, jnp.zeros((3, 3)))
    root = np.sqrt(mass[:2])
    known = np.linalg.eigvalsh(np.asarray(stiffness[:2, :2]) / np.outer(root, root)).max()
    assert float(found) == pytest.approx(known**0.5, rel=1e-3)
    scene = direct_scene(made.matter(**{"volumetric.K": 60e3}), made.SMALL, np.zeros(2))
    long = shortened(scene, 2)
    assert float(long.clock.step) > float(critical_steps(scene).min())
    direct = Direct(long, 1.5e-3)
    assert direct.step < float(critical_steps(scene).min())
    assert float(direct.scene.probe.mass.max()) == pytest.approx(float(long.probe.mass.max()) * (2 / direct.steps) ** 2)


def test_slow_motion_is_refused_with_a_mesh_that_would_do():
    slow = Pace(0.8, 1.2, 2.0, 576, 0.25)
    with pytest.raises(InputError, match=r"0.80 times life.*--mesh 10x10x3"):
        keeps_up(slow, Grid((12, 12, 4), 4e-3))
    assert largest(slow, Grid((12, 12, 4), 4e-3)).counts == (10, 10, 3)
    assert keeps_up(slow._replace(times_life=1.3), Grid((12, 12, 4), 4e-3)).times_life == 1.3

"""The full model in the loop: what it tends to, what it forgets, and when it is refused."""

import numpy as np
import pytest

from tests.surrogate import made
from tissuejax.errors import InputError, UnstableSimulation
from tissuejax.surrogate.live.direct import Direct, Pace, keeps_up, largest
from tissuejax.surrogate.ramp import ramp
from tissuejax.surrogate.site_mesh import Grid


def test_a_held_press_tends_to_static_equilibrium_and_rest_forgets():
    direct = Direct(made.matter(), made.SMALL, np.zeros(2))
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


def test_slow_motion_is_refused_with_a_mesh_that_would_do():
    slow = Pace(0.8, 1.2, 2.0, 576, 0.25)
    with pytest.raises(InputError, match=r"0.80 times life.*--mesh 10x10x3"):
        keeps_up(slow, Grid((12, 12, 4), 4e-3))
    assert largest(slow, Grid((12, 12, 4), 4e-3)).counts == (10, 10, 3)
    assert keeps_up(slow._replace(times_life=1.3), Grid((12, 12, 4), 4e-3)).times_life == 1.3

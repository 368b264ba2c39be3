"""A blade through a slab: steady force, fracture energy and the energy balance against closed forms."""

import numpy as np
import pytest

from tests.cutting.oracles import steady_force
from tests.cutting.slabs import BULK, MU, cut
from tissuejax.tled.simulate import run


@pytest.fixture(scope="module")
def half_millimetre():
    scene = cut(h=5e-4)
    return scene, run(scene)


def test_steady_force_is_toughness_plus_wedging(half_millimetre):
    scene, out = half_millimetre
    expected, _ = steady_force(2.0, 2e-3, 5e-3, MU, BULK, float(scene.probe.penalty))
    force = -np.asarray(out.force[:, 0]) / 5e-4
    assert force[-16:].mean() == pytest.approx(expected, rel=0.01)


def test_work_is_accounted_for_in_every_frame(half_millimetre):
    """All terms at one time: what is left over is of the second order in the step. Counted half a step apart (works up
    to the last speed, energies at the last place) it is half a step's work, 0.5 % where the work has just begun."""
    _, out = half_millimetre
    late = np.asarray(out.balance.work) > 0.05 * float(out.balance.work[-1])
    assert np.abs(np.asarray(out.balance.error))[late].max() < 0.0005


def test_energy_lost_per_area_is_the_toughness(half_millimetre):
    _, out = half_millimetre
    travel, lost = 0.014 * np.arange(1, 41) / 40, np.asarray(out.balance.lost) / 5e-4
    assert np.polyfit(travel[20:], lost[20:], 1)[0] == pytest.approx(2.0, rel=0.02)
    front, area = np.asarray(out.balance.front), np.asarray(out.balance.area) / 5e-4
    assert front[-1] == pytest.approx(area[-1], abs=2.6e-4)
    assert (np.diff(front[np.isfinite(front)]) >= 0).all()


def test_friction_adds_what_it_loses():
    nearly = {"h": 1e-3, "bulk": 2e4, "strength": 2000.0}
    plain, rubbing = run(cut(friction=0.0, **nearly)), run(cut(friction=0.1, **nearly))
    more = float(rubbing.balance.work[-1] - plain.balance.work[-1])
    assert more > 0.05 * float(plain.balance.work[-1])
    assert float(rubbing.balance.friction[-1]) == pytest.approx(more, rel=0.15)
    for out in (plain, rubbing):
        assert np.abs(np.asarray(out.balance.error))[20:].max() < 0.005

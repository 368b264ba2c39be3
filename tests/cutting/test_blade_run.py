"""A blade through a slab: steady force, fracture energy and the energy balance against closed forms."""

import jax.numpy as jnp
import numpy as np
import pytest

from tests.cutting.oracles import steady_force
from tests.cutting.slabs import BULK, MU, cut
from tissuejax.errors import InputError
from tissuejax.mesh.slab import plane_slice
from tissuejax.tled import seam
from tissuejax.tled.blade import Wedge
from tissuejax.tled.simulate import run


@pytest.fixture(scope="module")
def half_millimetre():
    scene = cut(h=5e-4)
    return scene, run(scene)


def test_steady_force_is_toughness_plus_wedging():
    """Three decay lengths, W sqrt(M / mu) = 9 mm, from where the blade goes in and from the far end."""
    scene = cut(h=1e-3, length=0.07, travel=0.044, frames=120, strength=3000.0)
    expected, _ = steady_force(2.0, 2e-3, 5e-3, MU, BULK, float(scene.probe.penalty))
    force = -np.asarray(run(scene).force[:, 0]) / 1e-3
    assert force[80:].mean() == pytest.approx(expected, rel=0.01)


def test_work_is_accounted_for_in_every_frame(half_millimetre):
    """All terms at one time: what is left over is of the second order in the step. Counted half a step apart (works up
    to the last speed, energies at the last place) it is half a step's work, 0.5 % where the work has just begun."""
    _, out = half_millimetre
    late = np.asarray(out.balance.work) > 0.05 * float(out.balance.work[-1])
    assert np.abs(np.asarray(out.balance.error))[late].max() < 0.0005


def test_the_mesh_does_not_shake_the_tissue(half_millimetre):
    """Flat facets that come over a sharp shoulder do, once an element; what damping takes then is none of the cut's."""
    _, out = half_millimetre
    assert float(out.balance.damping[-1]) < 0.01 * float(out.balance.work[-1])


def test_energy_lost_per_area_is_the_toughness(half_millimetre):
    _, out = half_millimetre
    travel, lost = 0.014 * np.arange(1, 41) / 40, np.asarray(out.balance.lost) / 5e-4
    assert np.polyfit(travel[20:], lost[20:], 1)[0] == pytest.approx(2.0, rel=0.02)
    front, area = np.asarray(out.balance.front), np.asarray(out.balance.area) / 5e-4
    assert front[-1] == pytest.approx(area[-1], abs=2.6e-4)
    assert (np.diff(front[np.isfinite(front)]) >= 0).all()


@pytest.mark.slow
def test_work_is_accounted_for_where_the_tissue_is_carried_onto_a_blade_at_rest():
    """Damping is relative to the support's pace: a body that is only carried along loses nothing, and the blade, at
    rest, does no work. With what damping takes from the whole speed a quarter of the work was laid to it."""
    scene = cut(h=1e-3, frames=40)
    time = np.linspace(0, float(scene.probe.time[-1]), 401)
    share = time / time[-1]
    way = np.zeros((401, 3))
    way[:, 0] = -0.014 * share**2 * (3 - 2 * share)
    tip = np.repeat(np.asarray(scene.probe.position)[:1], len(scene.probe.time), axis=0)
    moved = {"support.time": time, "support.displacement": way, "probe.position": tip}
    out = run(scene.put({path: jnp.asarray(x) for path, x in moved.items()}))
    assert np.abs(np.asarray(out.balance.work)).max() == 0
    assert np.abs(np.asarray(out.balance.error))[20:].max() < 0.0005


def test_friction_adds_what_it_loses():
    nearly = {"h": 1e-3, "bulk": 2e4, "strength": 2000.0}
    plain, rubbing = run(cut(friction=0.0, **nearly)), run(cut(friction=0.1, **nearly))
    more = float(rubbing.balance.work[-1] - plain.balance.work[-1])
    assert more > 0.05 * float(plain.balance.work[-1])
    assert float(rubbing.balance.friction[-1]) == pytest.approx(more, rel=0.15)
    for out in (plain, rubbing):
        assert np.abs(np.asarray(out.balance.error))[20:].max() < 0.005


def test_lips_are_the_surface_beside_the_cut_on_either_side():
    made = plane_slice(0.006, 0.005, 1e-3)
    nodes, side = seam.lips(made, 1.6e-3)
    middle = np.asarray(made.geometry.points)[nodes].mean(1)
    assert sorted(zip(middle[:, 0].round(6), middle[:, 1].round(6), strict=True)) == [
        (x, y) for x in (0.0, 0.006) for y in (-0.0015, -0.0005, 0.0005, 0.0015)
    ]
    np.testing.assert_array_equal(side, np.sign(middle[:, 1]))


def test_a_shoulder_is_as_round_as_its_facets_need_and_its_bevel_allows():
    slope = float(np.tan(np.radians(15)))
    assert seam.shoulder(2e-3, slope, 1e-3) == pytest.approx(4e-3)
    assert seam.shoulder(2e-3, slope, 1e-5) == pytest.approx(4e-4)
    # the arc meets the bevel R tan(7.5 degrees) before the corner, and the bevel is half b / sin(15 degrees) long
    most = 1e-3 / np.sin(np.radians(15)) / np.tan(np.radians(7.5))
    assert seam.shoulder(2e-3, slope, 1.0) == pytest.approx(most)
    round_one = Wedge(2e-3, slope, 0.999 * most)
    gap, normal = round_one.distance((np.array([-1e-9]), np.array([1e-3]), np.array([0.0])))
    assert gap[0] > 0
    seam.refuse_blade(round_one)
    with pytest.raises(InputError, match="no room"):
        seam.refuse_blade(Wedge(2e-3, slope, 1.01 * most))

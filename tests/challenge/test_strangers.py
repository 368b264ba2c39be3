"""Strangers of the challenge: each law by algebra, and none by a name that the catalogue has."""

import numpy as np
import pytest

from tissuejax.challenge import menu, probing_menu, stray_laws
from tissuejax.challenge.material import Ingredient
from tissuejax.challenge.probe_paths import Path
from tissuejax.challenge.probing_bench import SENSED, Visit, sensed, slid, turned
from tissuejax.challenge.specimen import Trial
from tissuejax.effects.catalogue import effects

TIME = np.linspace(0.0, 10.0, 101)
TRIAL = Trial("r1", "uniaxial", TIME, 1 + 0.02 * TIME, np.eye(3)[0], 100.0, 1e-4, 1e-2, 1e-2)
PATH = Path(np.array([0.0, 10.0]), np.array([[0.0, 0.0, 0.03], [0.0, 0.0, 0.026]]))
FORCE = np.stack([0 * TIME, 0 * TIME, 0.05 * TIME], -1)


def visit(number: int) -> Visit:
    return Visit(number, PATH, (300.0 * number, 600.0))


def test_no_stranger_has_a_name_that_the_diagnosis_knows():
    known = {"specimen-scatter", "hysteresis", "periodic", "energy-form"}
    assert not {c.name for c in menu.STRAY} & (set(effects("homogeneous")) | known)
    assert not {c.name for c in probing_menu.STRAY} & (set(effects("probing")) | known)


def test_torn_tissue_bears_less_from_a_moment_on():
    P = np.stack([TIME, 2 * TIME], -1)
    left = stray_laws.torn(TRIAL, P, 0.25, 104.95)
    np.testing.assert_array_equal(left[:50], P[:50])
    np.testing.assert_allclose(left[50:], 0.75 * P[50:])


def test_a_shock_peaks_at_its_amount_after_its_time_and_dies_out():
    shift = stray_laws.shock(TRIAL, 7.0, 102.0, 1.5)
    assert np.all(shift[:21] == 0)
    assert shift.max() == pytest.approx(7.0)
    assert TIME[np.argmax(shift)] == pytest.approx(3.5)
    assert shift[-1] == pytest.approx(7.0 * (8 / 1.5) * np.exp(1 - 8 / 1.5))


def test_an_amplifier_follows_a_step_at_its_pace_and_a_slow_rise_at_once():
    P = np.where(TIME < 2, 0.0, 10.0)  # 100 a second, over a tenth of a second; at a quarter of that it takes four
    out = stray_laws.slew(TRIAL, P, 3.0)
    np.testing.assert_allclose(out[19:25], [0, 2.5, 5, 7.5, 10, 10])
    slow = np.where(TIME < 5, TIME, 5 + 10 * (TIME - 5))
    np.testing.assert_allclose(stray_laws.slew(TRIAL, slow, 1.0)[:51], slow[:51])
    assert stray_laws.slew(TRIAL, slow, 1.0)[-1] == pytest.approx(5 + 5 * 5)


def test_a_bumped_frame_rings_and_is_still_after_a_while():
    rings = stray_laws.bumped(TRIAL, 3.0, 102.0, 0.4)
    assert np.all(rings[:21] == 0)
    assert rings[21] == pytest.approx(3 * np.exp(-0.05))  # a quarter of a period after
    assert rings[23] == pytest.approx(-3 * np.exp(-0.15))
    assert np.max(np.abs(rings[-20:])) < 0.2


@pytest.mark.parametrize(("number", "before", "after"), [(0, 1.0, 1.0), (1, 1.0, 0.8), (2, 0.8, 0.8)])
def test_a_probed_body_that_tore_stays_torn(number, before, after):
    i = Ingredient("torn", "", 0.2, {"number": 1, "where": 0.495})
    felt = sensed({"torn": i}, visit(number), FORCE, TIME)
    np.testing.assert_allclose(felt[:50], before * FORCE[:50])
    np.testing.assert_allclose(felt[50:], after * FORCE[50:])


def test_a_shock_of_the_cell_is_over_before_the_next_recording():
    i = Ingredient("shock", "", 0.02, {"number": 0, "where": 0.3, "time": 1.0})
    first, second = (sensed({"shock": i}, visit(n), FORCE, TIME) - FORCE for n in (0, 1))
    np.testing.assert_allclose(first[np.argmax(first[:, 2])], [0.004, -0.002, 0.02], atol=1e-12)
    assert np.all(second == 0)


def test_a_tip_that_rolls_turns_the_force_and_keeps_its_size():
    """About y, at the largest load by the whole angle: F (sin a, 0, cos a)."""
    seen = turned(Ingredient("rolls", "", 0.3, {"axis": [0.0, 1.0]}), FORCE)
    np.testing.assert_allclose(np.linalg.norm(seen, axis=1), FORCE[:, 2], atol=1e-12)
    np.testing.assert_allclose(seen[-1], 0.5 * np.array([np.sin(0.3), 0, np.cos(0.3)]), atol=1e-12)
    np.testing.assert_allclose(seen[50, 0], 0.25 * np.sin(0.15), atol=1e-12)


def test_a_tracker_slides_to_the_nearest_other_marker():
    rest = np.array([[0.0, 0, 0], [6e-3, 0, 0], [0, 9e-3, 0]])
    shown = np.tile(rest, (101, 1, 1))
    i = Ingredient("marker-jump", "", 0.5, {"number": 1, "where": 0.5, "which": 0.4})  # the second of three
    after = slid(i, visit(1), rest, TIME, shown)
    np.testing.assert_array_equal(after[:51], shown[:51])
    np.testing.assert_allclose(after[53:, 1], np.tile([3e-3, 0, 0], (48, 1)), atol=1e-12)
    np.testing.assert_array_equal(after[:, [0, 2]], shown[:, [0, 2]])
    assert slid(i, visit(0), rest, TIME, shown) is shown


def test_strangers_of_sensors_need_no_new_solution():
    assert {c.name for c in probing_menu.STRAY if not c.solved} <= SENSED
    assert not {c.name for c in probing_menu.STRAY if c.solved} & SENSED

"""Strength, toughness and friction found again in a record that another mesh made."""

import pytest

from tests.cutting.records import TRUTH, model, simulated
from tissuejax.fitting.cut import ENERGY, FRICTION, STRENGTH, fit_cut

KNOWN = {k: v for k, v in TRUTH.items() if k.startswith(("energy", "volumetric"))}


@pytest.mark.slow
def test_from_half_as_much_again_with_noise_and_a_mesh_twice_as_fine():
    start = {p: 1.5 * TRUTH[p] for p in (STRENGTH, ENERGY, FRICTION)}
    found = fit_cut(simulated(5e-4, 0.03), model(), KNOWN, start)
    assert found.values[ENERGY] == pytest.approx(TRUTH[ENERGY], rel=0.03)
    assert found.values[STRENGTH] == pytest.approx(TRUTH[STRENGTH], rel=0.15)
    assert found.values[FRICTION] == pytest.approx(TRUTH[FRICTION], rel=0.05)
    assert STRENGTH not in found.unidentified


@pytest.mark.slow
def test_without_the_entry_strength_is_not_identified():
    found = fit_cut(simulated(5e-4, 0.03, notch=6e-3), model(), KNOWN, {STRENGTH: 4500.0}, max_steps=4)
    assert STRENGTH in found.unidentified

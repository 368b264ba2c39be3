"""What a fit of cuts compares and finds: means over blocks of the way, the example, starts that are off."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tests.cutting.records import TRUTH, model, record, sample, simulated, strokes
from tissuejax.cohesion.catalogue import law
from tissuejax.effects.catalogue import effect
from tissuejax.energies.neo_hookean import NeoHookean
from tissuejax.energies.volumetric import Quadratic
from tissuejax.errors import InputError
from tissuejax.experiments.cutting_blocks import blocks
from tissuejax.experiments.cutting_record import path_of
from tissuejax.fitting.checkpoint import Checkpoint
from tissuejax.fitting.cut import fit_cut, too_coarse
from tissuejax.fitting.cut_result import ENERGY, FRICTION, STRENGTH
from tissuejax.fitting.cut_search import End, Search
from tissuejax.model import Model
from tissuejax.progress import Silent
from tissuejax.recordings.files import read

EXAMPLE = Path(__file__).parents[2] / "data" / "cut.h5"
KNOWN = {k: v for k, v in TRUTH.items() if k.startswith(("energy", "volumetric"))}


def test_a_ripple_of_the_elements_period_is_in_no_block():
    time, x = strokes(-0.002, 0.018, 0.008, rate=100.0)
    made = sample(record("r", time, x, 0 * x), length=0.02)
    path = path_of(made.recordings["r"], made.geometry)
    found = blocks(path, time, 1e-3)
    assert found.samples == 50
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(x)))])
    for waves in (1, 2, 3):
        ripple = np.sin(2 * np.pi * waves * way / 1e-3 + 0.3)
        assert np.abs(np.asarray(found.mean(ripple))[1:-1]).max() < 0.03
    np.testing.assert_allclose(np.asarray(found.mean(0 * x + 2.5)), 2.5)
    assert found.count == 30


def test_a_rest_is_cut_into_blocks_like_the_moving_blade():
    time, x = strokes(-0.002, 0.008, rate=100.0)
    time, x = np.append(time, time[-1] + np.arange(1, 401) / 100), np.append(x, np.full(400, x[-1]))
    made = sample(record("r", time, x, 0 * x), length=0.02)
    found = blocks(path_of(made.recordings["r"], made.geometry), time, 1e-3)
    held = np.bincount(found.block[found.block < found.count])
    assert held.max() <= found.samples + 1
    assert found.count >= 10 + 7


def test_the_example_is_recovered_by_the_balance():
    """Its forces come from an implicit foundation model: 20 J/m^2 and friction 0.1 (data/make_cut.py)."""
    made = Model(NeoHookean(), Quadratic(), (), cohesion=law("bilinear"))
    known = {"energy.mu": 3000.0, "volumetric.K": 32e3}
    found = fit_cut(read(EXAMPLE), made, known, names=("there-back-again",), by="balance")
    assert found.values[ENERGY] == pytest.approx(20.0, rel=0.01)
    assert found.values[FRICTION] == pytest.approx(0.1, rel=0.02)
    assert STRENGTH in found.unidentified
    assert not found.warnings
    assert len(found.predicted["there-back-again"].channels["cutting_force"].values) == 481


def test_a_blade_too_thin_for_its_elements_is_fitted_by_the_balance():
    """Half a millimetre of blade, elements of a quarter: 78 kPa part the tissue, of which they resolve a tenth."""
    made = Model(NeoHookean(), Quadratic(), (), cohesion=law("bilinear"))
    known = {"energy.mu": 3000.0, "volumetric.K": 32e3}
    found = fit_cut(read(EXAMPLE), made, known, names=("there-back-again",), by="either")
    assert found.by == "balance"
    assert "do not resolve" in found.unidentified[STRENGTH]


def test_a_blade_that_elements_resolve_is_no_such_case():
    model_ = model(effect("blade-friction"))
    for thickness, h in ((2e-3, 1e-3), (2e-3, 2e-3)):  # E' G / (2 G / b)^2 is 5.7 mm
        assert not too_coarse(model_, TRUTH, thickness, h)
    assert too_coarse(model_, TRUTH, 2e-3, 6e-3)


def test_a_stopped_fit_goes_on_from_what_it_kept(tmp_path):
    """And only from there; another question has another mark, so it begins at its own starts."""
    begun = []

    class Noted(Search):
        def _rounds(self, made, values):
            begun.append(dict(values))
            posed = SimpleNamespace(n_samples=1, noise=SimpleNamespace(estimated=False))
            return End(posed, SimpleNamespace(cost=0.1), True)

        def _misfit(self, made, values):
            return values[ENERGY]

    starts = [{ENERGY: 3.0, STRENGTH: 1.0}, {ENERGY: 2.0, STRENGTH: 1.0}]
    made = SimpleNamespace(prepared=lambda values: None)
    with Silent().stage("cutting") as stage:
        for mark, kept in (("a", None), ("a", {ENERGY: 2.2, STRENGTH: 4.0}), ("b", None)):
            search = Noted((STRENGTH, ENERGY), 4, Checkpoint(tmp_path / "kept.json", mark, starts[0]), stage)
            if kept:
                search._accepted(3, 1.0, kept)
            search.best(made, starts)
    assert begun == [starts[1], {ENERGY: 2.2, STRENGTH: 4.0}, starts[1]]


@pytest.mark.parametrize("energy", [-2.0, 1.25e-4])
def test_an_energy_that_no_tissue_has_is_refused_before_the_fit(energy):
    time, x = strokes(-0.002, 0.026, rate=20.0)
    made = sample(record("r", time, x, 0 * x + 0.1))
    with pytest.raises(InputError, match=r"cohesion.energy|energy in J"):
        fit_cut(made, model(), KNOWN, {ENERGY: energy}, by="balance")


@pytest.mark.parametrize("noise", [0.002, None])
def test_a_record_that_the_model_does_not_follow_is_said_to_be_so(noise):
    """Teeth of half the force: no one toughness and friction draw them, however well the descent ends."""
    time, x = strokes(-0.002, 0.026, rate=20.0)
    force = np.where(x > 0, 0.05 + 0.05 * (np.clip(x, 0, None) / 3e-3 % 1), 0.0)
    found = fit_cut(sample(record("r", time, x, force, noise=noise)), model(), KNOWN, by="balance")
    assert "does not describe the record" in found.warnings[0]
    assert found.record()["warnings"] == found.warnings


@pytest.mark.slow
@pytest.mark.parametrize("off", [0.5, 1.5])
def test_a_record_of_a_finer_mesh_is_recovered_from_half_off(off):
    start = {p: off * TRUTH[p] for p in (STRENGTH, ENERGY, FRICTION)}
    found = fit_cut(simulated(5e-4, 0.03), model(), KNOWN, start)
    assert found.status == "converged"
    assert not found.unidentified
    assert not found.warnings
    assert found.values[ENERGY] == pytest.approx(TRUTH[ENERGY], rel=0.03)
    assert found.values[STRENGTH] == pytest.approx(TRUTH[STRENGTH], rel=0.15)
    assert found.values[FRICTION] == pytest.approx(TRUTH[FRICTION], rel=0.05)

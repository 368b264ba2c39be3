"""A finding carried to another specimen: it holds where the physics is the same, and only there."""

import numpy as np
import pytest

from tissuejax.challenge.material import Ingredient, Specimen, reported
from tissuejax.challenge.protocols import path
from tissuejax.challenge.specimen import Trial
from tissuejax.challenge.strain_laws import Body
from tissuejax.diagnosis.transfer import transfer
from tissuejax.energies.catalogue import energy
from tissuejax.recordings.recording import Channel, Recording, Sample

NOISE = 3.0
LAW, EFFECTS = energy("reduced-polynomial-2"), ["viscoelasticity"]
FOUND = {"effects.viscoelasticity.g1": 0.3, "effects.viscoelasticity.tau1": 2.0}


def specimen(C10: float, tau: float | None) -> Sample:
    """A pull and a push with holds, of a block that relaxes by 0.3 in `tau` seconds, or not at all."""
    slow = (Ingredient("viscoelasticity", "prony", 0.3, {"shares": [1.0], "tau": [tau]}),) if tau else ()
    made, rng, recordings = Specimen(Body({"10": C10, "20": 0.8 * C10}), slow), np.random.default_rng(5), {}
    for k, far in enumerate((1.3, 0.75)):
        time, drive = path([far], 0.05, [8.0], 0.1, 1.0)
        t = Trial(f"r{k}", "uniaxial", time, drive, np.array([1.0, 0, 0]), 300.0 * k, 5e-4, 0.025, 0.025)
        stress = reported(made, t) + NOISE * rng.standard_normal(len(time))
        channel = Channel(time, stress, "Pa", NOISE)
        inputs, attributes = {"time": time, "stretch": drive}, {"start": t.start}
        recordings[t.name] = Recording(t.name, "uniaxial", inputs, {"nominal_stress": channel}, attributes)
    return Sample("other", recordings)


@pytest.mark.parametrize("C10", [250.0, 1100.0])
def test_what_belongs_to_the_material_holds_on_a_stiffer_and_a_softer_specimen(C10):
    t = transfer(specimen(C10, 2.0), LAW, EFFECTS, FOUND)
    assert t.carried == pytest.approx(NOISE, rel=0.1)
    assert t.before > 5 * NOISE
    assert t.explained > 0.95
    assert t.base["energy.C10"] == pytest.approx(C10, rel=0.02)
    assert t.as_dict()["rmse_carried"] == t.carried


def test_another_time_or_no_relaxation_at_all_is_not_explained():
    slower = transfer(specimen(600.0, 20.0), LAW, EFFECTS, FOUND)
    assert slower.carried > 2 * NOISE
    elastic = transfer(specimen(600.0, None), LAW, EFFECTS, FOUND)
    assert elastic.before == pytest.approx(NOISE, rel=0.1)
    assert elastic.explained < -1


def test_what_belongs_to_the_mounting_is_fitted_here():
    own = ("effects.viscoelasticity.g1",)
    tau = {"effects.viscoelasticity.tau1": 2.0}
    t = transfer(specimen(600.0, 2.0), LAW, EFFECTS, tau, own)
    assert t.base["effects.viscoelasticity.g1"] == pytest.approx(0.3, abs=0.02)

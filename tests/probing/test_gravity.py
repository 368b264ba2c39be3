"""Gravity inside a probing: the settled shape is the measured one, its stress is felt, and a fit carries all of it."""

from dataclasses import replace

import numpy as np
import pytest

from tests.probing.bench import MARKERS, QUICK, VALUES, measured, model, recording, sample
from tissuejax.effects.catalogue import suited
from tissuejax.experiments import programs
from tissuejax.experiments.homogeneous import local
from tissuejax.experiments.predictor import predictor
from tissuejax.experiments.probing_predictor import _linearised, _vector
from tissuejax.fitting.options import Unknowns
from tissuejax.fitting.probed import fit_probed
from tissuejax.fitting.setup import problem
from tissuejax.recordings.recording import Sample

WEIGHT = {"effects.gravity.acceleration": 9.81}


@pytest.fixture(scope="module")
def heavy():
    """The bench's tissue, whose top sags by some 0.3 mm under its own weight."""
    return predictor(model(suited("gravity", "probing")), sample(), settings=replace(QUICK, precision="float64"))


def test_the_settled_shape_is_the_measured_one_and_nothing_is_felt_before_touch(heavy):
    told = heavy.predict(VALUES | WEIGHT)["r1"]
    markers, force = told.channels["markers"], told.channels["force"]
    assert np.abs(markers.values[:2] - MARKERS).max() < 5e-6  # a hundredth of the sag
    assert np.abs(force.values[force.time < 0.25]).max() < 1e-4
    bare = heavy.predict(VALUES | {"effects.gravity.acceleration": 0.0})["r1"]
    assert np.abs(force.values - bare.channels["force"].values).max() > 0.003  # more than the sensor's noise


@pytest.mark.slow
def test_derivatives_carry_the_stress_free_shape(heavy):
    bare, setup = heavy.model.across(()), heavy.setups["r1"]
    known = local(heavy.model, heavy.model.defaults | VALUES | WEIGHT, "r1")
    theta = _vector(known)
    direction = np.random.default_rng(2).normal(size=len(theta)) * [bare.declared[path].typical for path in known]

    def run(x):
        return programs.run(_linearised, bare, x, setup, direction[None])

    h = 1e-5
    _, slopes = run(theta)
    (up, _), (down, _) = run(theta + h * direction), run(theta - h * direction)
    for name in ("force", "markers"):
        quotient = (np.asarray(up.channels[name]) - np.asarray(down.channels[name])) / (2 * h)
        error = np.linalg.norm(quotient - np.asarray(slopes[name][0])) / np.linalg.norm(quotient)
        assert error < 1e-4, (name, error)


@pytest.mark.slow
def test_a_fit_that_knows_of_gravity_finds_the_stiffness(heavy):
    blank = sample(recording())
    data = measured(heavy.predict(VALUES | WEIGHT)["r1"], blank.recordings["r1"], np.random.default_rng(3))
    heard = Sample("bench", {"r1": data}, blank.geometry, 1000.0)
    known = {"energy.C20": 300.0, "volumetric.K": 10e3}
    with_it = predictor(heavy.model, heard, settings=QUICK)
    found = fit_probed(
        problem(with_it, unknowns=Unknowns(start={"energy.C10": 800.0}, fix=known | WEIGHT)),
        numerical=False,
        finish=False,
    ).fit
    assert found.converged, found.status
    assert abs(found.values["energy.C10"] - VALUES["energy.C10"]) < 3 * found.std["energy.C10"]

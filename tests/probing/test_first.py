"""A surrogate as the first model of a fit: where it leads, beside the formulas or the simulator behind recordings."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.probing.bench import BODY, QUICK, VALUES, measured, model, recording, sample
from tests.surrogate import made as formulas
from tissuejax import verbs
from tissuejax.cli import main
from tissuejax.effects.viscoelasticity import Viscoelasticity
from tissuejax.energies.catalogue import forms_of
from tissuejax.errors import InputError
from tissuejax.experiments.predictor import predictor
from tissuejax.fitting.first import first
from tissuejax.fitting.options import Unknowns
from tissuejax.fitting.setup import problem
from tissuejax.mesh.columns import box, lobe_of_mesh
from tissuejax.recordings.recording import Recording, Sample
from tissuejax.surrogate.places import Box
from tissuejax.surrogate.precompute import Precomputed, precompute
from tissuejax.surrogate.predict import predicted
from tissuejax.surrogate.ramp import Matter
from tissuejax.surrogate.site_mesh import Grid

RELAXING = "effects.viscoelasticity."
TABULATED = VALUES | {RELAXING + "g1": 0.2, RELAXING + "g2": 0.1, RELAXING + "tau1": 0.5, RELAXING + "tau2": 6.0}
TOLD = {RELAXING + "g2": 0.1, RELAXING + "tau1": 0.3, RELAXING + "tau2": 6.0}


def surrogate() -> Precomputed:
    """From formulas, with relaxation."""
    forms = forms_of(model().energy, model().volumetric)
    record = {"model": {"energy": "reduced-polynomial-2", "forms": forms, "values": TABULATED}, "sample": "bench"}
    return Precomputed(formulas.formula(g=(0.2, 0.1), tau=(0.5, 6.0)), record, np.zeros((0, 8), int))


def pressed(name: str = "r1", radius: float = formulas.RADIUS, **where) -> Recording:
    """Down, hold, a short slide and up over the top that the formulas have; a force of nothing, noise 0.01 mN."""
    blank = recording(name, radius=radius, **where)
    path = np.array(blank.inputs["probe/position"])
    path[:, 2] += formulas.height(*path[:, :2].T) - formulas.RADIUS - 0.015
    force = replace(blank.channels["force"], noise_std=1e-5)
    return replace(blank, inputs=blank.inputs | {"probe/position": path}, channels={"force": force})


@cache
def recorded() -> Sample:
    """A force that another stiffness and another share made than those tabulated, with noise."""
    changes = {"factor": 0.7, "memory.g": np.array([0.35, 0.1]), "memory.tau": np.array([0.3, 6.0])}
    told = predicted(surrogate().surrogate.put(changes), pressed())
    return of(measured(told, pressed(), np.random.default_rng(2)))


def of(*recordings: Recording) -> Sample:
    """On a body as high as the formulas' top."""
    return sample(*recordings, geometry=box((0.04, 0.036, 0.03), (8, 8, 3)))


def posed(given: Sample, *effects, **unknowns):
    return problem(predictor(model(*effects), given, settings=QUICK), Unknowns(**unknowns))


def test_stiffness_and_share_are_led_to_those_of_the_recording():
    """What the fit holds fixed (here a time) counts, not what was tabulated; a fit without relaxation has none."""
    found = first(posed(recorded(), Viscoelasticity(terms=2), fix=TOLD), surrogate(), {})
    assert found.factor == pytest.approx(0.7, rel=0.005)
    assert found.start[RELAXING + "g1"] == pytest.approx(0.35, abs=0.015)
    assert found.start["energy.C10"] == pytest.approx(0.7 * VALUES["energy.C10"], rel=0.005)
    assert found.force_rms["after"] == pytest.approx(1e-5, rel=0.15)  # the noise
    assert found.used == ("r1",)
    elastic = first(posed(recorded()), surrogate(), {})
    assert elastic.start == pytest.approx({path: elastic.factor * v for path, v in VALUES.items()})
    assert elastic.force_rms["after"] > 2 * found.force_rms["after"]


def test_what_the_user_named_stays_and_bounds_hold():
    unknowns = {"start": {"energy.C20": 123.0}, "bounds": {"energy.C10": (600.0, 900.0)}, "fix": {"volumetric.K": 2e4}}
    found = first(posed(recorded(), **unknowns), surrogate(), unknowns["start"])
    assert found.start == {"energy.C10": 600.0}


def test_recordings_outside_the_box_are_left_out_and_told():
    aside = pressed("r2", place=(0.012, 0.003))
    both = replace(recorded(), recordings=recorded().recordings | {"r2": aside})
    found = first(posed(both), surrogate(), {})
    assert found.used == ("r1",)
    assert "mm beyond the sides of the surrogate's box" in found.left_out["r2"]
    with pytest.raises(InputError, match="no recorded force lies within .* precompute one around its site"):
        first(posed(of(aside)), surrogate(), {})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"energy": "neo-hookean"}, r"tabulated with reduced-polynomial-2 .*, the fit is of neo-hookean .*: pre"),
        ({"radius": 6e-3}, "surrogate is of a ball of 5.00 mm, recording r1 of 6.00 mm"),
        ({"name": "other"}, "the surrogate is of sample bench, the recordings are of other"),
        ({"fix": VALUES}, "no modulus is free, nor anything else that a surrogate can move"),
    ],
)
def test_what_a_first_model_refuses(change, words):
    given = replace(of(pressed(radius=change.get("radius", formulas.RADIUS))), name=change.get("name", "bench"))
    effects = ["contact-offset"] if "fix" in change else []
    law = verbs.material(change.get("energy", "reduced-polynomial-2"), volumetric="quadratic", effects=effects)
    with pytest.raises(InputError, match=words):
        first(problem(predictor(law, given, settings=QUICK), Unknowns(fix=change.get("fix"))), surrogate(), {})


def test_the_command_refuses_what_it_cannot_use(capsys, tmp_path):
    fit = ["fit", "data/demo/elastic.h5", "--energy", "reduced-polynomial-2", "--out", str(tmp_path / "fit")]
    for more, words in (
        (["--first", "a.play.h5"], "surrogates are of probings, .* are not"),
        (["--first", "a.play.h5", "--each"], "--first with --each"),
    ):
        assert main([*fit, *more]) == 2
        assert re.search(words, capsys.readouterr().err)


@pytest.mark.slow
def test_a_surrogate_leads_to_what_the_simulator_was_given():
    """Twice as stiff as the recording's tissue; the simulator's mesh is another one, of elements of 5 mm."""
    matter = Matter(model(), {path: 2 * value for path, value in VALUES.items()}, lobe_of_mesh(BODY), 8e-3, 1000.0)
    places = Box(np.array([-1e-3, -4e-3]), np.array([5e-3, 2e-3]), 3.3e-3, (2, 2), 5)
    made = precompute(matter, places, Grid((8, 8, 3), 8e-3), processes=1, numerical=False)
    blank = sample(recording())
    told = predictor(model(), blank, settings=QUICK).predict(VALUES)["r1"]
    given = replace(blank, recordings={"r1": measured(told, blank.recordings["r1"], np.random.default_rng(5))})
    found = first(posed(given), made, {})
    assert found.factor == pytest.approx(0.5, rel=0.1)
    assert found.force_rms["after"] < 0.2 * found.force_rms["before"]

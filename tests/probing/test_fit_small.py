"""A fit of a small probing: found again on hexes and on tets, and taken up where a killed one was."""

import io
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import equinox as eqx
import numpy as np
import pytest

from tests.probing.bench import BODY, QUICK, VALUES, measured, model, recording, sample
from tissuejax.effects.catalogue import suited
from tissuejax.errors import InputError
from tissuejax.experiments.predictor import predictor
from tissuejax.fitting.checkpoint import Checkpoint, mark_of
from tissuejax.fitting.options import Objective, Unknowns
from tissuejax.fitting.probed import fit_probed
from tissuejax.fitting.setup import problem
from tissuejax.fitting.stress_curve import fit_stress_curve
from tissuejax.progress import Lines
from tissuejax.recordings.recording import Geometry, Sample
from tissuejax.report.fit_overlay import FitOverlay

START = {"energy.C10": 800.0}
KNOWN = {"energy.C20": 300.0, "volumetric.K": 10e3}


def tets() -> Geometry:
    """The bench's box in tetrahedra, six a hex."""
    six = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
    cells = np.concatenate([np.asarray(BODY.cells)[:, list(t)] for t in six])
    return Geometry(BODY.points, cells, "tetra", BODY.fixed)


def posed(geometry=BODY, settings=QUICK):
    """One recording with noise, made by the simulator at `VALUES`; C10 is sought from 60 % above."""
    blank = sample(recording(), geometry=geometry)
    told = predictor(model(), blank, settings=settings).predict(VALUES)["r1"]
    noisy = measured(told, blank.recordings["r1"], np.random.default_rng(5))
    p = predictor(model(), Sample("bench", {"r1": noisy}, geometry, 1000.0), settings=settings)
    return problem(p, unknowns=Unknowns(start=START, fix=KNOWN))


@pytest.mark.parametrize("geometry", [BODY, pytest.param(tets(), marks=pytest.mark.slow)], ids=["hexes", "tets"])
def test_the_stiffness_is_found_again(geometry):
    settings = QUICK if geometry is BODY else replace(QUICK, step=4e-4)
    found = fit_probed(posed(geometry, settings), numerical=False, finish=False).fit
    assert found.converged, found.status
    assert abs(found.values["energy.C10"] - VALUES["energy.C10"]) < 3 * found.std["energy.C10"]
    assert found.std["energy.C10"] < 0.02 * VALUES["energy.C10"]
    # the rest of the markers is itself a mean over few noisy frames, which adds a sixth to their chi-square
    assert 0.9 < found.chi2_per_dof < 1.25
    errors = found.sites["r1"]
    assert errors["force"]["after"] == pytest.approx(3**0.5 * 0.003, rel=0.1)
    assert errors["force"]["before"] > 5 * errors["force"]["after"]
    assert errors["markers"]["after"] <= errors["markers"]["before"]


def test_the_stress_curve_iteration_takes_one_site_and_lowers_its_force_error():
    found = fit_stress_curve(posed(), iterations=2)
    force = found.sites["r1"]["force"]
    assert force["after"] < force["before"] / 3
    assert found.method == "stress-curve"
    assert found.record()["sites"]["r1"]["force"] == force
    two = predictor(model(), sample(recording("a"), recording("b")), settings=QUICK)
    with pytest.raises(InputError, match="takes one probing, got a, b"):
        fit_stress_curve(problem(two, unknowns=Unknowns(start=START, fix=KNOWN)))


def fit(checkpoint, on_accept=None):
    return fit_probed(posed(), checkpoint=checkpoint, numerical=False, finish=False, on_accept=on_accept)


@pytest.mark.parametrize("stopped_at", [1, -2], ids=["in the swift descent", "in the steps of the end"])
def test_an_interrupted_fit_goes_on_from_its_last_accepted_values(tmp_path, stopped_at):
    kept = tmp_path / "checkpoint.json"
    accepted = []
    whole = fit(None, lambda n, chi2, values: accepted.append(values))
    last = accepted[stopped_at]

    def interrupted(n, chi2, values):
        if values == last:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fit(kept, interrupted)
    assert json.loads(kept.read_text())["values"] == last
    again = []
    rest = fit(kept, lambda n, chi2, values: again.append(values))
    assert all(abs(v["energy.C10"] - START["energy.C10"]) > 1.0 for v in again)  # never back at the start
    if stopped_at < 0:  # nor down the swift descent
        assert rest.simulations["jacobian"] < whole.simulations["jacobian"]
    assert rest.fit.values["energy.C10"] == pytest.approx(whole.fit.values["energy.C10"], rel=1e-3)
    assert not kept.exists()


def test_what_was_kept_of_another_question_is_not_taken(tmp_path):
    """Mesh, probe, noise, priors, fixed values: a fit of anything else begins at its own start."""
    path, one = tmp_path / "checkpoint.json", sample()
    deeper, wider = recording(depth=3.1e-3), recording(radius=8.1e-3)
    moved = Geometry(BODY.points * 1.01, BODY.cells, BODY.cell_type, BODY.fixed)

    def asked(given=one, settings=QUICK, objective=None, fix=KNOWN, **limits):
        unknowns = Unknowns(start=START, fix=fix, **limits)
        return problem(predictor(model(), given, settings=settings), unknowns, objective)

    def kept(posed):
        p = posed.predictor
        return Checkpoint(path, mark_of(posed, p.settings, p.setups), posed.start)

    kept(asked()).keep({"energy.C10": 555.0})
    assert kept(asked()).values()["energy.C10"] == 555.0
    others = [
        asked(sample(deeper)),
        asked(sample(wider)),
        asked(sample(geometry=moved)),
        asked(sample(density=1010.0)),
        asked(settings=replace(QUICK, penalty=4e8)),
        asked(fix=KNOWN | {"energy.C20": 310.0}),
        asked(priors={"energy.C10": (500.0, 50.0)}),
        asked(bounds={"energy.C10": (0.0, 900.0)}),
        asked(objective=Objective(weights={"force": 0.004, "markers": 6e-5})),
        asked(objective=Objective(loss="cauchy")),
    ]
    assert [kept(other).values()["energy.C10"] for other in others] == [800.0] * len(others)


@pytest.mark.slow
def test_a_killed_fit_goes_on_from_its_last_accepted_values(tmp_path):
    """The process is killed outright (SIGKILL) after its first accepted step; another one takes the fit up."""
    kept = tmp_path / "checkpoint.json"
    script = (
        "import os, signal, jax\n"
        "jax.config.update('jax_enable_x64', True)\n"
        "from tests.probing.test_fit_small import START, fit\n"
        "def stop(n, chi2, values):\n"
        "    if abs(values['energy.C10'] - START['energy.C10']) > 250: os.kill(os.getpid(), signal.SIGKILL)\n"
        f"fit({str(kept)!r}, stop)\n"
    )
    root = Path(__file__).parents[2]
    died = subprocess.run([sys.executable, "-c", script], cwd=root, check=False)
    assert died.returncode == -9
    rest, whole = fit(kept), fit(None)
    assert rest.simulations["jacobian"] < whole.simulations["jacobian"]
    assert rest.fit.values["energy.C10"] == pytest.approx(whole.fit.values["energy.C10"], rel=1e-3)


def test_gravity_without_density_is_refused():
    with pytest.raises(InputError, match="gravity needs the density"):
        predictor(model(suited("gravity", "probing")), sample(density=None), settings=QUICK)


def test_a_fixed_set_on_a_line_floats():
    row = np.flatnonzero(np.isclose(BODY.points[:, 2], 0) & np.isclose(BODY.points[:, 1], BODY.points[:, 1].min()))
    with pytest.raises(InputError, match="floats"):
        predictor(model(), sample(geometry=eqx.tree_at(lambda g: g.fixed, BODY, row)), settings=QUICK)


@pytest.mark.slow
def test_standard_errors_are_those_of_derivatives_at_lifes_pace():
    """A bulk modulus beside a shear modulus: what rings in a swift run told them apart, and errors came out too small.

    Against central differences of the simulation that counts.
    """
    made = posed(settings=QUICK)
    both = replace(made, free=("energy.C10", "volumetric.K"), start=made.start | {"volumetric.K": 8e3})
    found = fit_probed(both, numerical=False, finish=False)
    values, columns = found.fit.values, []
    for path in both.free:
        step = 0.02 * values[path]
        up, down = (both.residuals(values | {path: values[path] + s}) for s in (step, -step))
        columns.append((up - down) / (2 * step))
    J = np.stack(columns, 1)
    expected = np.sqrt(np.diag(np.linalg.inv(J.T @ J))) * max(1.0, found.fit.chi2_per_dof**0.5)
    for path, std in zip(both.free, expected, strict=True):
        assert found.noise_std[path] == pytest.approx(std, rel=0.1)


def test_what_was_held_out_has_the_band_that_it_would_have_if_fitted():
    """The same press, measured once more with other noise and the same marker lost: its derivatives are those of the
    first, so are its bands."""
    first = posed().predictor.sample.recordings["r1"]
    told = {n: np.array(c.values, float) for n, c in first.channels.items()}
    told["markers"][20:, 1] = np.nan
    rng = np.random.default_rng(8)
    seen = {n: replace(c, values=told[n]) for n, c in first.channels.items()}
    again = {n: replace(c, values=told[n] + rng.normal(0, c.noise_std, told[n].shape)) for n, c in seen.items()}
    both = [replace(first, name=n, channels=c) for n, c in (("r1", seen), ("r2", again))]
    one = predictor(model(), sample(*both), ("r1",), settings=QUICK)
    made = problem(one, unknowns=Unknowns(start=START, fix=KNOWN))
    two = replace(made, free=("energy.C10", "volumetric.K"), start=made.start | {"volumetric.K": 8e3})
    said = io.StringIO()
    progress = Lines(every=0.0, file=said)
    found = fit_probed(two, holdout=("r2",), numerical=False, finish=False, progress=progress).fit
    assert "band of what was held out" in said.getvalue()
    for channel, width in (("force", (len(seen["force"].time), 3)), ("markers", (len(seen["markers"].time),))):
        fitted, held = (found.curve_std[n][channel] for n in ("r1", "r2"))
        assert held.shape == width
        assert held.max() > 0
        np.testing.assert_allclose(held, fitted, rtol=1e-9, atol=1e-9 * held.max())
    caption = FitOverlay().caption(FitOverlay().prepare(found))
    assert "Band: where 95 %" in caption
    assert "No band" not in caption
    assert "Orange" in caption

"""The force of a cut by the balance of energies, its recording, and the effects of cutting."""

import numpy as np
import pytest

from tests.cutting.oracles import layer_energy, layer_stress
from tests.cutting.records import VALUES, model, record, sample, strokes
from tissuejax.effects.catalogue import effect, effects
from tissuejax.effects.effect import Effect
from tissuejax.errors import InputError
from tissuejax.experiments.cutting_record import path_of, steady
from tissuejax.experiments.predictor import predictor
from tissuejax.recordings.files import read
from tissuejax.recordings.hdf5_writing import write

NAMES = sorted(effects("cutting"))
OWN = [n for n in NAMES if type(effect(n)).cut is not Effect.cut]
TIME, X = strokes(-0.002, 0.025, -0.002, 0.024)
SAMPLE = sample(record("there and back", TIME, X, 0.0 * X + 0.1))


def force(m, values, made=SAMPLE):
    p = predictor(m, made)
    return np.asarray(p.predict(values)[made_name(made)].channels["cutting_force"].values)


def made_name(made):
    return next(iter(made.recordings))


def test_steady_cut_return_and_second_pass():
    rubbing = model(effect("blade-friction"))
    at = force(rubbing, VALUES | {"effects.blade-friction.coefficient": 0.1})
    squeezed = 1 - 0.2e-3 / 0.01
    mu, K = VALUES["energy.mu"], VALUES["volumetric.K"]
    wedge = 2 * 0.01 * layer_energy(squeezed, mu, K)
    rub = 0.2 * -layer_stress(squeezed, mu, K)
    first = np.argmax(X > 0.02)
    back = first + np.argmax(X[first:] >= 0.0249) + 50
    again = len(X) - 100
    # normal forces N on the bevels do the work across: 2 N (cos a -+ 0.1 sin a) tan a = G + wedge, a = 15 degrees
    a = np.radians(15)
    going, coming = (
        (np.sin(a) + m * np.cos(a)) / (np.cos(a) - m * np.sin(a)) / np.tan(a) for m in (0.1, -0.1)
    )  # fmt: skip
    assert at[first] == pytest.approx(0.01 * ((5.0 + wedge) * going + rub * X[first]), rel=1e-3)
    assert at[back] == pytest.approx(0.01 * (wedge * coming - rub * X[back]), rel=1e-3)
    assert at[again] == pytest.approx(0.01 * (wedge * going + rub * X[again]), rel=1e-3)
    assert at[0] == 0


def test_a_sample_at_a_turn_is_of_neither_stroke():
    """Its friction has one sign or the other; before it a cut is steady to the last, after it not at once."""
    path = path_of(SAMPLE.recordings["there and back"], SAMPLE.geometry)
    counts = steady(path, TIME)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(X)))) + 1
    assert len(turns) == 2
    assert not counts[turns].any()
    assert counts[turns[0] - 2]  # between two samples of a stroke a force is that of the stroke
    assert not counts[turns[0] + 1]


@pytest.mark.parametrize("name", OWN)
def test_neutral_changes_no_bit_and_has_a_derivative(name):
    e = effect(name)
    neutral = {f"effects.{name}.{k}": v for k, v in e.neutral.items()}
    with_it = model(e)
    np.testing.assert_array_equal(force(with_it, VALUES | neutral), force(model(), VALUES))
    p = predictor(with_it, SAMPLE)
    for a in e.amplitudes:
        path = f"effects.{name}.{a}"
        at, slopes = p.jacobian(VALUES | neutral, [path])
        step = 1e-4 * p.model.parameters[path].typical
        moved = p.predict(VALUES | neutral | {path: step})
        name_ = made_name(SAMPLE)
        difference = (
            np.asarray(moved[name_].channels["cutting_force"].values)
            - np.asarray(at[name_].channels["cutting_force"].values)
        ) / step
        assert np.abs(difference).max() > 0, f"{path} does nothing"
        slope = slopes[path][name_]["cutting_force"]
        assert np.linalg.norm(slope - difference) <= 0.02 * np.linalg.norm(difference)


@pytest.mark.parametrize("name", OWN)
def test_says_what_it_is(name):
    text = type(effect(name)).__doc__
    assert "Neutral" in text
    assert "Reveal" in text
    assert "Blind" in text


def test_the_sign_of_a_file_is_read_from_the_record():
    turned = sample(record("there and back", TIME, X, 0.0 * X - 0.1))
    for made in (SAMPLE, turned):
        p = predictor(model(), made)
        assert np.asarray(
            p.sample.recordings["there and back"].channels["cutting_force"].values
        ).mean() == pytest.approx(0.1)


def test_file_and_back(tmp_path):
    path = write(SAMPLE, tmp_path / "cut.h5")
    again = read(path)
    np.testing.assert_array_equal(force(model(), VALUES, again), force(model(), VALUES))


def test_refusals():
    def refused(match, r, made=None):
        with pytest.raises(InputError, match=match):
            predictor(model(), made or sample(r))

    refused("starts in the cut", record("r", TIME, X + 0.01, 0 * X))
    refused("never enters", record("r", TIME, X * 0 - 0.01, 0 * X))
    refused("is it in mm", record("r", TIME, X, 0 * X, thickness=0.4))
    m = model()
    with pytest.raises(InputError, match="cohesive law"):
        predictor(m.__class__(m.energy, m.volumetric), SAMPLE)

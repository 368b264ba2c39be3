"""One battery for every effect that acts in material tests, found by walking the folder.

What an effect promises: it says what reveals it, it is exactly nothing at neutral, its derivative there exists and is
that of the finite effect, an injected amplitude is found again, and what it declares itself blind to it doesn't see.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares

from tests.specimens import BASE, VALUES, every_kind, ramp, recording, stresses
from tissuejax.effects.catalogue import effect, effects
from tissuejax.errors import InputError
from tissuejax.experiments.catalogue import experiment
from tissuejax.experiments.homogeneous import local, nominal_stress
from tissuejax.experiments.predictor import predictor
from tissuejax.recordings.recording import Sample

EVERY = sorted(effects("homogeneous"))
NAMES = [n for n in EVERY if effects()[n]().parameters]  # the others only widen the discrepancy of a diagnosis
SAMPLE = every_kind()
FEW = ["tension", "compression", "planar"]  # one compiled prediction serves all three


def amplitude_paths(predictor, e):
    first = tuple(f"effects.{e.name}.{a}" for a in e.amplitudes)
    return [p for p in predictor.paths if p.startswith(first)]


def injected(declared):
    """A plainly visible strength, within bounds."""
    return {"g": 0.2, "r": 0.3, "gap": 0.015, "k1": 150.0, "friction": 0.3, "rate": 2e-4}.get(
        declared.name, 2 * declared.scale
    )


@pytest.mark.parametrize("name", EVERY)
def test_says_what_it_is(name):
    e = effect(name)
    text = type(e).__doc__
    assert "Revealed" in text
    assert "Blind" in text
    assert "Source:" in text
    for said in (e.reveals, e.blind, e.source):
        assert said
    declared = {d.name: d for d in e.parameters}
    assert set(e.amplitudes) <= set(declared)
    assert not set(e.grid) & set(e.amplitudes)
    for a in e.amplitudes:
        assert declared[a].default == 0
        assert declared[a].scale, "an amplitude needs a scale to step by"
    for setting in e.settings(1000.0):
        assert all(declared[k].lower <= v <= declared[k].upper for k, v in setting.items())


@pytest.mark.parametrize("name", NAMES)
def test_neutral_changes_no_bit(name):
    e = effect(name)
    base = stresses(predictor(BASE, SAMPLE, FEW).predict(VALUES))
    off = stresses(predictor(BASE.with_effects(e), SAMPLE, FEW).predict(VALUES | {}))
    for r in FEW:
        np.testing.assert_array_equal(off[r], base[r])


@pytest.mark.parametrize("name", [n for n in NAMES if n != "nonlinear-viscosity"])
def test_neutral_hooks_change_no_bit_operation_by_operation(name):
    """Without the predictor's dropping of neutral effects, and without fused kernels that round in their own way."""
    short = every_kind(9).recordings
    model = BASE.with_effects(effect(name))
    for kind in ("tension", "shear"):
        r = short[kind]
        test = jax.tree.map(jnp.asarray, experiment(r.experiment).test(r))
        with jax.disable_jit():
            base = nominal_stress(BASE, jax.tree.map(jnp.asarray, local(BASE, VALUES, r.name)), test)
            off = nominal_stress(model, jax.tree.map(jnp.asarray, local(model, VALUES, r.name)), test)
        np.testing.assert_array_equal(np.asarray(off), np.asarray(base))


@pytest.mark.parametrize("name", NAMES)
def test_derivative_at_neutral(name):
    """Exists, is the one-sided difference of the finite effect, and is zero for shapes."""
    e = effect(name)
    p = predictor(BASE.with_effects(e), SAMPLE, FEW)
    amplitudes = amplitude_paths(p, e)
    at, slopes = p.jacobian(VALUES, p.paths)
    at = stresses(at)
    for path in (q for q in p.paths if q.startswith("effects.")):
        for r in FEW:
            slope = np.asarray(slopes[path][r]["nominal_stress"])
            assert np.isfinite(slope).all(), (path, r)
            if path not in amplitudes:
                assert not slope.any(), f"{path} acts although {name} is off"
                continue
            step = 1e-5 * p.model.parameters[path].scale
            difference = (stresses(p.predict(VALUES | {path: step}))[r] - at[r]) / step
            np.testing.assert_allclose(slope, difference, rtol=1e-3, atol=1e-3 * (np.abs(difference).max() + 1))


@pytest.mark.parametrize("name", NAMES)
def test_injected_amplitude_is_found_again(name):
    # A term that the base energy has too can't be told from it.
    e = effect(name, **({"terms": ("C30", "C01")} if name == "energy-form" else {}))
    p = predictor(BASE.with_effects(e), SAMPLE, FEW)
    paths = amplitude_paths(p, e)
    truth = {q: injected(p.model.parameters[q]) for q in paths}
    made = stresses(p.predict(VALUES | truth))
    free = [*VALUES, *paths]
    scale = np.array([*VALUES.values(), *(p.model.parameters[q].scale for q in paths)])

    def residual(x):
        now = stresses(p.predict(dict(zip(free, x * scale))))
        return np.concatenate([(now[r] - made[r]) / 10 for r in FEW])

    def jacobian(x):
        _, s = p.jacobian(dict(zip(free, x * scale)), p.paths)  # all, so that compiled code is shared
        return np.stack([np.concatenate([s[q][r]["nominal_stress"] / 10 for r in FEW]) for q in free], 1) * scale

    start = np.array([1.0, 1.0, *(1e-3 for _ in paths)])
    found = least_squares(residual, start, jacobian, x_scale="jac", xtol=1e-12, ftol=1e-14, gtol=1e-12)
    values = dict(zip(free, found.x * scale))
    for path in free:
        assert values[path] == pytest.approx((VALUES | truth)[path], rel=1e-3), path


def test_softening_is_blind_to_monotonic_loading():
    time = np.linspace(0, 10, 40)
    sample = Sample("up", {"r": recording("r", "uniaxial", time, 1 + 0.03 * time)})
    p = predictor(BASE.with_effects(effect("softening")), sample)
    off, on = (stresses(p.predict(VALUES | {"effects.softening.r": r}))["r"] for r in (0.0, 0.5))
    np.testing.assert_allclose(on, off, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("r", ["tension", "planar", "biaxial", "shear"])
def test_platen_friction_is_blind_to_all_but_compression(r):
    p = predictor(BASE.with_effects(effect("platen-friction")), SAMPLE, [r])
    off, on = (stresses(p.predict(VALUES | {"effects.platen-friction.friction": f}))[r] for f in (0.0, 0.5))
    np.testing.assert_allclose(on, off, rtol=1e-12, atol=1e-9)


def test_compressibility_is_blind_to_simple_shear_at_small_amounts():
    time = np.linspace(0, 10, 40)
    sample = Sample("s", {"r": recording("r", "simple-shear", time, ramp(time, (0, 0), (10, 0.02)))})
    p = predictor(BASE.with_effects(effect("compressibility")), sample)
    off, on = (stresses(p.predict(VALUES | {"effects.compressibility.immediate": c}))["r"] for c in (0.0, 1e-4))
    np.testing.assert_allclose(on, off, rtol=1e-3, atol=1e-9)


def test_energy_form_is_blind_to_small_strain():
    time = np.linspace(0, 10, 40)
    sample = Sample("s", {"r": recording("r", "uniaxial", time, 1 + 1e-5 * time)})
    model = BASE.with_effects(effect("energy-form", terms=("C20", "C30", "C02", "exponential")))
    _, slopes = predictor(model, sample).jacobian(VALUES, ["energy.C10", "effects.energy-form.exponential"])
    seen = [np.abs(slopes[q]["r"]["nominal_stress"]).max() for q in slopes]
    assert seen[1] < 1e-6 * seen[0]


def test_drift_of_every_recording_has_its_own_paths():
    p = predictor(BASE.with_effects(effect("drift", separate=True)), SAMPLE, FEW)
    assert "effects.drift.offset.planar" in p.paths
    _, slopes = p.jacobian(VALUES, ["effects.drift.offset.planar"])
    slopes = {r: s["nominal_stress"] for r, s in slopes["effects.drift.offset.planar"].items()}
    assert (slopes["planar"] == 1).all()
    assert not slopes["tension"].any()
    shifted = stresses(p.predict(VALUES | {"effects.drift.offset.planar": 5.0}))
    base = stresses(p.predict(VALUES))
    np.testing.assert_allclose(shifted["planar"] - base["planar"], 5.0)
    np.testing.assert_array_equal(shifted["tension"], base["tension"])
    held_out = stresses(p.of(["shear"]).predict(VALUES | {"effects.drift.offset.planar": 5.0}))["shear"]
    np.testing.assert_array_equal(held_out, stresses(predictor(BASE, SAMPLE, ["shear"]).predict(VALUES))["shear"])


def test_order_of_effects_does_not_matter():
    a, b = effect("softening"), effect("viscoelasticity")
    values = VALUES | {"effects.softening.r": 0.3, "effects.viscoelasticity.g1": 0.2}
    one, two = (
        stresses(predictor(BASE.with_effects(*pair), SAMPLE, ["tension"]).predict(values))["tension"]
        for pair in ((a, b), (b, a))
    )
    np.testing.assert_array_equal(one, two)


def test_an_effect_is_added_once():
    with pytest.raises(InputError, match="twice"):
        BASE.with_effects(effect("slack"), effect("slack"))


@pytest.mark.parametrize("name", sorted(set(EVERY) - set(NAMES)))
def test_what_has_no_parameters_is_refused_where_something_is_predicted(name):
    e = effect(name)
    assert e.remedy
    with pytest.raises(InputError, match=f"{name} has no parameters: .*tissuejax diagnose.*{e.remedy[:20]}"):
        predictor(BASE.with_effects(e), SAMPLE, FEW)


def test_unknown_effect_offers_the_nearest():
    with pytest.raises(InputError, match="softening"):
        effect("softenin")

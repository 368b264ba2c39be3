"""One battery for every kind of material test, found by walking the folder."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.specimens import BASE, VALUES, every_kind, recording, stresses
from tissuejax.effects.catalogue import effect
from tissuejax.energies.catalogue import volumetric
from tissuejax.errors import InputError
from tissuejax.experiments import homogeneous_predictor
from tissuejax.experiments.catalogue import experiment, experiments
from tissuejax.experiments.homogeneous import local, nominal_stress
from tissuejax.experiments.predictor import predictor
from tissuejax.model import Model
from tissuejax.recordings.recording import Sample

KINDS = sorted(name for name, kind in experiments().items() if kind.kind == "homogeneous")
SAMPLE = every_kind()
OF_KIND = {r.experiment: r for r in SAMPLE.recordings.values()}


def pure(kind):
    """(function of a parameter vector, its point) for a recording of `kind` with relaxing tissue."""
    model = BASE.with_effects(effect("viscoelasticity", terms=1))
    r = OF_KIND[kind]
    test = jax.tree.map(jnp.asarray, experiment(kind).test(r))
    values = local(model, VALUES | {"effects.viscoelasticity.g1": 0.2}, r.name)
    theta = jnp.array(list(values.values()))
    return jax.jit(lambda x: nominal_stress(model, dict(zip(values, x)), test)), theta


@pytest.mark.parametrize("kind", KINDS)
def test_a_prediction_is_a_recording(kind):
    r = OF_KIND[kind]
    predicted = experiment(kind).predict(BASE, VALUES, r)
    assert type(predicted) is type(r)
    assert predicted.inputs is r.inputs
    channel, measured = predicted.channels["nominal_stress"], r.channels["nominal_stress"]
    assert channel.unit == measured.unit
    assert channel.values.shape == measured.values.shape
    assert abs(float(channel.values[0].max())) < 1e-9, "stress at rest"
    assert float(np.abs(channel.values).max()) > 10


@pytest.mark.parametrize("kind", KINDS)
def test_one_pure_function(kind):
    """jit, jvp, vjp and vmap from outside agree with each other and with differences."""
    f, theta = pure(kind)
    y, slope = jax.jit(lambda x: jax.jvp(f, (x,), (theta,)))(theta)
    np.testing.assert_allclose(y, f(theta), rtol=1e-9, atol=1e-9)
    h = 1e-5
    np.testing.assert_allclose(slope, (f(theta * (1 + h)) - f(theta * (1 - h))) / (2 * h), rtol=1e-5, atol=1e-3)
    weight = jnp.cos(jnp.arange(y.size)).reshape(y.shape)
    _, back = jax.vjp(f, theta)
    assert float(back(weight)[0] @ theta) == pytest.approx(float(jnp.sum(weight * slope)), rel=1e-8)
    several = jax.vmap(f)(jnp.stack([theta, 1.1 * theta]))
    np.testing.assert_allclose(several[1], f(1.1 * theta), rtol=1e-9, atol=1e-9)


def test_vmap_over_specimens():
    tests = [experiment("uniaxial").test(SAMPLE.recordings[r]) for r in ("tension", "compression")]
    stacked = jax.tree.map(lambda *a: jnp.stack(a), *tests)
    values = local(BASE, VALUES, "")
    both = jax.jit(jax.vmap(lambda test: nominal_stress(BASE, values, test)))(stacked)
    one = stresses(predictor(BASE, SAMPLE, ["tension", "compression"]).predict(VALUES))
    np.testing.assert_allclose(both[0], one["tension"], rtol=1e-10, atol=1e-9)
    np.testing.assert_allclose(both[1], one["compression"], rtol=1e-10, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_predictor_agrees_with_experiment_and_padding_changes_nothing(kind):
    r = OF_KIND[kind]
    model = BASE.with_effects(effect("viscoelasticity"), effect("softening"))
    values = VALUES | {"effects.viscoelasticity.g1": 0.2, "effects.softening.r": 0.3}
    p = predictor(model, SAMPLE, [r.name])
    mine = stresses({"r": experiment(kind).predict(model, values, r)})["r"]
    theirs = p.predict(values)[r.name]
    np.testing.assert_allclose(theirs.channels["nominal_stress"].values, mine, rtol=1e-9, atol=1e-9)
    predicted, slopes = p.jacobian(values, ["energy.C10", "effects.viscoelasticity.tau1"])
    np.testing.assert_allclose(predicted[r.name].channels["nominal_stress"].values, mine, rtol=1e-9, atol=1e-9)
    assert slopes["energy.C10"][r.name]["nominal_stress"].shape == mine.shape


def test_compiled_code_serves_other_samples():
    """Another sample, another length (same padding), another kind with one stretch: nothing is compiled again."""
    model = BASE.with_effects(effect("aging"))
    values = VALUES | {"effects.aging.rate": 1e-4}
    predictor(model, SAMPLE, ["tension"]).predict(values)
    before = homogeneous_predictor._predict._cache_size()
    again = Model(type(BASE.energy)(order=2)).with_effects(effect("aging"))
    predictor(again, every_kind(77), ["compression", "planar", "equibiaxial"]).predict(values)
    assert homogeneous_predictor._predict._cache_size() == before


def test_predictions_inside_jit():
    p = predictor(BASE, SAMPLE, ["tension"])

    @jax.jit
    def total(c):
        return p.predict({"energy.C10": c, "energy.C20": 520.0})["tension"].channels["nominal_stress"].values.sum()

    expected = stresses(p.predict(VALUES))["tension"].sum()
    assert float(total(450.0)) == pytest.approx(expected, rel=1e-10)
    assert np.isfinite(jax.grad(total)(450.0))


def test_models_are_equal_by_structure():
    assert hash(BASE) == hash(Model(type(BASE.energy)(order=2)))
    assert Model(type(BASE.energy)(order=3)) != BASE


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda r: eqx.tree_at(lambda q: q.inputs["stretch"], r, r.inputs["stretch"] - 2), "positive"),
        (lambda r: eqx.tree_at(lambda q: q.inputs["stretch"], r, r.inputs["stretch"][:5]), "shape"),
    ],
)
def test_impossible_input_is_refused(change, says):
    with pytest.raises(InputError, match=says):
        experiment("uniaxial").test(change(SAMPLE.recordings["tension"]))


def test_names_are_checked():
    with pytest.raises(InputError, match="uniaxial"):
        experiment("uniaxal")
    with pytest.raises(InputError, match="tension"):
        predictor(BASE, SAMPLE, ["tensio"])
    with pytest.raises(InputError, match=r"energy\.C10"):
        predictor(BASE, SAMPLE, ["tension"]).predict({"energy.C1": 1.0})
    with pytest.raises(InputError, match="option"):
        predictor(BASE, SAMPLE, ["tension"], mesh=3)
    no_stretch = recording("r", "simple-shear", np.arange(3.0), np.zeros(3))
    wrong = eqx.tree_at(lambda r: r.channels, no_stretch, no_stretch.channels)
    object.__setattr__(wrong, "experiment", "uniaxial")
    with pytest.raises(InputError, match="stretch"):
        predictor(BASE, Sample("s", {"r": wrong}))


def test_a_compressible_model_differentiates():
    model = Model(BASE.energy, volumetric("quadratic"))
    p = predictor(model, SAMPLE, ["tension"])
    values = VALUES | {"volumetric.K": 5e3}
    at, slopes = p.jacobian(values, ["volumetric.K"])
    h = 1.0
    up, down = (stresses(p.predict(values | {"volumetric.K": 5e3 + s * h})) for s in (1, -1))
    for r in p.names:
        slope = slopes["volumetric.K"][r]["nominal_stress"]
        np.testing.assert_allclose(slope, (up[r] - down[r]) / (2 * h), rtol=1e-4, atol=1e-8)

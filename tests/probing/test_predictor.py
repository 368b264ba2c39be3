"""The prediction of probings: neutral effects, derivatives, invariances, rest of markers, refusals."""

from dataclasses import replace
from types import SimpleNamespace

import jax
import numpy as np
import pytest

from tests.probing.bench import BODY, MARKERS, QUICK, VALUES, model, recording, sample
from tissuejax.effects.catalogue import effects, suited
from tissuejax.errors import InputError, UnstableSimulation
from tissuejax.experiments import programs, soundness, workers
from tissuejax.experiments.predictor import predictor
from tissuejax.experiments.probing import Simulated, assembled
from tissuejax.experiments.probing_predictor import ProbingPredictor, _linearised, _vector
from tissuejax.experiments.probing_sensors import rest_positions
from tissuejax.experiments.probing_settings import ProbingSettings
from tissuejax.fitting import advice
from tissuejax.recordings.recording import Channel

PRECISE = replace(QUICK, precision="float64")
HAS_SHAPE_OF_ITS_OWN = {"gravity"}  # solves for another reference shape: equal to rounding, not to the last bit


def every_effect(*names):
    every = (suited(n, "probing") for n in effects("probing") if not names or n in names)
    return [e for e in every if e.parameters]  # the others only widen the discrepancy of a diagnosis


@pytest.fixture(scope="module")
def base() -> ProbingPredictor:
    return predictor(model(), sample(), settings=QUICK)


@pytest.fixture(scope="module")
def plain(base):
    return base.predict(VALUES)["r1"]


def test_a_press_is_felt_as_it_should(plain):
    force, time = plain.channels["force"].values, plain.channels["force"].time
    assert np.abs(force[time < 0.25]).max() < 1e-4  # nothing before touch
    assert force[:, 2].min() > -1e-3  # no pull without adhesion
    deep = force[(time > 1.0) & (time < 1.6), 2]
    assert 0.05 < deep.mean() < 0.5
    assert deep.std() < 0.03 * deep.mean()  # an elastic body holds its force
    assert np.abs(force[time > 2.3]).max() < 2e-3
    markers = plain.channels["markers"].values
    assert np.abs(markers[:2] - MARKERS).max() < 1e-5  # rest where they were measured
    assert 1e-5 < np.abs(markers[20] - MARKERS).max() < 1e-3


def test_effects_at_neutral_leave_the_scene_as_it_is(base):
    setup = base.setups["r1"]
    plain, _ = assembled(model(), VALUES, setup)
    for effect in every_effect():
        if effect.name in HAS_SHAPE_OF_ITS_OWN:
            continue
        one = model(effect)
        values = one.defaults | VALUES | {f"effects.{effect.name}.{k}": v for k, v in effect.neutral.items()}
        scene, _ = assembled(one, values, setup)
        for part in ("body.points", "probe.time", "probe.position", "probe.mass", "probe.shape.radius"):
            a, b = scene, plain
            for key in part.split("."):
                a, b = getattr(a, key), getattr(b, key)
            assert np.array_equal(a, b), (effect.name, part)
        assert np.array_equal(scene.stiffness, plain.stiffness), effect.name
        shown = {"force": Channel(np.arange(4.0), np.random.default_rng(0).normal(size=(4, 3)), "N")}
        shown["markers"] = Channel(np.arange(4.0), np.asarray(setup.test.rest) + np.zeros((4, 1, 1)), "m")
        p = {k: np.asarray(v) for k, v in effect.neutral.items()}
        for name, channel in effect.channels(p, setup.test, shown).items():
            assert np.array_equal(channel.values, shown[name].values), effect.name
            assert np.array_equal(channel.time, shown[name].time), effect.name


@pytest.mark.slow
def test_all_effects_at_neutral_reproduce_the_prediction(base, plain):
    chosen = [e for e in every_effect() if e.name not in HAS_SHAPE_OF_ITS_OWN]
    nested = base.with_model(model(*chosen))
    out = nested.predict(nested.model.defaults | VALUES)["r1"]
    for name, channel in plain.channels.items():
        size = np.abs(np.asarray(channel.values)).max()
        assert np.abs(out.channels[name].values - channel.values).max() < 2e-5 * size, name


ACTING = {  # where derivatives are asked for; no effect is at its neutral value
    "friction": {"coefficient": 0.2},
    "viscoelasticity": {"g1": 0.2},
    "support-motion": {"sin.r1": 3e-4},
    "inclusion": {"contrast": 0.5},
    # a sampled path has corners, and a step that falls on one has one-sided derivatives only (8 % apart at no delay)
    "contact-offset": {"delay": 1.3e-3},
    "registration": {"turn": 0.1},
    "clock-lag": {"lag": 0.02},
    "force-drift": {},
}


@pytest.mark.parametrize(
    "names",
    [("viscoelasticity", "contact-offset", "registration"), pytest.param(tuple(ACTING), marks=pytest.mark.slow)],
    ids=["memory, contact and sensors", "contact with friction, support and an inclusion as well"],
)
def test_derivatives_equal_difference_quotients(names):
    """Along one direction through base and effects at once, in float64."""
    p = predictor(model(*every_effect(*names)), sample(), settings=PRECISE)
    values = p.model.defaults | VALUES
    values |= {f"effects.{name}.{k}": v for name in names for k, v in ACTING[name].items()}
    bare = p.model.across(())
    from tissuejax.experiments.homogeneous import local

    known = local(p.model, values, "r1")
    theta = _vector(known)
    scale = np.array([bare.declared[path].typical for path in known])
    direction = np.random.default_rng(1).normal(size=len(theta)) * scale
    h = 1e-6

    def run(x):
        return programs.run(_linearised, bare, x, p.setups["r1"], direction[None])

    _, slopes = run(theta)
    (up, _), (down, _) = run(theta + h * direction), run(theta - h * direction)
    for name in ("force", "markers"):
        quotient = (np.asarray(up.channels[name]) - np.asarray(down.channels[name])) / (2 * h)
        error = np.linalg.norm(quotient - np.asarray(slopes[name][0])) / np.linalg.norm(quotient)
        assert error < 1e-4, (name, error)  # friction has kinks of its own


@pytest.mark.slow
def test_half_the_compression_tells_the_error_of_the_compression():
    """Force at 8 times life against 4 times, times 4/3, is the error of 8 times (against once), within a third."""
    force = {}
    for f in (8.0, 4.0, 1.0):
        out = predictor(model(), sample(), settings=replace(PRECISE, compression=f, interval=0.04)).predict(VALUES)
        force[f] = np.asarray(out["r1"].channels["force"].values)
    told, true = 4 / 3 * (force[8.0] - force[4.0]), force[8.0] - force[1.0]
    assert np.linalg.norm(told) == pytest.approx(np.linalg.norm(true), rel=1 / 3)
    assert np.linalg.norm(told - true) < 0.5 * np.linalg.norm(true)


def test_an_effect_of_another_kind_of_experiment_is_refused_with_those_that_act():
    with pytest.raises(InputError, match="drift does nothing in probings; what can act there: .*force-drift"):
        predictor(model(suited("drift", "homogeneous")), sample(), settings=QUICK)


def test_jacobian_has_a_column_for_each_path_and_zero_where_it_does_not_act(monkeypatch):
    """The bookkeeping of columns, recordings and programs, with a stand-in for the simulation."""
    two = sample(recording("a"), recording("b", place=(-0.004, 0.004)))
    p = predictor(model(suited("force-drift", "probing", separate=True)), two, settings=QUICK)
    sizes = []

    def stand_in(jobs, processes):
        out = []
        for _, _, _, setup, basis in jobs:
            sizes.append(len(basis))
            shapes = {"force": (len(setup.force_times), 3), "markers": (len(setup.marker_times), 3, 3)}
            run = Simulated({c: np.zeros(n) for c, n in shapes.items()}, -1, -1, 0.0, 0.0, 0.0)
            slopes = {c: np.stack([np.full(n, np.flatnonzero(row)[0]) for row in basis]) for c, n in shapes.items()}
            out.append((run, slopes))
        return out

    monkeypatch.setattr(workers, "run_all", stand_in)
    axes = [f"effects.force-drift.{what}_{c}" for what in ("offset", "rate") for c in "xyz"]
    paths = [f"{axis}.a" for axis in axes] + ["energy.C10", "effects.force-drift.offset_z.b"]
    _, slopes = p.jacobian(VALUES, paths)
    assert max(sizes) <= QUICK.tangents
    assert sum(sizes) == 7 + 2
    place = list(p.model.declared)
    for path in paths:
        generic = path.removesuffix(".a").removesuffix(".b")
        for name in "ab":
            acts = not path.endswith(f".{'b' if name == 'a' else 'a'}")
            assert np.all(slopes[path][name]["force"] == (place.index(generic) if acts else 0)), (path, name)


def test_it_is_a_pure_function_inside_other_transformations(base, plain):
    out = jax.eval_shape(lambda k: base.predict({**VALUES, "volumetric.K": k})["r1"].channels["force"].values, 1e4)
    assert out.shape == plain.channels["force"].values.shape


def test_a_broken_run_is_refused_not_masked(base):
    with pytest.raises(UnstableSimulation, match=r"recording r1: the simulation broke down by t = .* element \d+ near"):
        base.predict({**VALUES, "energy.C20": -6e4})


def test_rest_positions_are_pooled_only_if_recordings_agree(rng):
    rest = rng.normal(size=(4, 3))
    calm = {n: np.arange(20) < 10 for n in "ab"}
    still = {n: rest + rng.normal(0, 1e-3, (20, 4, 3)) for n in "ab"}
    found = rest_positions(still, calm, 1e-3)
    assert np.array_equal(found["a"], found["b"])
    assert np.abs(found["a"] - rest).max() < 4e-3 / np.sqrt(20)
    moved = {"a": still["a"], "b": still["b"] + [0, 0, 0.01]}
    found = rest_positions(moved, calm, 1e-3)
    assert np.allclose(found["b"][:, 2] - found["a"][:, 2], 0.01, atol=2e-3)
    with pytest.raises(InputError, match="every marker is NaN"):
        rest_positions({"a": np.full((5, 2, 3), np.nan)}, {"a": np.ones(5, bool)}, 1e-3)


def shifted(r, **inputs):
    return replace_inputs(r, **{k.replace("_", "/"): v for k, v in inputs.items()})


def replace_inputs(r, **inputs):
    from tissuejax.recordings.recording import Recording

    return Recording(r.name, r.experiment, {**r.inputs, **inputs}, r.channels, r.attributes)


def bad_samples():
    r = recording()
    path, time = r.inputs["probe/position"], r.inputs["probe/time"]
    yield sample(shifted(r, probe_position=path - [0, 0, 0.006])), "starts .* mm inside the tissue"
    yield sample(shifted(r, probe_position=path + [0, 0, 0.02])), "never touches the tissue"
    yield sample(shifted(r, probe_time=time + 100)), "time bases don't overlap"
    yield sample(recording(), geometry=None), "needs the body"
    far = recording()
    far.channels["markers"].values[...] += [0, 0, 0.02]
    yield sample(far), r"markers lie off the surface; marker \d at"
    lost = recording()
    lost.channels["markers"].values[...] = np.nan
    yield sample(lost), "every marker is NaN"
    import equinox as eqx

    yield sample(geometry=eqx.tree_at(lambda g: g.points, BODY, BODY.points * 1e3)), "millimetres"
    yield sample(geometry=eqx.tree_at(lambda g: g.fixed, BODY, BODY.fixed[:1])), "floats"


@pytest.mark.parametrize(("bad", "says"), list(bad_samples()), ids=lambda v: v[:24] if isinstance(v, str) else "")
def test_bad_rigs_are_refused_with_a_sentence(bad, says):
    with pytest.raises(InputError, match=says):
        predictor(model(), bad, settings=QUICK)


def test_missing_radius_and_bad_settings():
    r = recording()
    del r.attributes["probe/radius"]
    with pytest.raises(InputError, match="no probe/radius"):
        predictor(model(), sample(r), settings=QUICK)
    with pytest.raises(InputError, match="compresion.*compression"):
        predictor(model(), sample(), compresion=3)
    with pytest.raises(InputError, match="must be positive"):
        ProbingSettings(step=0.0)


def test_a_prediction_tells_how_its_simulation_went(plain):
    """Shares of the hourglass control, of penetration and of inertia, all small in this quiet probing, and how far the
    corner of any element is from folding."""
    checks = {k.removeprefix("numerics/"): v for k, v in plain.attributes.items() if k.startswith("numerics/")}
    assert set(checks) == {"hourglass", "penetration", "inertia", "corner"}
    assert 0 < checks["corner"] < 1
    assert 0 < checks["penetration"] < 0.05
    assert 0 < checks["inertia"] < 0.05
    assert checks["hourglass"] > 0


def test_numerical_checks_above_five_per_cent_are_warnings():
    told = SimpleNamespace(numerics={"r1": {"hourglass": 0.08, "penetration": 0.01}, "r2": {"hourglass": 0.03}})
    assert soundness.sentences(told.numerics) == [
        "In the simulation of r1 8% of the strain energy is that of the hourglass control: take a finer mesh."
    ]
    (folded,) = soundness.sentences({"r1": {"corner": 0.2}, "r2": {"corner": -0.1}})
    assert folded.startswith("In the simulation of r2 elements are folded")
    assert advice.numerics_sentence(told).startswith("Simulations at worst: hourglass 8.00%, penetration 1.00%")
    assert advice.numerics_sentence(SimpleNamespace(numerics={})) == ""

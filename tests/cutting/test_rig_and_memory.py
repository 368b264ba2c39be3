"""A rig that gives way and tissue that relaxes, in a cut: by the balance of energies and in a simulated slice."""

import jax.numpy as jnp
import numpy as np
import pytest

from tests.cutting.records import TRUTH, VALUES, model, record, sample, strokes
from tests.cutting.slabs import cut
from tissuejax.effects.catalogue import effect
from tissuejax.experiments.cutting_layers import ages, layer, relaxed
from tissuejax.experiments.cutting_record import path_of
from tissuejax.experiments.cutting_run import CuttingSettings
from tissuejax.experiments.predictor import predictor
from tissuejax.tled.simulate import run

COMPLIANCE = "effects.machine-compliance.compliance"
KNOWN = {k: v for k, v in TRUTH.items() if "friction" not in k}
SHARE, TIME_OF = "effects.viscoelasticity.g1", "effects.viscoelasticity.tau1"


def force(p, values):
    return np.asarray(p.predict(values)["r"].channels["cutting_force"].values)


def test_a_rig_that_gives_way_leaves_the_edge_behind():
    """F(x) = stiff F(x - C F): the stiff record read where the edge really stands."""
    time, x = strokes(-0.002, 0.02, rate=200.0)
    p = predictor(model(effect("machine-compliance")), sample(record("r", time, x, 0 * x + 0.1)))
    stiff, soft = force(p, VALUES), force(p, VALUES | {COMPLIANCE: 5e-3})
    assert soft[-1] == pytest.approx(stiff[-1], rel=1e-4)
    np.testing.assert_allclose(soft, np.interp(x - 5e-3 * soft, x, stiff), atol=2e-3 * stiff.max())
    at_two = np.argmax(x > 0.001)
    assert soft[at_two] < 0.95 * stiff[at_two]


def test_ages_of_a_stroke_with_a_rest():
    """2 mm/s to 10 mm, 5 s of rest, back to 5 mm."""
    time, x = strokes(-0.002, 0.010, rate=50.0)
    time, x = np.append(time, time[-1] + 5 + np.arange(126) / 50), np.append(x, np.linspace(0.010, 0.005, 126))
    path = path_of(record("r", time, x, 0 * x), sample(record("r", time, x, 0 * x)).geometry)
    found = ages(path)
    there, places = np.argmin(np.abs(x - 0.008)), (np.arange(24) + 0.5) / 24
    np.testing.assert_allclose(found[there], (0.008 - 0.008 * places) / 2e-3, atol=1e-6)
    back = len(x) - 1
    np.testing.assert_allclose(found[back], (0.010 - 0.005 * places) / 2e-3 + 5 + 2.5, atol=1e-6)


@pytest.mark.parametrize(("tau", "kept"), [(1e6, 1.0), (1e-6, 0.7)])
def test_layers_relax_from_the_instantaneous_to_the_long_term_state(tau, kept):
    time, x = strokes(-0.002, 0.02, 0.01)
    path = path_of(record("r", time, x, 0 * x), sample(record("r", time, x, 0 * x)).geometry)
    made = layer(model(), VALUES, path.half, path.thickness)
    energy, pressure = relaxed(made, ([0.3], [tau]), path)
    inside = (path.x > 1e-3) & (np.abs(path.speed) > 1e-3)
    for found, whole, own in zip((energy, pressure), made[:2], made.isochoric, strict=True):
        np.testing.assert_allclose(np.asarray(found)[inside], float(whole - (1 - kept) * own), rtol=1e-3)


def test_what_a_linear_layer_pays_between_the_two_is_the_hereditary_integral():
    """A pressure that grows evenly over T while g of it relaxes with tau, integrated step by step."""
    time, x = strokes(-0.002, 0.02)
    path = path_of(record("r", time, x, 0 * x), sample(record("r", time, x, 0 * x)).geometry)
    made, g, tau = layer(model(), VALUES, path.half, path.thickness), 0.4, 0.5
    T = 0.5 * path.thickness / np.tan(0.5 * path.angle) / 2e-3
    t = np.linspace(0, T, 20001)
    p = (1 - g) * t + g * tau * -np.expm1(-t / tau)  # over the slope of the elastic pressure
    share = np.trapezoid(p, t) / (T**2 / 2)
    energy, _ = relaxed(made, ([g], [tau]), path)
    middle = len(x) // 2
    assert float(energy[middle]) == pytest.approx(float(made.energy - (1 - share) * made.isochoric[0]), rel=1e-6)


@pytest.fixture(scope="module")
def slice_():
    time, x = strokes(-0.001, 0.010, rate=40.0)
    made = sample(record("r", time, x, 0 * x + 0.1, thickness=2e-3), length=0.02, half=0.005)
    m = model(effect("machine-compliance"), effect("viscoelasticity", terms=1))
    return predictor(m, made, by="simulation", settings=CuttingSettings(h=1e-3), start=KNOWN), x


@pytest.mark.slow
def test_a_simulated_blade_stands_behind_and_its_work_is_its_own(slice_):
    """Means over an element, as ripples come at other times where the blade is elsewhere."""
    p, x = slice_
    stiff, soft = p.run(KNOWN)["r"], p.run(KNOWN | {COMPLIANCE: 5e-3})["r"]
    assert float(soft.imbalance) < 0.005
    stiff, soft = np.asarray(stiff.force), np.asarray(soft.force)
    mean = lambda f: np.convolve(f, np.ones(20) / 20, "valid")  # noqa: E731  1 mm at 2 mm/s and 40 Hz
    late = x > 1e-3
    expected = np.interp(x - 5e-3 * soft, x, stiff)
    top = stiff.max()
    assert np.abs(mean(soft[late]) - mean(expected[late])).max() < 0.03 * top
    assert np.abs(mean(soft[late]) - mean(stiff[late])).max() > 0.02 * top


@pytest.mark.parametrize("compliance", [0.02, 0.04])
def test_a_soft_rig_leaves_no_work_unaccounted(slice_, compliance):
    """20 mm/N: on a slice of a tenth of the depth the blade's contact is 40 times as stiff as the rig."""
    p, _ = slice_
    assert float(p.run(KNOWN | {COMPLIANCE: compliance})["r"].imbalance) < 0.005


@pytest.mark.parametrize("friction", [pytest.param(None, marks=pytest.mark.slow), 0.1])
def test_what_a_rig_puts_in_and_the_blade_does_not_give_is_in_its_spring(friction):
    """Work at the driven end less work of the tip is C F^2 / 2, and what the rig's answer takes by lagging: it follows
    the force by a step of the run, like a dashpot. The tip stands C F behind."""
    C, frames = 0.4, 480
    scene = cut(h=1e-3, travel=0.012, frames=frames, strength=3000.0, friction=friction)
    out = run(scene.put({"probe.compliance": C * jnp.array([1.0, 0.0, 0.0])}))
    felt = float(-out.state.felt[0, 0])
    driven = 0.012 / frames * float(-np.asarray(out.force)[:, 0].sum())
    spring = 0.5 * C * felt**2
    assert C * felt > 5e-4  # half a millimetre behind
    taken = driven - float(out.work[-1]) - spring
    assert 0 < taken < 0.01 * float(out.work[-1])
    work = np.asarray(out.balance.work)
    assert np.abs(np.asarray(out.balance.error))[work > 0.05 * work[-1]].max() < 0.005
    assert felt == pytest.approx(float(-out.force[-1, 0]), rel=0.05)


def test_relaxing_tissue_asks_less_of_a_simulated_blade(slice_):
    """Between the elastic force and that of the long-term moduli; a time far beyond the cut changes nothing."""
    p, x = slice_
    late = x > 6e-3
    elastic, slow, middle = (
        float(np.asarray(p.run(KNOWN | more)["r"].force)[late].mean())
        for more in ({}, {SHARE: 0.5, TIME_OF: 1e5}, {SHARE: 0.5, TIME_OF: 0.3})
    )
    assert slow == pytest.approx(elastic, rel=2e-3)
    assert middle < 0.995 * elastic

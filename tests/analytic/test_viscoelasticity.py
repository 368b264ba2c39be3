"""Histories against independent numpy: fine quadrature of the convolution, a stiff ODE solver, damage by a loop."""

from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import erf

from tests.specimens import BASE, VALUES, ramp, recording, stresses
from tissuejax.effects.catalogue import effect
from tissuejax.effects.history import fading, running_peak
from tissuejax.experiments.predictor import predictor
from tissuejax.recordings.recording import Sample

G, TAU = (0.25, 0.15), (0.4, 6.0)
VISCOUS = {f"effects.viscoelasticity.{k}{i}": v for k, vs in (("g", G), ("tau", TAU)) for i, v in enumerate(vs, 1)}


def drive(t):
    return 1 + ramp(t, (0, 0), (2, 0.3), (7, 0.3), (9, -0.2), (12, 0.1), (15, 0.1))


def elastic(l):
    """Isochoric PK2 (11, 33), the tensor 2 dpsi/dC without projection, energy, and C33 of the base energy, by hand."""
    C10, C20 = VALUES.values()
    x = l**2 + 2 / l - 3
    s = 2 * (C10 + 2 * C20 * x)
    return s * (1 - (x + 3) / (3 * l**2)), s * (1 - (x + 3) * l / 3), s, C10 * x + C20 * x * x, 1 / l


def reported(l, S11, S33):
    """Nominal stress with the pressure from the free face: l (S11 - S33 C33 / C11)."""
    return l * S11 - S33 / l**2


def predicted(e, values, time):
    sample = Sample("s", {"r": recording("r", "uniaxial", time, drive(time))})
    return stresses(predictor(BASE.with_effects(e), sample).predict(VALUES | values))["r"]


def relaxed(s, t, tau, first=0.0):
    """Midpoint quadrature of the fading memory on a fine grid."""
    h = np.zeros_like(s)
    h[0] = first * s[0]
    decay = np.exp(-np.diff(t) / tau)
    for k, d in enumerate(decay):
        h[k + 1] = d * h[k] + np.sqrt(d) * (s[k + 1] - s[k])
    return h


@pytest.mark.parametrize("moduli", [False, True])
def test_prony_series_against_fine_quadrature(moduli):
    time = np.linspace(0, 15, 451)
    fine = np.linspace(0, 15, 450 * 40 + 1)
    l = drive(fine)
    S11, S33, s, _, _ = elastic(l)
    if moduli:
        s = s - sum(g * (s - relaxed(s, fine, tau, 1.0)) for g, tau in zip(G, TAU))
        expected = s * (l - l**-2)
    else:
        S11, S33 = (q - sum(g * (q - relaxed(q, fine, tau)) for g, tau in zip(G, TAU)) for q in (S11, S33))
        expected = reported(l, S11, S33)
    found = predicted(effect("viscoelasticity", terms=2, moduli=moduli), VISCOUS, time)
    # Ours is exact for stress that is linear between samples; that it curves costs (dt)^2.
    np.testing.assert_allclose(found, expected[::40], atol=2e-4 * np.abs(expected).max())


def test_relaxation_of_the_nominal_stress_against_fine_quadrature():
    time, fine = np.linspace(0, 15, 451), np.linspace(0, 15, 450 * 40 + 1)
    l = drive(fine)
    S11, S33, *_ = elastic(l)
    P = reported(l, S11, S33)
    expected = P - sum(g * (P - relaxed(P, fine, tau)) for g, tau in zip(G, TAU))
    found = predicted(effect("viscoelasticity", terms=2), VISCOUS | {"effects.viscoelasticity.nominal": 1.0}, time)
    np.testing.assert_allclose(found, expected[::40], atol=2e-4 * np.abs(expected).max())


def test_both_directions_of_a_biaxial_test_relax_alike():
    """The nominal stress in each of two equal directions relaxes as in an equibiaxial test."""
    time = np.linspace(0, 15, 151)
    l = 1 + ramp(time, (0, 0), (2, 0.2), (15, 0.2))
    both = recording("b", "biaxial", time, np.stack([l, l], -1))
    sample = Sample("s", {"b": both, "e": recording("e", "equibiaxial", time, l)})
    values = VALUES | VISCOUS | {"effects.viscoelasticity.nominal": 1.0}
    found = stresses(predictor(BASE.with_effects(effect("viscoelasticity", terms=2)), sample).predict(values))
    np.testing.assert_allclose(found["b"], np.stack([found["e"], found["e"]], -1), rtol=1e-9, atol=1e-9)
    assert found["e"][-1] < 0.8 * found["e"].max()


def test_fading_is_exact_for_a_ramp_and_converges_from_below():
    """Ramp a t: h = a tau (1 - exp(-t/tau)), whatever the sampling."""
    t = jnp.sort(jnp.concatenate([jnp.zeros(1), jnp.asarray(np.random.default_rng(3).uniform(0, 9, 100))]))
    for tau in (1e-3, 0.3, 1e4):
        h = fading(t, 5.0 * t[:, None], tau)[:, 0]
        np.testing.assert_allclose(h, -5.0 * tau * np.expm1(-np.asarray(t) / tau), rtol=1e-8, atol=1e-12)


def test_repeated_times_add_nothing():
    t = jnp.array([0.0, 1.0, 2.0, 2.0, 2.0])
    h = fading(t, jnp.array([0.0, 1.0, 3.0, 3.0, 3.0])[:, None], 0.7)[:, 0]
    assert (h[2:] == h[2]).all()


def test_instantaneous_and_long_term():
    """A fast step shows the instantaneous moduli, a long hold (1 - sum g) of them."""
    time = np.array([0.0, 1e-6, *np.linspace(1, 500, 40)])
    sample = Sample("s", {"r": recording("r", "planar", time, np.where(time > 0, 1.2, 1.0))})
    e = effect("viscoelasticity", terms=2)
    base = stresses(predictor(BASE, sample).predict(VALUES))["r"]
    relaxing = stresses(predictor(BASE.with_effects(e), sample).predict(VALUES | VISCOUS))["r"]
    assert relaxing[1] == pytest.approx(base[1], rel=1e-5)
    share = e.long_term({f"g{i}": g for i, g in enumerate(G, 1)})
    assert relaxing[-1] == pytest.approx(share * base[-1], rel=1e-9)


def test_nonlinear_viscosity_against_a_stiff_solver():
    g, tau, stress, m = 0.4, 3.0, 150.0, 3.0
    time = np.linspace(0, 15, 451)

    def flow(t, z):
        S11, S33, *_ = elastic(drive(t))
        load = np.array([S11, S33]) - z
        size = (load[0] ** 2 + 2 * load[1] ** 2) / stress**2
        return load / tau * (1 + size) ** ((m - 1) / 2)

    exact = solve_ivp(flow, (0, 15), np.zeros(2), "LSODA", time, rtol=1e-9, atol=1e-7, max_step=0.05).y
    l = drive(time)
    S11, S33, *_ = elastic(l)
    values = {f"effects.nonlinear-viscosity.{k}": v for k, v in dict(g=g, tau=tau, stress=stress, exponent=m).items()}
    found = predicted(effect("nonlinear-viscosity"), values, time)
    expected = reported(l, S11 - g * exact[0], S33 - g * exact[1])
    np.testing.assert_allclose(found, expected, atol=5e-4 * np.abs(expected).max())


@pytest.mark.parametrize(("tau", "m"), [(3.0, 3.0), (0.3, 6.0)])
def test_nonlinear_viscosity_takes_the_corners_of_its_load(tau, m):
    """Stress linear between samples, which turns at each: integrated from one to the next by another solver."""
    g, stress = 0.4, 150.0
    time = np.linspace(0, 15, 151)
    l = drive(time)
    S11, S33, *_ = elastic(l)
    S = np.stack([S11, S33], 1)
    flowed = [S[0]]
    for k, (a, b) in enumerate(pairwise(time)):

        def flow(t, z, k=k, a=a, b=b):
            load = S[k] + (S[k + 1] - S[k]) * (t - a) / (b - a) - z
            return load / tau * (1 + (load[0] ** 2 + 2 * load[1] ** 2) / stress**2) ** ((m - 1) / 2)

        flowed.append(solve_ivp(flow, (a, b), flowed[-1], "DOP853", rtol=1e-11, atol=1e-9).y[:, -1])
    z11, z33 = np.transpose(flowed)
    values = {f"effects.nonlinear-viscosity.{k}": v for k, v in dict(g=g, tau=tau, stress=stress, exponent=m).items()}
    found = predicted(effect("nonlinear-viscosity"), values, time)
    expected = reported(l, S11 - g * z11, S33 - g * z33)
    np.testing.assert_allclose(found, expected, atol=2e-9 * np.abs(expected).max())


@pytest.mark.slow
def test_nonlinear_viscosity_is_differentiated_in_both_modes():
    """A plain prediction runs another loop than one that is differentiated: the same values, and their slopes."""
    time = np.linspace(0, 15, 16)
    at = jnp.array([0.4, 3.0, 150.0, 3.0])
    model = BASE.with_effects(effect("nonlinear-viscosity"))
    predict = predictor(model, Sample("s", {"r": recording("r", "uniaxial", time, drive(time))})).predict

    def total(x):
        moved = dict(zip(("g", "tau", "stress", "exponent"), x, strict=True))
        found = predict(VALUES | {f"effects.nonlinear-viscosity.{k}": v for k, v in moved.items()})
        return jnp.sum(jnp.sin(found["r"].channels["nominal_stress"].values / 100))

    value, forward = jax.jvp(total, (at,), (at,))
    assert float(value) == pytest.approx(float(total(at)), rel=1e-12)
    backward = np.asarray(jax.grad(total)(at))
    assert float(forward) == pytest.approx(backward @ np.asarray(at), rel=1e-9)
    for k in range(len(at)):
        h = jnp.zeros(4).at[k].set(1e-3 * at[k])
        assert backward[k] == pytest.approx(float((total(at + h) - total(at - h)) / (2 * h[k])), rel=1e-5)


@pytest.mark.parametrize("law", ["erf", "tanh"])
def test_softening_against_a_loop(law):
    r, m, beta = 0.4, 15.0, 0.1
    time = np.linspace(0, 15, 301)
    l = drive(time)
    S11, S33, _, W, _ = elastic(l)
    peak, eta = 0.0, []
    for w in W:
        peak = max(peak, w)
        eta.append(1 - r * (erf if law == "erf" else np.tanh)((peak - w) / (m + beta * peak)))
    values = {f"effects.softening.{k}": v for k, v in dict(r=r, m=m, beta=beta).items()}
    found = predicted(effect("softening", law=law), values, time)
    np.testing.assert_allclose(found, np.array(eta) * reported(l, S11, S33), rtol=1e-9, atol=1e-9)


def test_permanent_set_leaves_compression_after_tension():
    time = np.linspace(0, 15, 301)
    found = predicted(effect("permanent-set"), {"effects.permanent-set.amount": 0.1}, time)
    back = np.argmin(np.abs(drive(time) - 1) + 10.0 * ((time < 7) | (time > 9)))  # before any compression
    x = drive(time)[back] - 0.1 * 0.3
    S11, S33, *_ = elastic(x)
    assert found[back] == pytest.approx(reported(x, S11, S33), rel=1e-9)
    assert found[back] < 0


def test_running_peak():
    s = jnp.array([0.0, 2.0, 1.0, 2.0, 3.0, -1.0])
    np.testing.assert_array_equal(running_peak(s), [0, 2, 2, 2, 3, 3])
    np.testing.assert_array_equal(running_peak(jnp.stack([s, -s], -1))[:, 1], [0, 0, 0, 0, 0, 1])

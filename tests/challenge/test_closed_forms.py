"""The generator's closed forms against algebra done by hand and against differences of its own energies."""

import numpy as np
import pytest
from scipy.optimize import minimize

from tissuejax.challenge.material import Ingredient, Specimen, modulus, reported
from tissuejax.challenge.memory_laws import drained, prony, softening
from tissuejax.challenge.rig_laws import platen_factor, rig_strain, slack, through_spring
from tissuejax.challenge.specimen import Trial
from tissuejax.challenge.strain_laws import Body

C10, C20 = 450.0, 520.0


def trial(kind: str, drive: np.ndarray, direction=(1.0, 0.0, 0.0), seconds: float = 10.0) -> Trial:
    time = np.linspace(0, seconds, len(drive))
    return Trial("r1", kind, time, drive, np.array(direction), 0.0, 5e-4, 0.025, 0.0254)


def test_reduced_polynomial_in_all_tests():
    l = np.linspace(0.7, 1.4, 29)
    x = l**2 + 2 / l - 3
    w = C10 + 2 * C20 * x
    body = Specimen(Body({"10": C10, "20": C20}))
    np.testing.assert_allclose(reported(body, trial("uniaxial", l)), 2 * w * (l - l**-2), atol=1e-9)
    planar = 2 * (C10 + 2 * C20 * (l**2 + l**-2 - 2)) * (l - l**-3)
    np.testing.assert_allclose(reported(body, trial("planar", l)), planar, atol=1e-9)
    equibiaxial = 2 * (C10 + 2 * C20 * (2 * l**2 + l**-4 - 3)) * (l - l**-5)
    np.testing.assert_allclose(reported(body, trial("equibiaxial", l)), equibiaxial, atol=1e-9)
    g = np.linspace(-0.5, 0.5, 11)
    np.testing.assert_allclose(reported(body, trial("simple-shear", g)), 2 * (C10 + 2 * C20 * g**2) * g, atol=1e-9)


def test_mooney_ogden_and_modulus():
    l = np.linspace(0.7, 1.4, 15)
    mooney = Specimen(Body({"10": 300.0, "01": 120.0}))
    np.testing.assert_allclose(reported(mooney, trial("uniaxial", l)), 2 * (300 + 120 / l) * (l - l**-2), atol=1e-9)
    assert modulus(mooney.body) == pytest.approx(840.0, rel=1e-6)
    alpha = 7.0
    ogden = Specimen(Body({}, (("ogden", {"mu": [500.0], "alpha": [alpha]}),)))
    exact = 2 * 500 / alpha * (l ** (alpha - 1) - l ** (-alpha / 2 - 1))
    np.testing.assert_allclose(reported(ogden, trial("uniaxial", l)), exact, atol=1e-8)
    assert modulus(ogden.body) == pytest.approx(500.0, rel=1e-4)


@pytest.mark.parametrize(
    "extra",
    [
        ("exponential", {"a": 300.0, "b": 3.0}),
        ("locking", {"mu": 300.0, "limit": 4.0}),
        ("fibres", {"k": 500.0, "shape": 2.0, "kind": "exponential", "along": [[0.6, 0.8, 0.0]]}),
        ("fibres", {"k": 500.0, "shape": 2.0, "kind": "stretch", "along": [[0.6, 0.8, 0.0]]}),
        ("ogden", {"mu": [200.0], "alpha": [-6.0]}),
    ],
)
def test_stress_is_the_derivative_of_the_energy(extra, rng):
    law = Body({"10": 100.0, "01": 50.0, "11": 20.0}, (extra,)).law(np.eye(3))
    F = np.eye(3) + 0.15 * rng.standard_normal((3, 3))
    C = F.T @ F
    _, S = law(C[None])
    h = 1e-6
    for i in range(3):
        for j in range(i, 3):
            d = np.zeros((3, 3))
            d[i, j] += h / 2
            d[j, i] += h / 2
            slope = (law((C + d)[None])[0][0] - law((C - d)[None])[0][0]) / (2 * h)
            assert 2 * slope == pytest.approx(S[0, i, j], rel=1e-5, abs=1e-3)


def test_compressible_specimen_free_faces():
    """Small strain: Young's modulus 9 K mu / (3 K + mu), and planar 4 mu (3 K + mu) / (3 K + 4 mu)."""
    K, mu = 3000.0, 900.0
    body = Specimen(Body({"10": mu / 2}, bulk=K))
    l = 1 + np.array([-1e-5, 1e-5])
    slope = np.diff(reported(body, trial("uniaxial", l)))[0] / 2e-5
    assert slope == pytest.approx(9 * K * mu / (3 * K + mu), rel=1e-4)
    slope = np.diff(reported(body, trial("planar", l)))[0] / 2e-5
    assert slope == pytest.approx(4 * mu * (3 * K + mu) / (3 * K + 4 * mu), rel=1e-4)


def test_fibres_pull_only_along_themselves():
    l = np.linspace(1, 1.3, 7)
    strong = ("fibres", {"k": 2000.0, "shape": 1.0, "kind": "quadratic", "along": [[1.0, 0, 0]]})
    bare, with_fibres = Specimen(Body({"10": C10})), Specimen(Body({"10": C10}, (strong,)))
    extra = reported(with_fibres, trial("uniaxial", l)) - reported(bare, trial("uniaxial", l))
    np.testing.assert_allclose(extra, 2 * 2000 * (l**2 - 1) * l, atol=1e-6)  # 2 l dpsi/dI4
    across = trial("uniaxial", 2 - l, direction=(1.0, 0, 0))
    np.testing.assert_allclose(reported(with_fibres, across), reported(bare, across), atol=1e-9)


def test_relaxation_of_a_held_jump_and_of_a_ramp():
    t = np.linspace(0, 10, 1001)
    ramp = np.minimum(t, 2.0)
    g, tau = 0.4, 1.5
    exact = (1 - g) * ramp + g * np.where(
        t < 2, tau * -np.expm1(-t / tau), tau * -np.expm1(-2 / tau) * np.exp(-(t - 2) / tau)
    )
    np.testing.assert_allclose(prony(t, ramp, [g], [tau]), exact, atol=1e-12)
    tensors = np.stack([ramp, 2 * ramp], -1)
    np.testing.assert_allclose(prony(t, tensors, [g], [tau])[:, 1], 2 * exact, atol=1e-12)


def test_softening_spares_the_first_loading():
    W = np.array([0.0, 10.0, 20.0, 10.0, 0.0, 30.0])
    factor = softening(W, W, "tanh", 0.5, 8.0)
    np.testing.assert_allclose(factor[[0, 1, 2, 5]], 1.0)
    np.testing.assert_allclose(factor[3], 1 - 0.5 * np.tanh(10 / 8))
    assert softening(W, W, "discontinuous", 0.5, 8.0)[2] == pytest.approx(1 - 0.5 * (1 - np.exp(-20 / 8)))


def test_slow_drainage_settles_at_the_linear_answer():
    t = np.linspace(0, 100, 4001)
    y = drained(t, np.full(len(t), 30.0), bulk=3000.0, tau=3.0)
    assert y[-1] == pytest.approx(-0.01, rel=1e-9)
    assert y[np.searchsorted(t, 3.0)] == pytest.approx(-0.01 * (1 - np.exp(-1)), rel=1e-6)


def test_a_drained_specimen_with_fibres_narrows_as_its_least_energy_asks():
    """Held for long it is one of K/2 (ln J)^2; both lateral stretches by scipy, from the energy written here."""
    mu, k, amount, angle = 600.0, 900.0, 0.3, 0.5
    K = (mu + k * np.sin(2 * angle) ** 2) / amount  # what a small shear feels of the fibres is in the modulus
    fibre = Ingredient("anisotropy", "quadratic", k / mu, {"shape": 1.0, "along": [[np.cos(angle), np.sin(angle), 0]]})
    leak = Ingredient("compressibility", "drained", amount, {"tau": 1.0})
    l = np.minimum(np.linspace(1.0, 1.6, 201), 1.3)
    found = reported(Specimen(Body({"10": mu / 2}), (fibre, leak)), trial("uniaxial", l, seconds=100.0))[-1]

    def psi(l1, sides):
        l2, l3 = np.exp(sides)
        J = l1 * l2 * l3
        thin = J ** (-2 / 3)
        e = thin * ((np.cos(angle) * l1) ** 2 + (np.sin(angle) * l2) ** 2) - 1
        iso = mu / 2 * (thin * (l1**2 + l2**2 + l3**2) - 3) + k / 2 * max(e, 0.0) ** 2
        return iso + K / 2 * np.log(J) ** 2

    h = 1e-4
    low, high = (minimize(lambda s, l1=1.3 + d: psi(l1, s), [-0.1, -0.1], tol=1e-12).fun for d in (-h, h))
    assert found == pytest.approx((high - low) / (2 * h), rel=1e-4)


def test_rig_in_series_balances():
    l = 1 + 0.3 * np.sin(np.linspace(0, 3, 200))
    bare = Specimen(Body({"10": C10, "20": C20}))
    test = trial("uniaxial", l)

    def respond(x):
        return reported(bare, trial("uniaxial", x))

    def give(P):
        return rig_strain(P, "linear", 0.01, test.area, test.height, 1.0)

    x, P = through_spring(l, respond, give)
    np.testing.assert_allclose(x + give(respond(x)), l, atol=1e-8)
    soft = Specimen(bare.body, (Ingredient("machine-compliance", "linear", 0.01, {"knee": 1.0}),))
    np.testing.assert_allclose(reported(soft, test), P, atol=1e-6)


@pytest.mark.parametrize("kind", ["sharp", "smooth", "toe"])
def test_slack_lags_by_the_gap(kind):
    x = np.array([-1.0, 0.0, 1.0])
    np.testing.assert_allclose(slack(x, kind, 0.02), [-0.98, 0, 0.98], atol=3e-4)


def test_platens_press_harder_only_when_pushed():
    np.testing.assert_allclose(platen_factor(np.array([1.2]), "slab", 0.3, 0.0254, 0.025), 1.0)
    small = platen_factor(np.array([0.8]), "slab", 1e-4, 0.0254, 0.025)
    np.testing.assert_allclose(small, platen_factor(np.array([0.8]), "mean", 1e-4, 0.0254, 0.025), rtol=1e-8)

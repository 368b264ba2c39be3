"""Stresses against formulas derived by hand, for incompressible uniaxial, planar and equibiaxial stretch.

Derivation: with W(l) the energy along the path and free faces without stress, the nominal stress is dW/dl (uniaxial,
planar) or dW/dl / 2 (equibiaxial, two faces). For energies in invariants this is
P = 2 (l - 1/l^2) (W1 + W2/l), 2 (l - 1/l^3) (W1 + W2), 2 (l - 1/l^5) (W1 + W2 l^2); here the program's PK2 stress is
used instead: P = F (S - p C^-1) with p from the free face 3.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.energies import catalogue, stress
from tissuejax.energies.paths import SECOND, along

quick = functools.partial(jax.jit, compiler_options={"xla_backend_optimization_level": "0"})  # compiled for one use
STRETCH = np.array([0.7, 0.9, 1.0, 1.0 + 1e-6, 1.3, 1.7])


def nominal(energy, p, path, l=STRETCH):
    """P11 with face 3 free, from PK2."""
    C = along(path, jnp.asarray(l)).C
    S = quick(lambda p, C: stress.pk2_isochoric(energy, p, C))(p, C)
    pressure = S.zz * C.zz
    return np.asarray(l * (S.xx - pressure / C.xx))


def by_invariants(W1, W2, path, l=STRETCH):
    """P11 from dW/dI1 and dW/dI2, functions of (I1, I2)."""
    second = np.asarray(SECOND[path](l))
    third = 1 / (l * second)
    I1 = l**2 + second**2 + third**2
    I2 = l**-2.0 + second**-2 + third**-2
    shape = {
        "uniaxial": (l - l**-2.0, 1 / l),
        "planar": (l - l**-3.0, np.ones_like(l)),
        "equibiaxial": (l - l**-5.0, l**2),
    }
    factor, weight = shape[path]
    return 2 * factor * (W1(I1, I2) + W2(I1, I2) * weight)


def none(I1, I2):
    return 0.0 * I1


CASES = {
    "neo-hookean": ({"mu": 800.0}, lambda I1, I2: 400.0 + 0 * I1, none),
    "mooney-rivlin": ({"C10": 300.0, "C01": 70.0}, lambda I1, I2: 300.0 + 0 * I1, lambda I1, I2: 70.0 + 0 * I1),
    "reduced-polynomial-3": (
        {"C10": 300.0, "C20": -40.0, "C30": 9.0},
        lambda I1, I2: 300 - 80 * (I1 - 3) + 27 * (I1 - 3) ** 2,
        none,
    ),
    "polynomial-2": (
        {"C10": 300.0, "C01": 50.0, "C20": 7.0, "C11": -11.0, "C02": 13.0},
        lambda I1, I2: 300 + 14 * (I1 - 3) - 11 * (I2 - 3),
        lambda I1, I2: 50 - 11 * (I1 - 3) + 26 * (I2 - 3),
    ),
    "gent": ({"mu": 800.0, "Jm": 9.0}, lambda I1, I2: 400 * 9 / (9 - I1 + 3), none),
    "demiray": ({"mu": 800.0, "b": 1.7}, lambda I1, I2: 400 * np.exp(1.7 * (I1 - 3)), none),
    "humphrey": ({"C1": 200.0, "C2": 1.7}, lambda I1, I2: 340 * np.exp(1.7 * (I1 - 3)), none),
    "veronda-westmann": (
        {"C1": 200.0, "C2": 1.7},
        lambda I1, I2: 340 * np.exp(1.7 * (I1 - 3)),
        lambda I1, I2: -170 + 0 * I1,
    ),
    "arruda-boyce": (
        {"mu": 800.0, "lambda_m": 2.0},
        lambda I1, I2: 800 * (1 / 2 + I1 / 40 + 11 * I1**2 / 5600 + 19 * I1**3 / 112000 + 519 * I1**4 / (134750 * 256)),
        none,
    ),
}


@pytest.mark.parametrize("path", SECOND)
@pytest.mark.parametrize("name", CASES)
def test_energies_in_invariants(name, path):
    p, W1, W2 = CASES[name]
    want = by_invariants(W1, W2, path)
    np.testing.assert_allclose(nominal(catalogue.energy(name), p, path), want, rtol=1e-9, atol=1e-6 * 800e-6)


def ogden_uniaxial(factor, alpha, l=STRETCH):
    """sum f a (l^(a-1) - l^(-a/2-1)), without cancellation near l = 1."""
    return factor * alpha * l ** (-alpha / 2 - 1) * np.expm1(1.5 * alpha * np.log(l))


def total(alpha, l=STRETCH):
    return l**alpha + 2 * l ** (-alpha / 2) - 3


def test_ogden_uniaxial_and_at_a_strain_of_one_millionth():
    energy = catalogue.energy("ogden-2", "mu/alpha")
    p = {"mu1": 630.0, "alpha1": 1.3, "mu2": -10.0, "alpha2": -2.0}
    want = ogden_uniaxial(630 / 1.3, 1.3) + ogden_uniaxial(5.0, -2.0)
    np.testing.assert_allclose(nominal(energy, p, "uniaxial"), want, rtol=1e-8, atol=1e-10)


def test_log_and_exp_ogden_uniaxial():
    p = {"C1": 60.0, "C2": 0.632, "alpha": -2.544}
    l = STRETCH
    inner = ogden_uniaxial(1.0, p["alpha"], l) * p["C1"] * p["C2"]
    want = inner / (1 - p["C2"] * total(p["alpha"], l))
    np.testing.assert_allclose(nominal(catalogue.energy("log-ogden"), p, "uniaxial"), want, rtol=1e-8, atol=1e-10)
    want = inner * np.exp(p["C2"] * total(p["alpha"], l))
    np.testing.assert_allclose(nominal(catalogue.energy("exp-ogden"), p, "uniaxial"), want, rtol=1e-8, atol=1e-10)


def test_ogden_with_exponents_two_and_minus_two_is_mooney_rivlin():
    # sum l^2 = I1bar and sum l^-2 = I2bar: stress and tangent agree, through all equal stretches.
    cases = (
        (catalogue.energy("ogden-2", "c/m^2"), {"mu1": 4 * 300.0, "alpha1": 2.0, "mu2": 4 * 70.0, "alpha2": -2.0}),
        (catalogue.energy("mooney-rivlin"), {"C10": 300.0, "C01": 70.0}),
    )
    C = jax.tree.map(lambda *c: jnp.concatenate(c), *(along(path, jnp.asarray(STRETCH)).C for path in SECOND))
    both = [
        quick(lambda p, C, e=e: (jnp.stack(stress.pk2_isochoric(e, p, C)), stress.tangent(e, None, p, None, C)))(p, C)
        for e, p in cases
    ]
    for one, other in zip(*both):
        np.testing.assert_allclose(one, other, atol=1e-12 * float(jnp.max(jnp.abs(other))))


def test_aligned_fibres_uniaxial():
    # kappa = 0, fibre along the pull: E = l^2 - 1 adds dW/dl = 2 k1 E exp(k2 E^2) l in tension, nothing in compression
    # (laterally the section stays square, so this is the work along the path, not a free-face solution).
    energy = catalogue.energy("neo-hookean+fibre")
    p = {"mu": 0.0, "k1": 500.0, "k2": 0.8, "kappa": 0.0, "angle": 0.0}
    l = np.array([0.8, 1.0, 1.1, 1.4])
    E = np.maximum(l**2 - 1, 0)
    np.testing.assert_allclose(nominal(energy, p, "uniaxial", l), 2 * 500 * l * E * np.exp(0.8 * E**2), rtol=1e-10)


def test_fibres_switch_on_with_continuous_stress_and_tangent():
    energy = catalogue.energy("neo-hookean+fibre")
    p = {"mu": 0.0, "k1": 500.0, "k2": 0.8, "kappa": 0.0, "angle": 0.0}
    step = 1e-7
    for l in (1.0, np.sqrt(1.001)):  # onset, and the end of the cubic
        C = along("uniaxial", jnp.array([l - step, l + step])).C
        D = np.asarray(quick(lambda p, C: stress.tangent(energy, None, p, None, C))(p, C))
        assert np.abs(D[1] - D[0]).max() < 1e-3 * 2000  # 4 k1 = 2000 Pa is its size when on


def test_compressible_stress_adds_the_pressure():
    # Pure volume change F = j I: sigma = U'(J) I and no isochoric part.
    j = 1.07
    F = j * jnp.eye(3)
    J = j**3
    for name, p, slope in (
        ("quadratic", {"K": 5e4}, 5e4 * (J - 1)),
        ("logarithmic", {"K": 5e4}, 5e4 * np.log(J) / J),
        ("compressibility-2", {"D1": 1e-4, "D2": 1e-3}, 2 * (J - 1) / 1e-4 + 4 * (J - 1) ** 3 / 1e-3),
    ):
        sigma = stress.cauchy(
            catalogue.energy("yeoh"), catalogue.volumetric(name), {f"C{i}0": 1e3 for i in (1, 2, 3)}, p, F
        )
        np.testing.assert_allclose(sigma, slope * np.eye(3), rtol=1e-10, atol=1e-8)


def test_simple_shear_is_cauchy_stress_mu_gamma():
    # Neo-Hookean, F = I + g e1 e2^T: sigma12 = mu g; and P = F S is not symmetric while sigma is.
    g = 0.3
    F = jnp.eye(3).at[0, 1].set(g)
    args = catalogue.energy("neo-hookean"), catalogue.volumetric("quadratic"), {"mu": 700.0}, {"K": 1e5}
    sigma, P = stress.cauchy(*args, F), stress.pk1(*args, F)
    assert sigma[0, 1] == pytest.approx(700 * g)
    np.testing.assert_allclose(sigma, sigma.T, atol=1e-10)
    np.testing.assert_allclose(P, sigma @ jnp.linalg.inv(F).T, atol=1e-9)

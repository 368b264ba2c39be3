"""Lateral faces of specimens with fibres where fibres begin or cease to bear load, against root finds by scipy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

from tests.specimens import recording
from tissuejax.effects.anisotropy import Anisotropy
from tissuejax.energies.catalogue import energy
from tissuejax.experiments.catalogue import experiment
from tissuejax.experiments.homogeneous import local, nominal_stress
from tissuejax.model import Model

MU, K1, K2 = 900.0, 1500.0, 0.02
SAMPLES = 751


def expected(stretch: np.ndarray, families: tuple[float, ...], onset: float, k1: float) -> np.ndarray:
    """Nominal stress dpsi/dl1 at the lateral stretch of least energy; half of the fibres in each of two families."""

    def slopes(a: float, b: float) -> tuple[float, float]:
        one, two = MU * (a - a**-3 * b**-2), MU * (b - b**-3 * a**-2)
        for t in families:
            x, y = np.cos(t) ** 2, np.sin(t) ** 2
            e = max(x * a * a + y * b * b - 1 - onset, 0.0)
            pull = 2 * k1 / len(families) * e * np.exp(K2 * e * e)
            one, two = one + pull * x * a, two + pull * y * b
        return one, two

    out = []
    for a in stretch:
        b = brentq(lambda b, a=a: slopes(a, b)[1], 0.3, 3.0, xtol=1e-15, rtol=1e-15)
        out.append(slopes(a, b)[0])
    return np.array(out)


def told(families: tuple[float, ...], onset: float, stretch: np.ndarray):
    """Model, values and test of such fibres."""
    two = len(families) == 2
    model = Model(energy("neo-hookean"), None, (Anisotropy(families=len(families), crimped=True),))
    values = {
        "energy.mu": MU,
        "effects.anisotropy.k1": K1,
        "effects.anisotropy.k2": K2,
        "effects.anisotropy.angle": float(np.mean(families)),
        "effects.anisotropy.onset": onset,
    }
    if two:
        values["effects.anisotropy.spread"] = abs(families[1] - families[0]) / 2
    pull = recording("r", "uniaxial", np.linspace(0.0, 1.0, len(stretch)), stretch)
    return model, local(model, values, "r"), experiment("uniaxial").test(pull)


CASES = [((1.93, 2.96), 0.0), ((0.4,), 0.0), ((1.2,), 0.0), ((2.44,), 0.05), ((1.35, 2.2), 0.0)]


@pytest.mark.parametrize(("families", "onset"), CASES)
def test_pushed_and_pulled_through_the_kink(families, onset):
    """Every sample of a push and a pull is found, also those beside the stretch at which fibres go slack."""
    stretch = np.linspace(0.79, 1.4, SAMPLES)
    found = np.asarray(jax.jit(nominal_stress, static_argnums=0)(*told(families, onset, stretch)))
    np.testing.assert_allclose(found, expected(stretch, families, onset, K1), rtol=1e-6, atol=1e-5 * MU)


def test_the_derivative_is_that_of_the_implicit_function():
    """By the stiffness of the fibres, forward and backward, against differences of the root finds."""
    families, stretch = (1.93, 2.96), np.array([0.8, 0.93, 1.13, 1.37])
    model, values, test = told(families, 0.0, stretch)

    def stress(k1):
        return nominal_stress(model, values | {"effects.anisotropy.k1": k1}, test)

    h = 0.5
    by_hand = (expected(stretch, families, 0.0, K1 + h) - expected(stretch, families, 0.0, K1 - h)) / (2 * h)
    forward, backward = (jax.jit(by(stress))(jnp.asarray(K1)) for by in (jax.jacfwd, jax.jacrev))
    np.testing.assert_allclose(forward, by_hand, rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(backward, forward, rtol=1e-9, atol=1e-12)

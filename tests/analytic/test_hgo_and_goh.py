"""Holzapfel-Gasser-Ogden and its dispersed form against stresses derived by hand."""

import numpy as np
import pytest

from tests.specimens import recording
from tissuejax.energies import catalogue
from tissuejax.experiments.predictor import predictor
from tissuejax.model import Model
from tissuejax.recordings.recording import Sample

TIME = np.linspace(0.0, 1.0, 9)


def biaxial(name, p, along, across):
    model = Model(catalogue.energy(name))
    drive = np.stack([along, across], -1)
    sample = Sample("s", {"b": recording("b", "biaxial", TIME, drive)})
    found = predictor(model, sample).predict({f"energy.{n}": v for n, v in p.items()})
    return np.asarray(found["b"].channels["nominal_stress"].values)


@pytest.mark.parametrize("kappa", [0.0, 0.15])
def test_biaxial_stress_by_hand(kappa):
    # sigma_i = mu (l_i^2 - l_3^2) + 2 sum k1 E exp(k2 E^2) (kappa (l_i^2 - l_3^2) + (1 - 3 kappa) a_i^2 l_i^2)
    p = {"mu": 2000.0, "k1": 800.0, "k2": 2.5, "spread": 0.7, "angle": 0.0}
    a, b = 1 + 0.25 * TIME[1:], 1 + 0.12 * TIME[1:]
    full = p | ({"kappa": kappa} if kappa else {})
    found = biaxial("goh" if kappa else "hgo", full, np.r_[1.0, a], np.r_[1.0, b])[1:]
    c = 1 / (a * b)
    cos, sin = np.cos(0.7) ** 2, np.sin(0.7) ** 2
    E = kappa * (a**2 + b**2 + c**2 - 3) + (1 - 3 * kappa) * (cos * a**2 + sin * b**2 - 1)
    assert (E > 1e-3).all()  # beyond the onset, where the formula is exact
    load = 4 * p["k1"] * E * np.exp(p["k2"] * E**2)  # two families alike
    for column, (l, weight) in enumerate(((a, cos), (b, sin))):
        sigma = (p["mu"] + load * kappa) * (l**2 - c**2) + load * (1 - 3 * kappa) * weight * l**2
        np.testing.assert_allclose(found[:, column], sigma / l, rtol=1e-9)


def test_compressed_fibres_carry_nothing():
    p = {"mu": 2000.0, "k1": 8e5, "k2": 2.5, "spread": 0.2, "angle": 0.0}
    a = 1 - 0.2 * TIME
    found = biaxial("hgo", p, a, a**-0.5)
    np.testing.assert_allclose(found[:, 0], 2000.0 * (a - a**-2), rtol=1e-9, atol=1e-9)


def test_long_names_are_read():
    assert catalogue.energy("holzapfel-gasser-ogden").name == "hgo"
    assert catalogue.energy("gasser-ogden-holzapfel").name == "goh"

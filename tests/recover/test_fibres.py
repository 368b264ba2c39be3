"""Fibres that a descent left without stiffness are found again."""

import numpy as np
import pytest

import tissuejax as tj
from tissuejax.experiments.predictor import predictor
from tissuejax.fitting.idle import woken_modulus
from tissuejax.fitting.setup import problem
from tissuejax.recordings.recording import Channel, Recording, Sample

MU, K1, K2 = 3000.0, 1500.0, 8.0


def stretched():
    """Two families that both lie along the pull: P = mu (l - l^-2) + 4 k1 l (l^2 - 1) exp(k2 (l^2 - 1)^2).

    Holzapfel, Gasser and Ogden 2000, J. Elast. 61:1, eq. 63 for fibres along the axis of a uniaxial test.
    """
    time = np.linspace(0, 20, 120)
    stretch = np.linspace(1, 1.3, 120)
    e = stretch**2 - 1
    stress = MU * (stretch - stretch**-2) + 4 * K1 * stretch * e * np.exp(K2 * e**2)
    stress += np.random.default_rng(5).normal(0, 10, 120)
    channel = Channel(time, stress, "Pa", 10.0)
    return Sample(
        "fibres", {"r": Recording("r", "uniaxial", {"time": time, "stretch": stretch}, {"nominal_stress": channel}, {})}
    )


ALONG = {"energy.spread": 0.0, "energy.angle": 0.0}


@pytest.mark.slow
def test_idle_fibres_are_woken_at_a_shape_that_promises_something():
    posed = problem(predictor(tj.material("hgo"), stretched(), ("r",)), tj.Unknowns(fix=ALONG))
    at = posed.start | {"energy.mu": MU, "energy.k1": 0.0}
    woken = woken_modulus(posed, at)
    assert woken["energy.k1"] > 0
    assert woken["energy.k2"] != at["energy.k2"]
    before, after = (posed.residuals(v) for v in (at, woken))
    assert after @ after < 0.7 * before @ before
    assert woken_modulus(posed, at | {"energy.k1": 100.0}) is None  # not idle


def test_a_fit_finds_them():
    found = tj.fit(stretched(), "hgo", unknowns=tj.Unknowns(fix=ALONG))
    assert found.chi2_per_dof < 1.5
    for path, truth in (("energy.mu", MU), ("energy.k1", K1), ("energy.k2", K2)):
        assert found.values[path] == pytest.approx(truth, abs=4 * found.std[path])

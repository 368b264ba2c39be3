"""The noise is told from a mismatch: its correlation is found although the prediction is wrong."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from tissuejax.diagnosis import noise
from tissuejax.diagnosis.noise import Noise, estimate, portmanteau
from tissuejax.diagnosis.quality import Quality


def correlated(rng, n, rho):
    """First-order autoregressive noise of unit variance."""
    return lfilter([np.sqrt(1 - rho**2)], [1, -rho], rng.normal(size=n + 500))[500:]


RAMP = np.interp(np.linspace(0, 25, 626), [0, 1, 8, 16, 23, 25], [0, 0, 1, 1, 0, 0])


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("mismatch", [0.0, 30.0])
def test_correlation_is_found_beside_a_mismatch_thirty_times_the_noise(rng, rho, mismatch):
    wrong = mismatch * (RAMP**2 - 0.5 * RAMP + 0.3 * np.sin(3 * RAMP))
    found = estimate([(correlated(rng, 626, rho) + (1 + 0.2 * i) * wrong)[:, None] for i in range(3)])
    assert found.share * found.rho == pytest.approx(rho, abs=0.12)


def test_white_and_correlated_parts_are_told_apart(rng):
    series = [(np.sqrt(0.5) * (correlated(rng, 1500, 0.9) + rng.normal(size=1500)))[:, None] for _ in range(3)]
    found = estimate(series)
    assert found.share == pytest.approx(0.5, abs=0.1)
    assert found.rho == pytest.approx(0.9, abs=0.05)


def test_whitened_noise_is_white_and_of_unit_variance(rng):
    noise = Noise(0.8, 0.9)
    mixed = [np.sqrt(0.8) * correlated(rng, 1300, 0.9) + np.sqrt(0.2) * rng.normal(size=1300) for _ in range(4)]
    white = [noise.whiten(x) for x in mixed]
    assert np.var(np.concatenate(white)) == pytest.approx(1.0, abs=0.06)
    assert abs(portmanteau(white)) < 3.0
    assert portmanteau(mixed) > 20.0


def test_portmanteau_is_standard_normal_on_white_noise(rng):
    z = [portmanteau([rng.normal(size=400) for _ in range(3)]) for _ in range(200)]
    assert np.mean(z) == pytest.approx(0.0, abs=0.25)
    assert np.std(z) == pytest.approx(1.0, abs=0.15)


def test_inflation_is_the_variance_of_a_mean(rng):
    means = [np.mean(correlated(rng, 2000, 0.8)) for _ in range(400)]
    assert 2000 * np.var(means) == pytest.approx(Noise(1.0, 0.8).inflation, rel=0.25)


def test_series_too_short_to_tell_are_taken_as_white():
    assert estimate([np.ones((10, 1))]) == Noise()


def test_an_optimiser_that_runs_away_is_no_numerical_trouble(monkeypatch):
    """Where the likelihood is flat its logits drift to thousands; exp of that overflows."""
    runs = iter([0.0, -100.0, -90.0, -80.0])
    far = lambda cost, start, **_: SimpleNamespace(x=np.full(len(start), -1e4), fun=next(runs))  # noqa: E731
    monkeypatch.setattr(noise, "minimize", far)
    found = estimate([np.zeros((300, 1))])
    assert (found.share, found.rho) == (0.0, 0.0)


def test_a_misfit_far_within_the_stated_noise_may_be_smooth():
    """The spread between specimens bounds a misfit; its correlation is not known."""
    within = Quality(fitted=0.1, held=0.6, z_fitted=-5.0, z_held=-1.0, z_correlation=9.0)
    assert within.noise
    assert not replace(within, fitted=0.9, z_fitted=-0.5).noise, "as large as the noise and smooth is not noise"
    assert not replace(within, z_held=4.0).noise, "what is held out has to be met too"

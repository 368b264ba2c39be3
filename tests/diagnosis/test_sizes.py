"""A base model starts at the size of the recordings, however stiff what it is declared for."""

import numpy as np
import pytest

from tissuejax.diagnosis.material import MaterialBench
from tissuejax.diagnosis.misfit import white
from tissuejax.diagnosis.refit import refit
from tissuejax.energies.catalogue import energy
from tissuejax.recordings.recording import Channel, Recording, Sample


def bench(law: str, stress: np.ndarray, l: np.ndarray, noise: float) -> MaterialBench:
    """One recording against stretch."""
    time = np.arange(float(len(l)))
    channel = Channel(time, stress, "Pa", noise)
    r = Recording("r", "uniaxial", {"time": time, "stretch": l}, {"nominal_stress": channel}, {})
    return MaterialBench.of(Sample("s", {"r": r}), energy(law), ("r",), (), {"r": noise}, ["energy-form"])


def test_a_base_that_is_a_thousand_times_too_soft_is_brought_to_size():
    """Rubber with Gent's law: from 1 kPa a descent stops at the limiting stretch."""
    l = np.linspace(0.6, 3.0, 60)
    stress = 4e5 * (l - l**-2) / (1 - (l**2 + 2 / l - 3) / 15.0)
    on = bench("gent", stress, l, 1e3)
    found = refit(on, white(on), (), {}, iterations=60)
    assert found.values["energy.mu"] == pytest.approx(4e5, rel=1e-3)
    assert found.values["energy.Jm"] == pytest.approx(15.0, rel=1e-3)


@pytest.mark.parametrize("mu", [0.7, 700.0, 7e7])
def test_a_base_starts_where_its_common_factor_fits(mu):
    l = np.linspace(0.8, 1.3, 60)
    on = bench("neo-hookean", mu * (l - l**-2), l, 0.005 * mu)
    assert on.start["energy.mu"] == pytest.approx(mu)
    assert on.free["energy.mu"].scale == pytest.approx(0.05 * np.quantile(np.abs(mu * (l - l**-2)), 0.98))

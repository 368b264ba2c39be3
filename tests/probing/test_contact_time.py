"""First touch is found in drawn voltages and in Hertz-like forces with noise."""

import numpy as np
import pytest

from tissuejax.errors import InputError
from tissuejax.experiments.contact_time import from_force, from_voltage

T = np.linspace(0, 10, 2001)


@pytest.mark.parametrize("sign", [1, -1])
def test_voltage(rng, sign):
    v = sign * 5.0 * ((T > 3.21) & (T < 8)) + rng.normal(0, 0.05, T.size)
    v[100] = sign * 9  # a spike is not a contact
    assert from_voltage(T, v) == pytest.approx(3.21, abs=0.01)


def test_voltage_without_contact(rng):
    with pytest.raises(InputError, match="no contact in it"):
        from_voltage(T, 5 + rng.normal(0, 0.05, T.size))


def test_force_is_extrapolated_to_first_touch(rng):
    z = 0.03 - 0.00125 * T
    depth = np.clip(0.00125 * (T - 3.0), 0, None)
    F = np.zeros((T.size, 3))
    F[:, 2] = 60 * depth**1.5 + 0.0
    F += rng.normal(0, 2e-6, F.shape)
    late = T[(F[:, 2] > 0.01 * F[:, 2].max()).argmax()]
    found = from_force(T, F, np.stack([0 * z, 0 * z, z], 1))
    assert found == pytest.approx(3.0, abs=0.02)
    assert late > 3.2  # the threshold alone is late


def test_force_without_contact(rng):
    with pytest.raises(InputError, match="no contact can be found"):
        from_force(T, rng.normal(0, 0.003, (T.size, 3)), np.zeros((T.size, 3)), 0.003)

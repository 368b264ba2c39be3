"""Two families of fibres alike: by hand for simple stretches, and as the mean of two single ones."""

import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.effects.anisotropy import Anisotropy
from tissuejax.energies.strain import Strain
from tissuejax.tensors import Sym

FIBRES = {"k1": 300.0, "k2": 1.5, "angle": 0.4, "elevation": 0.2, "compression": 0.0}


def strain(a: float, b: float, shear: float = 0.0) -> Strain:
    """C of stretches a, b along x and y at constant volume, with a shear."""
    numbers = (a * a, b * b + shear**2, (a * b) ** -2, a * shear, 0.0, 0.0)
    return Strain.of(Sym(*(jnp.asarray(v) for v in numbers)))


def test_no_spread_is_one_family():
    here = strain(1.2, 0.95, 0.1)
    two = Anisotropy(families=2).energy(FIBRES | {"spread": 0.0}, here)
    assert float(two) == float(Anisotropy().energy(FIBRES, here))


def test_a_spread_is_the_mean_of_two_families():
    fibres, here = Anisotropy(), strain(1.2, 0.95, 0.1)
    each = [float(fibres.energy(FIBRES | {"angle": 0.4 + s}, here)) for s in (0.5, -0.5)]
    assert each[0] != pytest.approx(each[1], rel=0.1)
    assert float(Anisotropy(families=2).energy(FIBRES | {"spread": 0.5}, here)) == pytest.approx(
        np.mean(each), rel=1e-12
    )


def test_families_alike_about_the_loaded_axis_by_hand():
    """Stretch 1.3 along x, angle 0, spread 0.6: I4 = cos^2 1.3^2 + sin^2/1.3 for both."""
    p = {"k1": 200.0, "k2": 2.0, "angle": 0.0, "elevation": 0.0, "compression": 0.0, "spread": 0.6}
    E = np.cos(0.6) ** 2 * 1.69 + np.sin(0.6) ** 2 / 1.3 - 1
    expected = 200.0 / 4.0 * (np.exp(2 * E**2) - 1)
    assert float(Anisotropy(families=2).energy(p, strain(1.3, 1.3**-0.5))) == pytest.approx(expected, rel=1e-6)


def test_crimped_fibres_bear_nothing_until_they_are_straight():
    """Stretch 1.3 along the fibres: E = 1.69 - 1 - 0.25; at 1.1 (0.21 < 0.25) nothing; without crimp as before."""
    fibres = Anisotropy(crimped=True)
    p = {"k1": 200.0, "k2": 2.0, "angle": 0.0, "elevation": 0.0, "compression": 0.0, "onset": 0.25}
    expected = 200.0 / 4.0 * (np.exp(2 * 0.44**2) - 1)
    assert float(fibres.energy(p, strain(1.3, 1.3**-0.5))) == pytest.approx(expected, rel=1e-6)
    assert float(fibres.energy(p, strain(1.1, 1.1**-0.5))) == 0.0
    here = strain(1.2, 0.95, 0.1)
    assert float(fibres.energy(FIBRES | {"onset": 0.0}, here)) == float(Anisotropy().energy(FIBRES, here))

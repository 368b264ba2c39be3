"""The foundation model that makes sealed cuts: its own grid must not be in its records."""

import numpy as np
import pytest

from tissuejax.challenge.cutting_foundation import Knife, Slab, draw

SLAB, TOUGH = Slab(0.012, 0.0115, 2500.0, 30000.0, 0.5), 20.0
PLACES = np.concatenate([[-0.003, 0.005], np.arange(0.005, 0.0065, 1.37e-5)])


def cut(thickness, part=2.6, **grid):
    """Force per depth behind the entry."""
    strength = part * TOUGH / thickness
    knife = Knife(thickness, np.tan(np.radians(14)), 80 * strength / thickness)
    made = draw(SLAB, knife, PLACES, lambda x: np.full_like(x, TOUGH), lambda x: np.full_like(x, strength), **grid)
    return made.force[60:]


def test_the_grid_does_not_show_beside_the_noise():
    """The thinnest blade and strongest tissue that are drawn: ripple under a third of the least noise (0.5 %)."""
    force = cut(3.5e-4)
    assert force.std() < 0.33 * 0.005 * force.mean()
    assert cut(3.5e-4, spacing=2e-4).std() > 0.05 * force.mean(), "the check sees a grid where there is one"


def test_steady_force_is_toughness_plus_the_squeezed_layers():
    """By virtual work: G + 2 (k v^2/2 + k c v^3 / 3 W), v half the thickness (penetration below a per cent), less what
    an exponential law has not lost at an opening of one thickness, G (1 + r) exp(-r), r = b e tau / G."""
    force = cut(6e-4, part=2.3)
    k, half, r = SLAB.wave / SLAB.half, 3e-4, 2.3 * np.e
    layers = k * half**2 + 2 * k * SLAB.hardening * half**3 / (3 * SLAB.half)
    assert force.mean() == pytest.approx(TOUGH * (1 - (1 + r) * np.exp(-r)) + layers, rel=0.003)

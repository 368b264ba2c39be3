"""The foundation model that makes sealed cuts: its own grid must not be in its records."""

import numpy as np
import pytest

from tissuejax.challenge import cutting_cases
from tissuejax.challenge.cutting_foundation import Knife, Slab, draw
from tissuejax.challenge.grade import summary
from tissuejax.challenge.verdicts import mark

SLAB, TOUGH = Slab(0.012, 0.0115, 2500.0, 30000.0, 0.5), 20.0
PLACES = np.concatenate([[-0.003, 0.005], np.arange(0.005, 0.0065, 1.37e-5)])


def cut(thickness, part=2.6, **grid):
    """Force per depth behind the entry."""
    strength = part * TOUGH / thickness
    knife = Knife(thickness, np.tan(np.radians(14)), 80 * strength / thickness)
    made = draw(SLAB, knife, PLACES, lambda x: np.full_like(x, TOUGH), lambda x: np.full_like(x, strength), **grid)
    return made[60:]


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


def test_friction_turns_what_presses_on_bevel_and_flat():
    """Steady, by hand: normal forces N on bevels of slope t do the work across, so force (E) (1 + m/t) / (1 - m t), E
    toughness and layers; and 2 m p on each length of flat, p what holds the layer squeezed."""
    m, strength = 0.1, 12 * TOUGH / (np.e * 6e-4)  # faces that hold nothing any more at the flats
    knife = Knife(6e-4, np.tan(np.radians(14)), 80 * strength / 6e-4)
    places = np.concatenate([[-0.003, 0.005], np.arange(0.005, 0.009, 5e-5)])
    same = dict(toughness=lambda x: np.full_like(x, TOUGH), strength=lambda x: np.full_like(x, strength))
    plain, rubbed = (draw(SLAB, knife, places, friction=q, **same)[10:] for q in (0.0, m))
    squeezed = SLAB.wave * 3e-4 / SLAB.half * (1 + SLAB.hardening * 3e-4 / SLAB.half)
    slope, base = np.polyfit(places[10:], rubbed, 1)
    assert slope == pytest.approx(2 * m * squeezed, rel=0.05)
    behind = 3e-4 / knife.slope  # where the flats begin
    turned = plain.mean() * (1 + m / knife.slope) / (1 - m * knife.slope)
    assert base + slope * behind == pytest.approx(turned, rel=0.01)


@pytest.mark.parametrize(("index", "category", "effects"), [(0, "none", []), (1, "one", ["blade-friction"])])
def test_a_sealed_cut_has_a_key_that_is_graded(index, category, effects, monkeypatch):
    """The table of rates counts the categories that it knows, and nothing else."""
    cheap = lambda slab, knife, x, *_, notch=0, friction=0: np.where(x > 0, 20.0, 0.0) * (1 + 3 * friction)  # noqa: E731
    monkeypatch.setattr(cutting_cases, "drawn", cheap)
    key = cutting_cases.draw("c", 5, index).key
    assert (key["category"], key["effects"]) == (category, effects)
    answer = {"verdict": "found" if effects else "nothing-missing", "effects": effects}
    rates = summary([mark("c", key, answer)])["rates"]
    counted = {k: r["of"] for k, r in rates.items() if r["of"]}
    assert ("single above 3 noise: right and no other" in counted) == (category == "one"), counted
    assert ("nulls: false alarm" in counted) == (category == "none"), counted

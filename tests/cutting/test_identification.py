"""What is read from a cutting record without a simulation: teeth, resolution, refusals."""

import numpy as np
import pytest

from tests.cutting.records import record, sample, strokes
from tissuejax.errors import InputError
from tissuejax.fitting.cut_resolution import resolution
from tissuejax.fitting.sawtooth import SECTIONS, Settings, mesh_period, sawtooth, sections, strengths

TIME, X = strokes(-0.002, 0.026, speed=2e-3, rate=100.0)


def toothed(period=3e-3, low=0.05, high=0.10):
    """A force that rises straight and drops at once, every `period` of the path."""
    phase = np.clip(X, 0, None) / period % 1
    return np.where(X > 0, low + (high - low) * phase, 0.0)


def test_teeth_are_found_and_a_vertical_edge_gives_force_over_blade_section():
    made = sample(record("r", TIME, X, toothed(), thickness=4e-4))
    found = sawtooth(made.recordings["r"], made.geometry, Settings(cutoff=10.0))
    assert 7 <= len(found.teeth) <= 9
    for tooth in found.teeth[1:-1]:
        assert tooth.critical[0] == pytest.approx(0.10, rel=0.06)
        for s in SECTIONS:
            normal, along = tooth.strength[s]
            assert normal == pytest.approx(tooth.critical[0] / (tooth.contact[0] * 4e-4), rel=1e-6)
            assert along == pytest.approx(0, abs=1e-6 * normal)
        assert tooth.per_area == pytest.approx(0.075 / 0.01, rel=0.1)  # mean force over depth


def test_section_length_cancels():
    """tau_n = (sin^2 th F_x/L_z + cos^2 th F_z/L_x)/b on a straight edge, whatever the sections."""
    edge = np.array([[0.0, 0.0], [0.006, 0.010]])
    F, contact, b = (0.3, 0.2), (0.010, 0.006), 4e-4
    th = np.arctan2(0.010, 0.006)
    expected = (np.sin(th) ** 2 * F[0] / contact[0] + np.cos(th) ** 2 * F[1] / contact[1]) / b
    along = abs(np.sin(th) * np.cos(th) * (F[0] / contact[0] - F[1] / contact[1])) / b
    for s in SECTIONS:
        normal, tangential = strengths(F, contact, b, sections(edge, 0.010, s))
        assert normal == pytest.approx(expected, rel=1e-6)
        assert tangential == pytest.approx(along, rel=1e-6)


def test_even_teeth_at_the_period_of_a_mesh_are_named():
    made = sample(record("r", TIME, X, toothed(), thickness=4e-4))
    found = sawtooth(made.recordings["r"], made.geometry, Settings(cutoff=10.0))
    assert "period of elements" in mesh_period(found, 3e-3)
    assert mesh_period(found, 1.1e-3) is None


def test_resolution_by_hand():
    """tau_h = sqrt(9 pi E' G / (32 n h)): 2617 Pa for G 2, n 3, h 0.5 mm, mu 1564, K 20 kPa."""
    found = resolution(4000.0, 2.0, 1564.0, 2e4, 2e-3, 5e-4, 0.02, 0.005)
    assert found.carried == pytest.approx(2617, rel=1e-3)
    assert found.separation == pytest.approx(1e-3)
    assert any("not resolved" in s for s in found.sentences)
    thin = resolution(4000.0, 2.0, 1564.0, 2e4, 5e-4, 5e-4, 0.02, 0.005)
    assert any("thinner" in s for s in thin.sentences)


def test_an_energy_in_joules_is_refused():
    with pytest.raises(InputError, match="energy in J"):
        resolution(13594.0, 1.25e-4, 1564.0, 2e4, 3.65e-4, 7e-4, 0.03, 0.01)


def test_no_teeth_is_said():
    made = sample(record("r", TIME, X, 0.1 * np.clip(X / 0.004, 0, 1)))
    with pytest.raises(InputError, match="no tooth"):
        sawtooth(made.recordings["r"], made.geometry, Settings(cutoff=5.0, prominence=0.2))

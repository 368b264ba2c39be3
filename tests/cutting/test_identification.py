"""What is read from a cutting record without a simulation: teeth, resolution, refusals."""

import math
from types import SimpleNamespace

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


def test_sections_of_a_round_edge_are_chords_of_its_circle():
    """Equal arcs but for the last: chords 2 R sin(s / 2R) across the middle angle; together what is in contact."""
    R, s, depth = 0.010, 0.8e-3, 0.005
    phi = np.linspace(0, np.pi / 3, 3000)
    edge = np.array([0.02, 0.03]) + R * np.stack([1 - np.cos(phi), np.sin(phi)], 1)
    found = sections(edge, depth, s)
    ends = np.append(np.arange(0, np.pi / 6, s / R), np.pi / 6)  # sin 30 degrees is depth / R
    chord, middle = 2 * R * np.sin(np.diff(ends) / 2), (ends[1:] + ends[:-1]) / 2
    assert len(found) == 7  # 5.24 mm of arc
    np.testing.assert_allclose(found[:, 0], chord * np.cos(middle), rtol=1e-4)
    np.testing.assert_allclose(found[:, 1], chord * np.sin(middle), rtol=1e-4, atol=1e-9)
    np.testing.assert_allclose(found[:, 2], np.pi / 2 - middle, atol=1e-4)
    (whole,) = sections(edge, 1.0, 1.0)  # deeper than the edge is high
    assert whole[:2] == pytest.approx(R * np.array([np.sin(np.pi / 3), 0.5]), rel=1e-6)


def test_even_teeth_at_the_period_of_a_mesh_are_named():
    made = sample(record("r", TIME, X, toothed(), thickness=4e-4))
    found = sawtooth(made.recordings["r"], made.geometry, Settings(cutoff=10.0))
    assert "period of elements" in mesh_period(found, 3e-3)
    assert mesh_period(found, 1.1e-3) is None


def test_a_mesh_is_named_as_far_as_its_period_goes():
    """To 15 % of an element or of half of one, where gaps scatter by a quarter at most, of four teeth on."""
    h = 2e-3

    def told(share, scatter=0.0, n=5):
        gaps = share * h * (1 + scatter * (-1.0) ** np.arange(n - 1))
        teeth = [SimpleNamespace(at=x) for x in np.cumsum([0.01, *gaps])]
        return mesh_period(SimpleNamespace(teeth=teeth), h) is not None

    assert all(told(share) for share in (0.86, 1.14, 0.43, 0.57))
    assert not any(told(share) for share in (0.84, 1.16, 0.42, 0.58))
    assert told(1.0, scatter=0.24)
    assert not told(1.0, scatter=0.26)
    assert told(1.0, n=4)
    assert not told(1.0, n=3)


@pytest.mark.parametrize("hertz", [5.0, 10.0, 20.0])
def test_a_record_is_filtered_there_and_back_at_the_cutoff_asked_for(hertz):
    """Butterworth of order 4 in bilinear form, twice: 1 / (1 + (tan(pi f / f_s) / tan(pi f_c / f_s))^8) of a ripple."""
    force, ripple = toothed(), 0.01 * np.sin(2 * math.pi * hertz * TIME)
    smooth, rippled = (
        sawtooth(made.recordings["r"], made.geometry, Settings(cutoff=10.0)).force[:, 0]
        for made in (sample(record("r", TIME, X, f)) for f in (force, force + ripple))
    )
    rate = 1 / (TIME[1] - TIME[0])
    share = 1 / (1 + (math.tan(math.pi * hertz / rate) / math.tan(math.pi * 10.0 / rate)) ** 8)
    middle = slice(len(TIME) // 4, -len(TIME) // 4)
    np.testing.assert_allclose((rippled - smooth)[middle], share * ripple[middle], atol=1e-5)


def test_a_filter_is_refused_from_half_the_sampling_rate_on():
    made = sample(record("r", TIME, X, toothed()))
    assert sawtooth(made.recordings["r"], made.geometry, Settings(cutoff=49.0)).cutoff == 49.0
    for cutoff in (0.0, 50.5):
        with pytest.raises(InputError, match=r"half the sampling rate \(50 Hz\)"):
            sawtooth(made.recordings["r"], made.geometry, Settings(cutoff=cutoff))


def test_a_filter_is_refused_where_a_record_is_no_longer_than_what_it_is_padded_with():
    """Two sections: 3 (2 2 + 1) samples to either side (scipy's `sosfiltfilt`), which needs one more."""
    for n, words in ((15, "15 samples are too few"), (16, "no tooth")):
        made = sample(record("r", TIME[:n], np.linspace(-0.002, 0.026, n), np.full(n, 0.1)))
        with pytest.raises(InputError, match=words):
            sawtooth(made.recordings["r"], made.geometry, Settings(cutoff=5.0))


def test_resolution_by_hand():
    """tau_h = sqrt(9 pi E' G / (32 n h)): 2617 Pa for G 2, n 3, h 0.5 mm, mu 1564, K 20 kPa."""
    found = resolution(4000.0, 2.0, 1564.0, 2e4, 2e-3, 5e-4, 0.02, 0.005)
    assert found.carried == pytest.approx(2617, rel=1e-3)
    assert found.separation == pytest.approx(1e-3)
    assert any("not resolved" in s for s in found.sentences)
    thin = resolution(4000.0, 2.0, 1564.0, 2e4, 5e-4, 5e-4, 0.02, 0.005)
    assert any("thinner" in s for s in thin.sentences)


@pytest.mark.parametrize(("density", "speed"), [(1000.0, 0.05), (250.0, 0.1)])
def test_the_cost_of_a_cut_by_hand(density, speed):
    """Waves of 3 m/s (6 in what is lighter) cross 0.7 h a step: 3446 steps of 0.402 s (half of both), 41 x 22 hexes."""
    mu, K, h = 3000.0, 5000.0, 5e-4
    found = resolution(4000.0, 2.0, mu, K, 2e-3, h, 0.0201, 0.0052, density, speed)
    assert found.step == pytest.approx(0.7 * h / 3.0 * (density / 1000.0) ** 0.5)
    assert (found.steps, found.elements) == (3446, 902)
    assert found.seconds == pytest.approx(3446 * 902 * 80e-9)  # 80 ns an element and step
    E, nu = 9 * K * mu / (3 * K + mu), (3 * K - 2 * mu) / (2 * (3 * K + mu))
    assert found.cohesive_length == pytest.approx(E / (1 - nu**2) * 2.0 / 4000.0**2)


def test_sentences_on_a_cut_s_resolution_begin_at_their_limits():
    """Cohesive length of three elements and of one; separation of a blade's thickness."""
    G, tau, b = 2.0, 4000.0, 2e-3
    length = resolution(tau, G, 1564.0, 2e4, b, 5e-4, 0.02, 0.005).cohesive_length

    def said(words, h=1e-5, b=b):
        return any(words in s for s in resolution(tau, G, 1564.0, 2e4, b, h, 0.02, 0.005).sentences)

    for words, h in (("not resolved", length / 3), ("not identified on this mesh", length)):
        assert said(words, h=1.01 * h)
        assert not said(words, h=0.99 * h)
    assert said("thinner", b=0.99 * 2 * G / tau)
    assert not said("thinner", b=1.01 * 2 * G / tau)


def test_an_energy_in_joules_is_refused():
    with pytest.raises(InputError, match="energy in J"):
        resolution(13594.0, 1.25e-4, 1564.0, 2e4, 3.65e-4, 7e-4, 0.03, 0.01)


def test_no_teeth_is_said():
    made = sample(record("r", TIME, X, 0.1 * np.clip(X / 0.004, 0, 1)))
    with pytest.raises(InputError, match="no tooth"):
        sawtooth(made.recordings["r"], made.geometry, Settings(cutoff=5.0, prominence=0.2))

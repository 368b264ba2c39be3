"""From rig signals to stretch and stress, against algebra: kept volumes, known filter gains, planted jumps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tissuejax.errors import InputError
from tissuejax.recordings import conversions, rig

LENGTH = st.floats(1e-3, 0.2)


@given(LENGTH, LENGTH, LENGTH)
def test_thawing_keeps_the_volume(radius, frozen, thawed):
    area = rig.thawed_area(radius, frozen, thawed)
    assert area * thawed == pytest.approx(np.pi * radius**2 * frozen, rel=1e-12)
    # The nominal stress that goes with the frozen height as reference has the frozen area below it.
    assert rig.thawed_area(radius, frozen, frozen) == pytest.approx(np.pi * radius**2, rel=1e-12)


@pytest.mark.parametrize("sizes", [(0, 1, 1), (1, -1, 1), (1, 1, 0), (1, 1, np.nan)])
def test_sizes_must_be_lengths(sizes):
    with pytest.raises(InputError, match="above zero"):
        rig.thawed_area(*sizes)


def test_settled_stretch_counts_from_the_frozen_height():
    frozen, thawed, now = 0.025, 0.022, np.array([0.022, 0.0176])
    np.testing.assert_allclose(rig.settled_stretch(now / thawed, frozen, thawed), now / frozen)


def test_compression_stretch_of_the_sources_cylinder():
    """A 25.4 mm cylinder pressed to 0.6 grows by 3.6957 mm in radius (Lister 2012, section 4.1.1.1)."""
    radius = 12.7
    assert rig.compression_stretch((radius + 3.6957) / radius) == pytest.approx(0.6, abs=1e-5)


@given(st.floats(0.2, 3.0))
def test_radial_and_axial_stretch_keep_the_volume(radial):
    assert rig.compression_stretch(radial) * radial**2 == pytest.approx(1.0)


def gain(frequency: float, cutoff: float, order: int) -> float:
    """Amplitude that a sine keeps, and check that it isn't delayed."""
    time = np.arange(0, 40, 0.01)
    wave = np.exp(2j * np.pi * frequency * time)
    passed = rig.lowpass(time, wave.real, cutoff, order) + 1j * rig.lowpass(time, wave.imag, cutoff, order)
    ratio = (passed / wave)[1500:2500].mean()
    assert abs(ratio.imag) < 1e-6
    return ratio.real


@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("cutoff", [1.0, 4.0])
def test_lowpass_gain_is_butterworths_squared(order, cutoff):
    """Two passes of |H|^2 = 1/(1 + x^2n) with x in warped frequency and corner so that the product is 1/sqrt 2."""
    for frequency in (0.0, 0.5 * cutoff, cutoff, 2 * cutoff):
        x = np.tan(np.pi * frequency / 100) / np.tan(np.pi * cutoff / 100)
        expected = 1 / (1 + (np.sqrt(2) - 1) * x ** (2 * order))
        assert gain(frequency, cutoff, order) == pytest.approx(expected, abs=2e-6)


def test_lowpass_on_uneven_times_and_columns(rng):
    time = np.sort(rng.uniform(0, 10, 800))
    slow = np.stack([np.sin(2 * np.pi * 0.2 * time), 3 + 0.5 * time], axis=1)
    passed = rig.lowpass(time, slow, 5.0)
    np.testing.assert_allclose(passed[50:-50], slow[50:-50], atol=5e-3)


@pytest.mark.parametrize(("cutoff", "n"), [(50.0, 100), (0.0, 100), (5.0, 8)])
def test_lowpass_refuses_what_it_cannot_do(cutoff, n):
    with pytest.raises(InputError, match="lowpass"):
        rig.lowpass(np.arange(n) / 100, np.ones(n), cutoff)
    with pytest.raises(InputError, match="strictly increasing"):
        rig.lowpass(np.zeros(50), np.ones(50), 5.0)


def test_polynomials_are_found_again(rng):
    x = np.linspace(0.6, 1.4, 60)
    true = np.polynomial.Polynomial([1.0, -3.0, 0.5, 2.0])
    np.testing.assert_allclose(rig.polynomial(x, true(x), 3).coef, true.coef, atol=1e-9)
    through = rig.polynomial(x, true(x) - true(1.0), 3, through=(1.0, 0.0))
    np.testing.assert_allclose(through.coef, [true.coef[0] - true(1.0), *true.coef[1:]], atol=1e-9)
    noisy = rig.polynomial(x, true(x) - true(1.0) + 0.1 * rng.standard_normal(60), 3, through=(1.0, 0.0))
    assert abs(noisy(1.0)) < 1e-12
    with pytest.raises(InputError, match="3 distinct x; expected at least 4"):
        rig.polynomial(np.array([0, 1, 2.0]), np.zeros(3), 3)


@pytest.mark.parametrize(("low", "high"), [(0.1, 4.8), (4.8, 0.1)])
@given(jump=st.integers(30, 460), seed=st.integers(0, 1000))
def test_contact_is_where_the_voltage_jumps(low, high, jump, seed):
    time = np.arange(500) / 62.5
    rng = np.random.default_rng(seed)
    voltage = np.where(np.arange(500) < jump, low, high) + 0.05 * rng.standard_normal(500)
    voltage[15] = high  # a spark before contact doesn't count
    assert rig.contact_time(time, voltage) == time[jump]
    assert rig.contact_time(time, voltage, threshold=2.5) == time[jump]


def test_no_contact_is_said(rng):
    quiet = 0.1 + 0.05 * rng.standard_normal(500)
    with pytest.raises(InputError, match="expected a jump"):
        rig.contact_time(np.arange(500.0), quiet)
    with pytest.raises(InputError, match="never stays beyond"):
        rig.contact_time(np.arange(500.0), quiet, threshold=1.0)


@given(st.floats(0.05, 8), st.floats(0.05, 8))
def test_conversions_undo_each_other(stretch, other):
    l, p = np.array([stretch, other]), np.array([3.0, -2.0])
    np.testing.assert_allclose(conversions.nominal_from_true(conversions.true_from_nominal(p, l), l), p)
    np.testing.assert_allclose(conversions.stretch_from_true_strain(conversions.true_strain(l)), l)
    np.testing.assert_allclose(conversions.stretch_from_displacement((l - 1) * 0.03, 0.03), l)


def test_noise_is_estimated_on_curves_at_any_spacing(rng):
    for time in (np.linspace(0, 10, 4000), np.sort(rng.uniform(0, 10, 4000))):
        values = 100 * np.sin(time)[:, None] * [1, 2] + 1.5 * rng.standard_normal((4000, 2))
        # Relative error of a standard deviation from 8000 correlated estimates: about 1.5 %.
        assert conversions.noise_estimate(time, values) == pytest.approx(1.5, rel=0.06)
    line = np.linspace(0, 1, 50)
    assert conversions.noise_estimate(line, 3 * line) == pytest.approx(0, abs=1e-12)
    assert conversions.noise_estimate(line[:2], line[:2]) == 0

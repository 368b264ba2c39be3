"""A clock that is late: exact where samples lie, smooth in the lag, at rest before and after."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.effects import history

TIME = 0.1 * np.arange(21)
RAMP = np.interp(TIME, [0.5, 1.5], [0.0, 2.0])  # 2/s between two corners, both on a sample


def delayed(time, x, lag):
    return history.delayed(jnp.asarray(time), jnp.asarray(x), jnp.asarray(lag))


def test_by_whole_samples_it_is_the_recording_itself_moved():
    for steps in (-3, -1, 0, 1, 4):
        moved = np.interp(TIME - 0.1 * steps, TIME, RAMP)
        np.testing.assert_allclose(delayed(TIME, RAMP, 0.1 * steps), moved, atol=1e-12)


def test_a_parabola_is_met_between_samples_away_from_the_ends():
    seen = np.asarray(delayed(TIME, TIME**2, 0.033))
    np.testing.assert_allclose(seen[3:-1], (TIME[3:-1] - 0.033) ** 2, atol=1e-12)


@pytest.mark.parametrize("lag", [0.0, 0.1, -0.2, 0.037])
def test_its_slope_by_the_lag_is_the_same_from_both_sides(lag):
    def slope(at):
        return np.asarray(jax.jacfwd(lambda x: delayed(TIME, RAMP, x))(at))

    np.testing.assert_allclose(slope(lag - 1e-9), slope(lag + 1e-9), atol=1e-5)
    h = 1e-6
    chord = (np.asarray(delayed(TIME, RAMP, lag + h)) - np.asarray(delayed(TIME, RAMP, lag - h))) / (2 * h)
    np.testing.assert_allclose(slope(lag + 1e-9), chord, atol=1e-4)


def test_at_a_corner_the_slope_is_half_the_rate():
    slope = np.asarray(jax.jacfwd(lambda x: delayed(TIME, RAMP, x))(1e-12))
    np.testing.assert_allclose(slope[[3, 5, 8, 15, 18]], [0.0, -1.0, -2.0, -1.0, 0.0], atol=1e-6)


def test_it_overshoots_a_corner_by_two_27ths_of_a_step_at_most():
    far = max(float(np.max(delayed(TIME, RAMP, x))) for x in np.linspace(0, 0.3, 91))
    assert far - 2.0 == pytest.approx(2 / 27 * 0.2, rel=1e-3)


def test_repeated_times_are_a_jump_and_a_lengthened_recording_says_the_same():
    longer = np.concatenate([TIME, np.repeat(TIME[-1:], 7)])
    rising = TIME**2  # it still moves at its end
    held = np.concatenate([rising, np.repeat(rising[-1:], 7)])
    for lag in (-0.13, 0.0, 0.04):
        np.testing.assert_allclose(delayed(longer, held, lag)[:21], delayed(TIME, rising, lag), atol=1e-12)
    time, x = np.array([0.0, 1.0, 1.0, 2.0, 3.0]), np.array([0.0, 0.0, 1.0, 1.0, 1.0])
    np.testing.assert_allclose(delayed(time, x, 0.5), [0.0, 0.0, 0.0, 1.0, 1.0], atol=1e-12)

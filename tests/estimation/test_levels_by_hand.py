"""Levels of noise by hand: differences of polynomials, steps, turns of straight drives, responses by convolution."""

import math

import numpy as np
import pytest

from tissuejax.estimation import level
from tissuejax.estimation.correlation import Estimate, Series
from tissuejax.estimation.level import (
    Level,
    Response,
    description,
    fades,
    fading,
    kinks,
    law,
    levels,
    resolution,
    rough,
)
from tissuejax.estimation.noise import Noise

T = np.arange(80.0)
NORMAL = 0.6744897501960817  # median of |x| of standard normal x


def test_third_differences_of_polynomials_by_hand():
    """Of a t^3 + ... it is 6 a, over sqrt(1 + 9 + 9 + 1) of white noise and its median."""
    assert rough(2.0 * T**3 - T**2 + 4) == pytest.approx(12 / math.sqrt(20) / NORMAL, rel=1e-4)
    assert rough(T**2 - 7 * T) == pytest.approx(0.0, abs=1e-9)
    assert rough(np.array([0.0, 1.0, 8.0, 27.0])) == pytest.approx(6 / math.sqrt(20) / NORMAL, rel=1e-4)
    assert rough(np.array([0.0, 0.0, 1.0, 0.0, 0.0])) == pytest.approx(3 / math.sqrt(20) / NORMAL, rel=1e-4)
    assert rough(np.where(T == 40, 1.0, 0.0)) == 0.0, "one sample that is out does not move a median"


@pytest.mark.parametrize("n", range(4))
def test_fewer_than_four_samples_have_no_third_difference(n):
    assert rough(np.full(n, 5.0)) == 0.0


@pytest.mark.parametrize(("values", "repeats", "step"), [
    ([0.0, 1.0], 4, 1.0),
    ([0.0, 0.5, 2.0], 4, 0.5),
    ([0.0, 0.5, 2.0], 3, 0.0),  # a third of the samples are distinct, a quarter is the most
    ([0.0, 1.0, 2.04], 4, 1.0),
    ([0.0, 1.0, 2.06], 4, 0.0),
    ([0.0, 1.0, 2.96], 4, 1.0),
    ([0.0, 1.0, 2.94], 4, 0.0),
    ([0.0, 1.0, 2.0, 2.0 + 2**-29], 4, 1.0),  # a thousand millionth of the range, 2^-28.9, is rounding
    ([0.0, 1.0, 2.0, 2.0 + 2**-28], 4, 2**-28),
    ([0.0, 3.0, 4.5], 9, 1.5),
    ([7.0], 9, 0.0),
    ([], 1, 0.0),
])  # fmt: skip
def test_steps_of_a_quantised_series(values, repeats, step):
    y = np.repeat(np.array(values), repeats)
    assert resolution(y) == pytest.approx(step, rel=1e-8)
    assert resolution(np.concatenate([[np.nan, np.inf], y, [-np.inf]])) == pytest.approx(step, rel=1e-8)


def bent(n: int, *turns: tuple[int, float]) -> np.ndarray:
    """A drive at rate 1 whose rate changes by so much at these samples."""
    t = np.arange(float(n))
    return t + sum(change * np.maximum(t - at, 0) for at, change in turns)


@pytest.mark.parametrize(("n", "turns", "found"), [
    (80, [(40, -1.0)], (40,)),
    (80, [(40, -0.5)], (40,)),
    (80, [(40, -0.25)], ()),  # a quarter of the fastest drive is none yet
    (80, [(40, -0.28125)], (40,)),
    (80, [(40, 1.0)], (40,)),
    (80, [(40, 0.25)], ()),  # 0.25 of 1.25
    (80, [(40, 0.375)], (40,)),
    (80, [(20, 2.0), (50, -0.75)], (20,)),  # a quarter of 3 is needed
    (80, [(20, 2.0), (50, -1.0)], (20, 50)),
    (80, [(40, 1.0), (43, -1.25)], (43,)),  # of two within three samples the larger
    (80, [(40, 1.0), (44, -1.25)], (40, 44)),
    (80, [(40, -1.25), (43, 1.0)], (40,)),
    (80, [(40, -1.25), (44, 1.0)], (40, 44)),
    (80, [(3, 1.0), (76, -1.0)], (3, 76)),
    (80, [(2, 1.0)], (3,)),
    (80, [(77, 1.0)], (76,)),
    (12, [(6, 1.0)], (6,)),
    (11, [(6, 1.0)], ()),
    (0, [], ()),
])  # fmt: skip
def test_kinks_of_straight_drives_by_hand(n, turns, found):
    """The change of rate over three samples is largest at the turn and gone three samples off."""
    assert kinks(np.arange(float(n)), bent(n, *turns)) == found
    assert kinks(5.0 + 0.25 * np.arange(float(n)), -4.0 * bent(n, *turns)) == found


def test_kinks_over_another_width():
    drive = bent(30, (10, 1.0), (15, -1.25))
    assert kinks(np.arange(30.0), drive, width=4) == (10, 15)
    assert kinks(np.arange(30.0), drive, width=5) == (15,)
    assert kinks(np.arange(30.0), drive, width=7) == (15,)
    assert kinks(np.arange(30.0), drive, width=8) == ()


def convolved(time: np.ndarray, x: np.ndarray, tau: float) -> np.ndarray:
    """Integral of exp(-(t - s) / tau) dx(s) over the past, of an x that is straight between the samples."""
    h = np.diff(time)
    rates = np.diff(x) / h
    out = np.zeros(len(time))
    for k in range(1, len(time)):
        since = time[k] - time[1 : k + 1]
        out[k] = np.sum(rates[:k] * tau * (np.exp(-since / tau) - np.exp(-(since + h[:k]) / tau)))
    return out


DRIVES = {
    "ramp": 0.5 * T,
    "hold": np.minimum(T, 25.0) - 3.0,
    "cycle": np.sin(2 * np.pi * T / 50) + 0.01 * T,
    "rest": np.full(80, 2.0),
}


@pytest.mark.parametrize("name", DRIVES)
def test_a_description_spans_a_law_of_the_drive_at_once_and_fading_powers(name):
    """Of a ramp these are a cubic of three pieces and three exponentials; of a ramp and a hold, a line and three
    exponentials more that go on where the ramp ends. The law is spanned by truncated powers here."""
    time, drive = 3.0 + 0.5 * T, DRIVES[name]
    e = (drive - drive[0]) / (np.max(np.abs(drive - drive[0])) or 1.0)
    knots = np.min(e) + np.ptp(e) * np.array([1 / 3, 2 / 3])
    columns = [np.ones(80), T / 79, *(np.maximum(e - k, 0) ** 3 * (np.ptp(e) > 0) for k in knots)]
    for power in (e, e**2, e**3):
        columns += [power, *(convolved(time, power, share * 39.5) for share in (0.012, math.sqrt(0.006), 0.5))]
    kept = [c / np.linalg.norm(c) for c in columns if np.any(c)]
    left, size, _ = np.linalg.svd(np.stack(kept, 1), full_matrices=False)
    left = left[:, size > 1e-6 * size[0]]
    assert left.shape[1] == {"ramp": 9, "hold": 13, "cycle": 16, "rest": 2}[name]
    u = description(time, drive)
    assert u.shape == left.shape
    np.testing.assert_allclose(u @ u.T, left @ left.T, atol=1e-7)
    np.testing.assert_allclose(u.T @ u, np.eye(len(u.T)), atol=1e-12)


@pytest.mark.parametrize(("n", "columns"), [(64, 6), (99, 6), (100, 7), (125, 8), (149, 8), (150, 9), (1000, 9)])
def test_a_law_has_a_piece_every_25_samples_from_three_to_six(n, columns):
    e = np.linspace(-0.2, 0.9, n)
    b = law(e)
    assert b.shape == (n, columns)
    np.testing.assert_allclose(b.sum(1), 1.0)
    cubic = np.linalg.lstsq(b, e**3 - e, rcond=None)[0]
    np.testing.assert_allclose(b @ cubic, e**3 - e, atol=1e-12)


def test_what_fades_is_exact_however_uneven_the_samples_of_a_straight_drive_lie():
    """Of a straight drive 1 - exp(-t / tau), and of two samples at one time no second one."""
    time = np.concatenate([np.linspace(0.0, 1.0, 150, endpoint=False), [1.0], np.geomspace(1.0, 4.0, 25)])
    for tau in (0.003, 0.3, 2.0):
        found = fading(time, np.stack([2.0 * time, -time], 1), tau)
        np.testing.assert_allclose(found[:, 0], 2.0 * tau * (1 - np.exp(-time / tau)), rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(found[:, 1], -found[:, 0] / 2, rtol=1e-12)


def test_the_times_over_which_it_fades_go_down_to_ten_of_the_finest_steps():
    np.testing.assert_allclose(fades(0.5 * T), [0.5 * 39.5, math.sqrt(0.006) * 39.5, 0.012 * 39.5])
    ramp = np.concatenate([np.arange(0.0, 0.1, 0.004), [1.0, 4.0, 10.0, 40.0]])  # 10 steps last 0.04 s
    np.testing.assert_allclose(fades(ramp), 20.0 * 500.0 ** -np.linspace(0, 1, 5))


@pytest.fixture
def told(monkeypatch):
    """What is said of the noise is given here; what was asked is kept."""
    asked = []

    def put(*noises: tuple[Noise, float]):
        def estimate(series: list[Series], recorded: bool = True) -> Estimate:
            asked.append((series, recorded))
            return Estimate(tuple(n for n, _ in noises), tuple(size for _, size in noises))

        monkeypatch.setattr(level, "estimate", estimate)
        return asked

    return put


@pytest.mark.parametrize("noise", [Noise(), Noise.shaped(0.8, 3.0), Noise.shaped(0.9, 40.0), Noise.shaped(1.0, 1e4)])
def test_what_the_description_took_of_slow_noise_is_put_back(told, noise, rng):
    """A projector takes tr(U' C U) of n variances; more than three quarters are not believed."""
    drive = DRIVES["hold"]
    y = 3.0 * drive**2 + 4.0 * rng.normal(size=80)
    asked = told((noise, 2.0))
    (found,) = levels([Response(0.5 * T, drive, y)])
    ((series,), recorded) = asked[0]
    u = description(0.5 * T, drive)
    rest = y - u @ (u.T @ y)
    d = np.abs(np.subtract.outer(T, T)) * 0.5 / noise.tau
    c = noise.share * np.exp(-d) + (1 - noise.share) * np.eye(80)
    kept = 1 - np.trace(u.T @ c @ u) / 80
    assert (kept < 0.25) == (noise.share > 0.85)
    assert found.std == pytest.approx(rough(y) * 2.0 / math.sqrt(max(kept, 0.25)), rel=1e-9)
    assert found.left == pytest.approx(np.std(rest), rel=1e-9)
    assert (found.noise, found.resolution, found.short) == (noise, 0.0, False)
    assert not recorded
    np.testing.assert_allclose(series.values[:, 0], rest / rough(y), atol=1e-9)
    np.testing.assert_array_equal(series.time, 0.5 * T)
    assert series.kinks == (25,)


def test_series_of_64_samples_are_long_and_in_their_order(told, rng):
    y = 4.0 * rng.normal(size=80)
    of = [Response(T[:n], DRIVES["cycle"][:n], y[:n]) for n in (63, 64, 20, 80)]
    asked = told((Noise(), 1.0), (Noise.shaped(0.5, 2.0), 3.0))
    found = levels(of)
    assert [len(s.time) for s in asked[0][0]] == [64, 80]
    assert [x.short for x in found] == [True, False, True, False]
    assert [found[i].std for i in (0, 2)] == [rough(y[:63]), rough(y[:20])]
    assert (found[0].noise, found[0].left) == (Noise(), 0.0)
    assert (found[1].noise.share, found[3].noise.share) == pytest.approx((0.0, 0.5))
    assert found[1].std == pytest.approx(rough(y[:64]) / math.sqrt(1 - 16 / 64), rel=1e-9)
    assert found[3].std > 3.0 * rough(y)


@pytest.mark.parametrize(("values", "unit"), [
    (np.zeros(80), 1.0),
    (np.where(T == 40, 1.0, 0.0), None),
])  # fmt: skip
def test_a_series_without_differences_is_measured_by_its_rest(told, values, unit):
    asked = told((Noise(), 1.0))
    (found,) = levels([Response(T, DRIVES["ramp"], values)])
    ((series,), _) = asked[0]
    unit = unit or 1e-3 * found.left
    assert np.std(series.values) == pytest.approx(found.left / unit, rel=1e-12)
    assert found.std == pytest.approx(max(unit / math.sqrt(1 - 9 / 80), found.resolution / math.sqrt(12)), rel=1e-9)


def test_noise_is_at_least_that_of_rounding(told):
    told((Noise(), 1e-3))
    quiet, short = levels([Response(T, DRIVES["ramp"], np.round(T / 8) * 6), Response(T[:40], T[:40], T[:40] // 8 * 6)])
    for found in (quiet, short):
        assert found.resolution == pytest.approx(6.0)
        assert found.std == pytest.approx(math.sqrt(3.0), rel=1e-12)
    assert (quiet.short, short.short) == (False, True)
    assert quiet.left > 0
    assert levels([]) == []


def test_slow_noise_is_told_from_a_slow_response_below_twice_the_noise():
    assert Level(3.0, left=5.99).certain
    assert not Level(3.0, left=6.0).certain
    assert Level(3.0, left=60.0, short=True).certain
    assert Level(1.0) == Level(1.0, Noise(), 0.0, 0.0, False)

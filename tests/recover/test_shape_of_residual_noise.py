"""The noise that is left in a fit: which series are looked at, what is asked of them, its shape by known filters."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from tissuejax.estimation.noise import Noise
from tissuejax.fitting import serial as room
from tissuejax.fitting.serial import Serial, serial

SLOW, WHITE = Noise(0.0, 1.0, 5.0), Noise(1.0, 0.0, 1.0)


def posed(*segments: tuple[str, str, int]) -> Any:
    """A problem of these (recording, channel, samples), two samples a second."""
    found, at = [], 0
    for recording, channel, n in segments:
        rows = slice(at, at + n)
        found.append(SimpleNamespace(recording=recording, channel=channel, rows=rows, time=0.5 * np.arange(n)))
        at += n
    channels = tuple(dict.fromkeys((r, c) for r, c, _ in segments))
    return SimpleNamespace(channels=channels, series=SimpleNamespace(segments=found))


def wave(n: int, slow: bool) -> np.ndarray:
    """Neighbours agree all but wholly, or are opposite."""
    return np.sin(2 * math.pi * np.arange(n) / n) if slow else (-1.0) ** np.arange(n)


def sought(monkeypatch, noises=lambda k: SLOW) -> list:
    asked = []

    def shape(series):
        asked.append([(s.time.tolist(), s.values.tolist()) for s in series])
        return SimpleNamespace(noises=[noises(k) for k in range(len(series))])

    monkeypatch.setattr(room, "_shape", shape)
    return asked


def test_each_channel_is_asked_for_itself_with_all_its_series_that_are_long_enough(monkeypatch):
    """The first is white, of the second one series is too short (63), of the third none is long enough."""
    asked = sought(monkeypatch)
    sizes = (("p", "white", 80), ("p", "slow", 64), ("p", "short", 63), ("q", "slow", 63), ("r", "slow", 70))
    parts = [wave(80, False), wave(64, True), wave(63, True), wave(63, True), wave(70, False)]
    memory = serial(posed(*sizes, ("r", "last", 90)), np.concatenate([*parts, wave(90, True) + 7.0]))
    one, two = asked
    assert one == [
        ((0.5 * np.arange(64)).tolist(), wave(64, True)[:, None].tolist()),
        ((0.5 * np.arange(70)).tolist(), wave(70, False)[:, None].tolist()),
    ]
    assert [len(time) for time, _ in two] == [90]
    rows = [np.arange(80, 144), np.arange(270, 340), np.arange(340, 430)]
    assert [r.tolist() for r, _, _ in memory.parts] == [r.tolist() for r in rows]
    assert [t.tolist() for _, t, _ in memory.parts] == [(0.5 * np.arange(n)).tolist() for n in (64, 70, 90)]
    assert all(noise is SLOW for *_, noise in memory.parts)


def test_series_whose_noise_is_white_after_all_are_left_out(monkeypatch):
    sought(monkeypatch, lambda k: (WHITE, SLOW)[k])
    memory = serial(posed(("p", "c", 64), ("q", "c", 64)), np.tile(wave(64, True), 2))
    assert [rows.tolist() for rows, _, _ in memory.parts] == [list(range(64, 128))]
    assert serial(posed(("p", "c", 63)), wave(63, True)).parts == ()


@pytest.mark.parametrize(("times", "noticed"), [(0.999, False), (1.001, True), (-1.001, False)])
def test_neighbours_are_noticed_beyond_two_and_a_half_standard_deviations(monkeypatch, times, noticed):
    """Of 100 samples from a correlation of a quarter on: a share of a wave is mixed into what alternates."""
    asked = sought(monkeypatch)
    slow, fast = np.cos(2 * math.pi * np.arange(100) / 50), np.cos(math.pi * (np.arange(100) + 0.5) / 2)

    def rho(share):
        r = slow * share + fast
        r = r - r.mean()
        return float(r[1:] @ r[:-1] / (r @ r))

    low, high = (0.0, 5.0) if times > 0 else (0.0, 0.0)
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if rho(middle) < times * 0.25 else (low, middle)
    r = slow * high + (fast if times > 0 else wave(100, False))
    serial(posed(("p", "c", 100)), 1e4 * (r + 3.0))
    assert len(asked) == noticed
    serial(posed(("p", "c", 100)), np.full(100, 3.0))
    assert len(asked) == noticed  # what is constant is no noise


def test_products_and_squares_are_dense_ones_rows_beside_them_independent(rng):
    """cov = 0.36 [i = j] + 0.64 exp(-|t - t'| / 5) in rows 3 to 22 of 30, exp(-|t - t'| / 2) in the last six."""
    time, late = np.sort(rng.uniform(0, 20, 20)), np.arange(6.0)
    V = np.eye(30)
    V[3:23, 3:23] = 0.36 * np.eye(20) + 0.64 * np.exp(-np.abs(time[:, None] - time) / 5)
    V[24:, 24:] = np.exp(-np.abs(late[:, None] - late) / 2)
    parts = (np.arange(3, 23), time, Noise(0.6, 0.8, 5.0)), (np.arange(24, 30), late, Noise(0.0, 1.0, 2.0))
    x = rng.normal(size=(30, 4))
    np.testing.assert_allclose(Serial(parts).times(x), V @ x, atol=1e-10)
    assert Serial(parts).squares(30) == pytest.approx(np.trace(V @ V), rel=1e-9)
    assert Serial(parts[:1]).squares(50) == pytest.approx(30 + np.trace(V[3:23, 3:23] @ V[3:23, 3:23]), rel=1e-9)
    assert Serial().squares(30) == 30
    np.testing.assert_array_equal(Serial().times(x), x)


def behind(order: int, tau: float, seed: int = 5, n: int = 300) -> np.ndarray:
    """White noise through one pole or twice through the same, `tau` in samples, of unit variance."""
    keep = math.exp(-1 / tau)
    e = np.random.default_rng(seed).normal(size=n + 1000)
    for _ in range(order):
        e = np.asarray(lfilter([1 - keep], [1, -keep], e))
    return e[-n:] / e.std()


@pytest.mark.parametrize("size", [0.01, 5.0])
@pytest.mark.parametrize(("order", "tau"), [(1, 4.0), (2, 4.0), (2, 15.0)])
def test_the_shape_found_is_that_of_the_low_pass_whatever_the_size(order, tau, size):
    """700 samples, two a second. Slow noise of second order falls as a mismatch does, and is taken for noise."""
    ((_, _, noise),) = serial(posed(("p", "c", 700)), size * behind(order, tau, n=700)).parts
    assert noise.order == order
    assert noise.std == pytest.approx(1.0)
    assert noise.share > 0.9
    if tau == 4.0:
        assert noise.tau == pytest.approx(2.0, rel=0.4)


@pytest.mark.parametrize("size", [0.01, 5.0])
def test_a_smooth_mismatch_beside_noise_behind_one_pole_is_not_taken_for_noise(size):
    """The time constant beside it is that of the noise alone, 1.5 s."""
    smooth = 3.0 * np.sin(np.linspace(0, 5, 300)) ** 3
    ((_, _, beside),) = serial(posed(("p", "c", 300)), size * (behind(1, 3.0, seed=6) + smooth)).parts
    assert beside.order == 1
    assert beside.tau == pytest.approx(1.5, rel=0.5)

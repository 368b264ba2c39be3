"""What residuals that are no independent samples are multiplied by, and where the shape of noise is sought at all."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from tissuejax.estimation.noise import Noise
from tissuejax.fitting import serial as room
from tissuejax.fitting.serial import NOTICED, Serial, serial


def dense(noise: Noise, time: np.ndarray) -> np.ndarray:
    return noise.times(np.eye(len(time)), time)


def made() -> tuple[Serial, np.ndarray]:
    """Rows 2 to 7 and 9 to 12 of 14 are carried from sample to sample, and the dense matrix."""
    times = np.linspace(0, 1, 6), np.linspace(0, 3, 4)
    noises = Noise(0.6, 0.8, 0.4), Noise(0.28, 0.96, 1.2)
    rows = np.arange(2, 8), np.arange(9, 13)
    whole = np.eye(14)
    for r, t, n in zip(rows, times, noises, strict=True):
        whole[np.ix_(r, r)] = dense(n, t)
    return Serial(tuple(zip(rows, times, noises, strict=True))), whole


def test_products_and_squares_are_those_of_the_dense_matrix(rng):
    memory, whole = made()
    x = rng.standard_normal((14, 3))
    kept = x.copy()
    np.testing.assert_allclose(memory.times(x), whole @ x, atol=1e-12)
    np.testing.assert_array_equal(x, kept)
    assert memory.squares(14) == pytest.approx(np.trace(whole @ whole))
    assert Serial().squares(5) == 5
    np.testing.assert_array_equal(Serial().times(x), x)


def test_a_matrix_of_one_on_its_diagonal_is_meant():
    np.testing.assert_allclose(np.diag(made()[1]), 1.0)


def posed(*segments: tuple[str, str, int]) -> SimpleNamespace:
    """A problem of these (recording, channel, samples), a sample a second."""
    found, at = [], 0
    for recording, channel, n in segments:
        rows = slice(at, at + n)
        found.append(SimpleNamespace(recording=recording, channel=channel, rows=rows, time=np.arange(n, dtype=float)))
        at += n
    channels = tuple((r, c) for r, c, _ in segments)
    return SimpleNamespace(channels=channels, series=SimpleNamespace(segments=found))


def alternating(n: int, rho: float) -> np.ndarray:
    """Residuals without a mean whose neighbours agree by `rho`: sines of one whole number of waves."""
    wave = np.arange(1, n // 2)
    own = np.cos(2 * math.pi * wave / n)
    k = int(wave[np.argmin(np.abs(own - rho))])
    return math.sqrt(2) * np.sin(2 * math.pi * k * np.arange(n) / n)


@pytest.mark.parametrize(("by", "sought"), [(0.9, False), (1.1, True)])
def test_the_shape_is_sought_where_neighbours_agree_by_more_than_chance(monkeypatch, by, sought):
    """Of 400 samples from 2.5 standard deviations of a twentieth on."""
    asked = []
    white = SimpleNamespace(noises=[Noise(1.0, 0.0, 1.0)])
    monkeypatch.setattr(room, "_shape", lambda series: asked.append([len(s.time) for s in series]) or white)
    r = alternating(400, by * NOTICED / 20)
    mean = r - r.mean()
    assert float(mean[1:] @ mean[:-1] / (mean @ mean)) == pytest.approx(by * NOTICED / 20, abs=0.01)
    assert serial(posed(("r", "stress", 400)), r + 3.0).parts == ()
    assert asked == ([[400]] if sought else [])
    assert serial(posed(("r", "stress", 400)), np.zeros(400)).parts == ()


def test_series_of_one_channel_are_looked_at_together_and_short_ones_not_at_all(monkeypatch):
    asked, found = [], Noise(0.6, 0.8, 5.0)
    shape = lambda series: asked.append([len(s.time) for s in series]) or SimpleNamespace(noises=[found] * len(series))  # noqa: E731
    monkeypatch.setattr(room, "_shape", shape)
    slow, quick = alternating(200, 0.9), alternating(200, -0.9)
    of = posed(("p", "stress", 200), ("p", "force", 200), ("q", "stress", 200), ("q", "stress", 3))
    memory = serial(of, np.concatenate([slow, quick, quick, np.ones(3)]))
    assert asked == [[200, 200]]  # the force is white; the stress of both recordings, though one of them is
    assert [rows.tolist() for rows, _, _ in memory.parts] == [list(range(200)), list(range(400, 600))]
    assert all(noise is found for _, _, noise in memory.parts)

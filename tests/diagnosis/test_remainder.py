"""The remainder as smooth functions: put a known one in, get it back where it was put, and leave noise alone."""

import json

import numpy as np
import pytest
from spring_bench import spring

from tissuejax.diagnosis.remainder import over_places, remainder
from tissuejax.estimation.series import Segment

TRUTH = {"a": 10.0, "b": 20.0}


def root(s):
    rate = np.gradient(s.drive, s.time)
    return np.sign(rate) * np.sqrt(np.abs(rate))


PARTS = {
    "drive": lambda s: 0.5 * np.sin(12 * s.drive),
    "rate": lambda s: 0.6 * np.tanh(3 * root(s)),
    "time": lambda s: 0.4 * np.sin(2 * np.pi * s.time / 13 + ord(s.recording[-1])),
}


def left(**sizes):
    """A spring with noise and the named parts added; its remainder."""
    bench = spring({})
    for s in bench.segments:
        for name, size in sizes.items():
            bench.y[s.rows] += size * PARTS[name](s)
    return bench, remainder(bench, bench.predict(TRUTH), "force")


@pytest.mark.parametrize("name", list(PARTS))
def test_a_part_is_found_where_it_was_put(name):
    _, found = left(**{name: 1.0})
    others = [v for k, v in found.share.items() if k in PARTS and k != name]
    assert found.share[name] > 0.75
    assert max(others) < 0.08


def test_curves_are_the_functions_that_were_put_in():
    bench, found = left(drive=1.0, rate=1.0)
    for name in ("drive", "rate"):
        x, value = (np.array(found.curves[name][k]) for k in ("x", "value"))
        assert np.all(np.diff(x) >= 0)
        made = 0.5 * np.sin(12 * x) if name == "drive" else 0.6 * np.tanh(3 * np.sign(x) * np.sqrt(np.abs(x)))
        difference = value - made
        assert np.std(difference) < 0.06, name


def test_noise_alone_has_no_smooth_part():
    _, found = left()
    assert found.share["noise"] > 0.9
    assert abs(found.constant) < 0.01


def test_the_smooth_series_is_the_remainder_without_its_noise():
    bench, found = left(drive=1.0, rate=1.0, time=1.0)
    for s in bench.segments:
        made = sum(PARTS[k](s) for k in PARTS)
        assert np.std(np.array(found.series[s.recording]["smooth"]) - made) < 0.05
        np.testing.assert_allclose(
            found.series[s.recording]["remainder"], bench.y[s.rows] - bench.predict(TRUTH)[s.rows], atol=1e-12
        )


def test_it_can_be_exported():
    _, found = left(rate=1.0)
    again = json.loads(json.dumps(found.as_dict()))
    assert again["unit"] == "N"
    assert set(again["curves"]) == {"drive", "rate", "time/r1", "time/r2", "time/r3"}
    assert sum(again["share_of_squares"].values()) == pytest.approx(1.0, abs=0.02)


def surface(amount, rng):
    """Markers on a 6 x 6 grid of a bench; under the probe the prediction misses those near one corner."""
    bench, n = spring({}), 50
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(-0.03, 0.03, 6), np.linspace(-0.02, 0.02, 6)))
    depth = np.interp(np.arange(n), [0, 20, 40, 49], [0, 5e-3, 5e-3, 0])
    bench.segments, rows = [], []
    for j in range(36):
        size = amount * np.exp(-((x[j] - 0.02) ** 2 + (y[j] - 0.01) ** 2) / 0.018**2)
        for a, rest in zip("xyz", (x[j], y[j], 0.0), strict=True):
            at = slice(len(rows) * n, (len(rows) + 1) * n)
            bench.segments.append(
                Segment("p", "markers", f"marker {j} {a}", at, np.arange(n), "m", depth, "depth", "m")
            )
            rows.append(rest + (size * depth / 5e-3 if a == "z" else 0.0) + 2e-5 * rng.standard_normal(n))
    bench.y = np.concatenate(rows)
    rest = np.concatenate([np.full(n, bench.y[s.rows][0]) for s in bench.segments])
    return bench, rest, x, y


def test_markers_are_missed_where_they_were_made_to_miss(rng):
    bench, rest, x, y = surface(1e-3, rng)
    found = over_places(bench, rest, "p")
    assert found.share > 0.9
    assert np.hypot(*(found.place[np.argmax(found.smooth[:, 2]), :2] - [0.02, 0.01])) < 0.012
    np.testing.assert_allclose(found.place[:, 0], x, atol=2e-4)
    assert over_places(spring({}), spring({}).y, "r1") is None


def test_markers_that_miss_by_noise_have_no_place(rng):
    bench, rest, *_ = surface(0.0, rng)
    bench.y = bench.y + 1e-4 * rng.standard_normal(36 * 3)[np.repeat(np.arange(108), 50)]
    found = over_places(bench, rest, "p")
    assert found.share < 0.5

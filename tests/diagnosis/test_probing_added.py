"""What sensors of a probing add to what they report: the formula, its derivatives, and that nothing is simulated."""

import numpy as np
import pytest

from tests.probing.bench import QUICK, VALUES, model, recording, sample
from tissuejax.diagnosis.probing import ProbingBench
from tissuejax.diagnosis.probing_added import added, slope
from tissuejax.diagnosis.probing_view import ProbingView
from tissuejax.effects.catalogue import suited
from tissuejax.energies.catalogue import energy
from tissuejax.experiments.predictor import predictor
from tissuejax.recordings.recording import Channel

NAMES = ["force-drift", "force-hum"]
SETTINGS = {"mesh": "file", "compression": 3.0, "interval": 0.04, "step": 8e-4, "processes": 1}
HUM = {"frequency": 2.3, "beside_x": 0.4, "beside_y": -0.2, "sin.a": 0.01, "cos.a": -0.02, "cos.b": 0.015}
DRIFT = {"offset_z.a": 0.02, "rate_x.b": -0.01}
ON = {f"effects.force-hum.{k}": v for k, v in HUM.items()} | {f"effects.force-drift.{k}": v for k, v in DRIFT.items()}


def shaken(name: str, wave: float = 0.0, **more):
    """A recording whose force is a wave of 2.3 Hz along z and nothing else, markers that move at 1.1 Hz."""
    made = recording(name, **more)
    force, markers = made.channels["force"], made.channels["markers"]
    values = np.zeros((len(force.time), 3))
    values[:, 2] = wave * np.sin(2 * np.pi * 2.3 * force.time)
    moved = markers.values + 1e-3 * np.sin(2 * np.pi * 1.1 * markers.time)[:, None, None]
    made.channels["force"] = Channel(force.time, values, "N", 0.003)
    made.channels["markers"] = Channel(markers.time, moved, "m", 6e-5)
    return made


@pytest.fixture(scope="module")
def bench():
    """Two recordings on a bench whose simulations are counted and say what was measured."""
    two = sample(shaken("a", 0.05), shaken("b", 0.03, place=(-0.004, 0.004)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ProbingBench, "_scale", lambda self: 1.0)
        return ProbingBench.of(two, energy("reduced-polynomial-2"), ("a", "b"), (), NAMES, **SETTINGS)


def expected(s, values):
    """By hand, of one series."""
    t, r = np.asarray(s.time, float), s.recording

    def v(path):
        return values.get(f"{path}.{r}", values.get(path, 0.0))

    if s.channel != "force":
        return 0 * t
    hum = "effects.force-hum."
    a = 2 * np.pi * v(hum + "frequency") * t
    wave = v(hum + "sin") * np.sin(a) + v(hum + "cos") * np.cos(a)
    axis = {"x": v(hum + "beside_x"), "y": v(hum + "beside_y"), "z": 1.0}[s.component]
    drift = v(f"effects.force-drift.offset_{s.component}") + v(f"effects.force-drift.rate_{s.component}") * t
    return axis * wave + drift


def test_what_is_added_is_the_formula(bench):
    told = added(bench.runs, bench.at(ON))
    for s in bench.segments:
        assert np.allclose(told[s.rows], expected(s, ON), atol=1e-15), (s.recording, s.component)
    assert not np.any(added(bench.runs, bench.at({"effects.force-hum.frequency": 2.3})))


@pytest.mark.parametrize("path", sorted(ON))
def test_derivatives_are_difference_quotients(bench, path):
    h = 1e-6
    up, down = (added(bench.runs, bench.at(ON | {path: ON[path] + d})) for d in (h, -h))
    found = slope(bench.runs, bench.at(ON), path)
    assert np.allclose(found, (up - down) / (2 * h), atol=1e-8 * np.abs(found).max())


@pytest.mark.parametrize("view", [False, True], ids=["bench", "view"])
def test_they_cost_no_simulation(bench, view, monkeypatch):
    """All sets that differ in what is added ask for one simulation; derivatives ask for none, and aren't smoothed."""
    keys = set()

    def told(asked):
        keys.update(bench.runs._key(values, r, kind) for values, names, kind in asked for r in names)
        return [np.zeros(len(bench.y)) for _ in asked]

    monkeypatch.setattr(bench.runs, "many", told)
    made = ProbingView.of(bench) if view else bench
    unit = made.unit if view else 1.0
    origin = made.origin if view else 0.0
    for values in (VALUES, VALUES | ON):
        heard = added(bench.runs, bench.at(values))
        assert np.allclose(made.predict(values), (heard - origin) / unit, atol=1e-12)
    assert len(keys) == 2  # one for each recording
    columns = made.jacobian(VALUES | ON, tuple(ON))
    scores = made.columns(VALUES, [({"effects.force-hum.frequency": f}, "effects.force-hum.sin.a") for f in (2.0, 3.0)])
    assert len(keys) == 2
    for path, column in zip(ON, columns.T, strict=True):
        assert np.allclose(column * unit, slope(bench.runs, bench.at(VALUES | ON), path), atol=1e-12), path
    assert not np.allclose(scores[:, 0], scores[:, 1])  # each at its own frequency


def test_a_hum_is_heard_in_the_force_and_a_support_in_the_markers(bench):
    hum = bench.candidates["force-hum"]
    nothing = np.where(np.isin(np.arange(len(bench.y)), _rows(bench, "markers")), np.median(bench.y), 0.0)
    found = [s["effects.force-hum.frequency"] for s in bench.settings(hum, nothing)]
    assert len(found) == 3
    assert found[0] == pytest.approx(2.3, abs=0.1)
    by_markers = bench.settings(type(hum)(**{**vars(hum), "heard": ""}), nothing)
    assert by_markers[0]["effects.force-hum.frequency"] == pytest.approx(1.1, abs=0.1)


def test_a_hum_lies_where_the_recordings_can_show_it(bench):
    """Force every 40 ms for 2.36 s: from 2.5 periods to four samples a period."""
    f = bench.free["effects.force-hum.frequency"]
    assert f.lower == pytest.approx(2.5 / (2.38 - 0.02), rel=0.03)
    assert f.upper == pytest.approx(1 / (4 * 0.04))


def _rows(bench, channel):
    return np.concatenate([np.r_[s.rows] for s in bench.segments if s.channel == channel])


def test_a_quick_hum_is_read_at_the_sensors_times_and_not_between_frames():
    """6 Hz read between frames of 40 ms by straight lines would be a quarter too small at the crests."""
    p = predictor(model(suited("force-hum", "probing")), sample(), settings=QUICK)
    force = [
        p.predict(VALUES | {"effects.force-hum.sin.r1": x, "effects.force-hum.frequency": 6.0})["r1"].channels["force"]
        for x in (0.0, 0.5)
    ]
    hum = np.asarray(force[1].values - force[0].values, float)
    assert np.allclose(hum[:, 2], 0.5 * np.sin(2 * np.pi * 6.0 * np.asarray(force[0].time)), atol=1e-4)
    assert not np.any(hum[:, :2])

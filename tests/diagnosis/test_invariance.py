"""What must not change a verdict: the order of recordings, where the clocks start, the units of the lab's table."""

import dataclasses

import numpy as np
import pytest

from tissuejax.diagnosis.diagnose import diagnose
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.recordings import files
from tissuejax.recordings.recording import Channel, Recording, Sample

EFFECTS = ("slack", "aging", "drift")  # light ones: a verdict in a second
QUICK = Effort(most=1)
TIME = np.arange(0, 16.0, 0.08)
PATHS = {
    "pull": [1, 1, 1.3, 1.3, 1, 1],
    "push": [1, 1, 0.78, 0.78, 1, 1],
    "both": [1, 1, 1.2, 0.85, 1, 1],
}
START = {"pull": 40.0, "push": 340.0, "both": 700.0}


def stress(stretch):
    """Uniaxial nominal stress of C10 = 500 Pa, C20 = 300 Pa in closed form: 2 (l - l^-2) (C10 + 2 C20 (I1 - 3))."""
    return 2 * (stretch - stretch**-2) * (500 + 600 * (stretch**2 + 2 / stretch - 3))


@pytest.fixture(scope="module")
def sample():
    """Grips with 1.5 % of play both ways, noise of 4 Pa."""
    rng = np.random.default_rng(8)
    recordings = {}
    for name, levels in PATHS.items():
        stretch = np.interp(TIME, [0, 1, 5, 9, 13, 16], levels)
        strain = stretch - 1
        felt = 1 + np.sign(strain) * np.maximum(np.abs(strain) - 0.015, 0)
        channel = Channel(TIME, stress(felt) + 4 * rng.standard_normal(len(TIME)), "Pa", 4.0)
        attributes = {"start": START[name], "area": 5e-4, "height": 0.02, "diameter": 0.0252}
        inputs = {"time": TIME, "stretch": stretch}
        recordings[name] = Recording(name, "uniaxial", inputs, {"nominal_stress": channel}, attributes)
    return Sample("play", recordings)


def verdict(source):
    found = diagnose(source, holdout="both", effects=EFFECTS, effort=QUICK)
    return found.verdict


@pytest.fixture(scope="module")
def plain(sample):
    return verdict(sample)


def same(a, b):
    assert (a.kind, a.chosen.keys) == (b.kind, b.chosen.keys)
    for path, value in a.chosen.values.items():
        assert b.chosen.values[path] == pytest.approx(value, abs=0.1 * a.chosen.std[path]), path
    assert b.chosen.held == pytest.approx(a.chosen.held, rel=1e-2)
    assert b.confidence == pytest.approx(a.confidence, abs=0.01)


def test_it_is_slack(plain):
    assert (plain.kind, plain.chosen.keys) == ("found", ("slack",))
    assert plain.chosen.values["effects.slack.gap"] == pytest.approx(
        0.015, abs=4 * plain.chosen.std["effects.slack.gap"]
    )


def test_order_of_recordings(sample, plain):
    turned = {name: sample.recordings[name] for name in ("both", "push", "pull")}
    same(plain, verdict(dataclasses.replace(sample, recordings=turned)))


def shifted(recording, seconds, start):
    """All clocks of a recording later by `seconds`, its place in the session by `start`."""
    inputs = {**recording.inputs, "time": recording.inputs["time"] + seconds}
    channels = {n: dataclasses.replace(c, time=c.time + seconds) for n, c in recording.channels.items()}
    attributes = {**recording.attributes, "start": recording.attributes["start"] + start}
    return dataclasses.replace(recording, inputs=inputs, channels=channels, attributes=attributes)


@pytest.mark.parametrize(("seconds", "start"), [(1000.0, 0.0), (0.0, 86400.0)])
def test_constant_shift_of_time(sample, plain, seconds, start):
    moved = {name: shifted(r, seconds, start) for name, r in sample.recordings.items()}
    same(plain, verdict(dataclasses.replace(sample, recordings=moved)))


SIDE = """
file = "play.csv"
sample = "play"
recording = "{{test}}"
experiment = "uniaxial"
[columns]
time = {{ column = "t", unit = "{time}" }}
strain = {{ column = "e", unit = "{strain}" }}
nominal_stress = {{ column = "P", unit = "{stress}" }}
[specimen]
diameter = "{diameter}"
height = "{height}"
[noise]
nominal_stress = "{noise}"
"""
UNITS = {
    "si": {"time": ("s", 1.0), "strain": ("1", 1.0), "stress": ("Pa", 1.0)},
    "lab": {"time": ("min", 60.0), "strain": ("%", 0.01), "stress": ("kPa", 1000.0)},
}
WORDS = {
    "si": {"diameter": "0.0252 m", "height": "0.02 m", "noise": "4 Pa"},
    "lab": {"diameter": "25.2 mm", "height": "2 cm", "noise": "0.004 kPa"},
}


def test_units_of_a_table(sample, tmp_path):
    found = {}
    for lab, units in UNITS.items():
        rows = ["test,t,e,P"]
        for name, r in sample.recordings.items():
            values = (r.inputs["time"], r.inputs["stretch"] - 1, r.channels["nominal_stress"].values)
            scaled = [v / units[k][1] for k, v in zip(units, values)]
            rows += [f"{name},{t!r},{e!r},{p!r}" for t, e, p in np.stack(scaled, -1).tolist()]
        folder = tmp_path / lab
        folder.mkdir()
        (folder / "play.csv").write_text("\n".join(rows))
        (folder / "play.toml").write_text(SIDE.format(**{k: u for k, (u, _) in units.items()}, **WORDS[lab]))
        found[lab] = verdict(files.read(folder / "play.toml"))
    same(found["si"], found["lab"])
    assert found["lab"].chosen.keys == ("slack",)

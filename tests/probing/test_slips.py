"""Slips of a probing named at the door: units, signs and registration, before anything is simulated."""

from dataclasses import replace

import numpy as np
import pytest

from tests.probing.bench import recording, sample
from tissuejax.errors import UnstableSimulation
from tissuejax.experiments.probing_slips import probing_slips
from tissuejax.recordings.recording import Channel


def pressed(factor: float = 1.0, sideways: float = 0.0, lifted: float = 0.0, force: float = 1.0, offset: float = 0.0):
    """A ball of 8 mm pressed 3 mm into a box, its force that of a spring (0.3 N at the deepest), changed as said."""
    made = recording()
    path = np.asarray(made.inputs["probe/position"]) * factor + np.array([sideways, 0.0, lifted])
    channel = made.channels["force"]
    depth = np.interp(channel.time, made.inputs["probe/time"], 0.023 - np.asarray(made.inputs["probe/position"])[:, 2])
    values = np.zeros((len(channel.time), 3))
    values[:, 2] = force * (100.0 * np.maximum(depth, 0.0) + offset)
    channels = {"force": Channel(channel.time, values, "N", 0.003)}
    return sample(replace(made, inputs={**made.inputs, "probe/position": path}, channels=channels))


SLIPS = {
    "metres": ({"factor": 1000.0}, "mm read as m"),
    "beside": ({"sideways": 0.1}, "never touches the tissue (nearest 74.2 mm)"),  # from 82 and 5 mm away
    "too high": ({"lifted": 0.01}, "never touches the tissue (nearest 7.0 mm)"),
    "inside": ({"lifted": -0.004}, "starts 3.5 mm inside the tissue"),
    "turned round": ({"force": -1.0}, "points into the tissue"),
    "kN": ({"force": 1000.0}, "read as kN"),
    "mN": ({"force": 1e-4}, "N read as mN"),
    "offset": ({"offset": 0.5}, "an offset of the sensor"),
}


@pytest.mark.parametrize("slip", SLIPS)
def test_each_slip_is_named(slip):
    changes, words = SLIPS[slip]
    said = probing_slips(pressed(**changes))
    assert any(s.startswith("r1: ") and words in s for s in said), said


def test_a_sound_probing_passes_without_a_word():
    assert probing_slips(pressed()) == []


def test_a_run_that_breaks_down_says_what_the_data_look_like(monkeypatch):
    import tissuejax as tj
    from tissuejax.fitting.kinds.probings import Probings

    def broken(*_, **__):
        raise UnstableSimulation("an element inverted")

    monkeypatch.setattr(Probings, "fit", broken)
    with pytest.raises(UnstableSimulation, match=r"inverted\. First look at the data: r1: the force points into"):
        tj.fit(pressed(force=-1.0), "reduced-polynomial-2", volumetric="quadratic")

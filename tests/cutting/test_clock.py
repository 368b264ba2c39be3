"""A force whose clock is late, made by shifting what another simulator recorded: it is named, with its size."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tissuejax as tj
from tissuejax.recordings.recording import Channel

CUT = Path(__file__).parents[2] / "data" / "cut.h5"


def late(sample, lag):
    """The force stamped t is that of t - lag."""
    recordings = {}
    for name, r in sample.recordings.items():
        seen = r.channels["force"]
        time, values = np.asarray(seen.time), np.asarray(seen.values)
        shifted = np.stack([np.interp(time - lag, time, axis) for axis in values.T], 1)
        recordings[name] = replace(
            r, channels={**r.channels, "force": Channel(time, shifted, seen.unit, seen.noise_std)}
        )
    return replace(sample, recordings=recordings)


FEW, ALL = ("clock-lag", "blade-friction", "dulling"), None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lag", "tried"),
    [(0.05, FEW), (0.0, ALL), (0.05, ALL)],
)
def test_a_late_clock_is_named_where_it_is(lag, tried):
    found = tj.diagnose(late(tj.read(CUT), lag), "neo-hookean", effects=tried).as_dict()
    named = {e["name"]: e["parameters"] for e in found["effects"]}
    assert ("clock-lag" in named) == (lag > 0)
    assert "blade-friction" in named
    if lag:
        assert named["clock-lag"]["effects.clock-lag.lag"]["value"] == pytest.approx(lag, rel=0.1)

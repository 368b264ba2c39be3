"""The long vector of a probing bench: every component of force and markers as a segment, with its sigma.

Sigma is the stated noise. What mesh and step leave open is a part of the discrepancy (`probing_view`).
"""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from tissuejax.estimation.series import Driven, Segment, Series
from tissuejax.experiments.probing_predictor import ProbingPredictor
from tissuejax.recordings.recording import Channel, Sample

CHANNELS = ("force", "markers")
FEWEST = 8  # samples of a series worth having


def series(sample: Sample, ready: ProbingPredictor) -> tuple[list[Segment], np.ndarray, np.ndarray]:
    """All force and marker series cut into segments, with measurement and sigma."""
    recordings = sample.recordings
    touch, paths = {}, {}
    for name in ready.names:
        r = recordings[name]
        t, z = np.asarray(r.inputs["probe/time"], float), np.asarray(r.inputs["probe/position"], float)[:, 2]
        paths[name], touch[name] = (t, z), float(np.interp(float(ready.setups[name].test.first_touch), t, z))

    def pressed(name: str, channel: str, _: int) -> Driven:
        time = np.asarray(recordings[name].channels[channel].time, float)
        return np.maximum(touch[name] - np.interp(time, *paths[name]), 0.0), "depth", "m"

    def component(channel: str, _: int, j: int) -> str:
        axis = "xyz"[j % 3]
        return axis if channel == "force" else f"marker {j // 3} {axis}"

    wanted = {name: [c for c in CHANNELS if c in recordings[name].channels] for name in ready.names}
    cut = Series.of(sample, wanted, pressed, component, fewest=FEWEST)
    sigmas = [np.full(len(s.time), _stated(recordings[s.recording].channels[s.channel])) for s in cut.segments]
    return list(cut.segments), cut.y, np.concatenate(sigmas)


def _stated(channel: Channel) -> float:
    return float(channel.noise_std or 0.01 * np.nanstd(np.asarray(channel.values, float)))


def kept_samples(sample: Sample, segments: Sequence[Segment]) -> dict[int, np.ndarray]:
    """Which samples of its channel a segment holds, by the start of its rows."""
    out = {}
    for s in segments:
        values = np.asarray(sample.recordings[s.recording].channels[s.channel].values, float)
        out[s.rows.start] = np.isfinite(values.reshape(len(values), -1)[:, column(s)])
    return out


def picked(values: np.ndarray, s: Segment, finite: Mapping) -> np.ndarray:
    """The rows of a segment out of a channel's full array."""
    flat = values.reshape(len(values), -1)
    return flat[finite[s.rows.start], column(s)]


def put(full: np.ndarray, s: Segment, finite: Mapping, vector: np.ndarray) -> None:
    """The reverse: a segment's rows of the long vector into a channel's full array."""
    full.reshape(len(full), -1)[finite[s.rows.start], column(s)] = vector[s.rows]


def filled(values: np.ndarray) -> np.ndarray:
    """Lost samples (NaN) read off the line between their neighbours in time; 0 where a column has none at all.

    A lost marker must not stand at the origin: its neighbours in time are read next to it once a clock is shifted.
    """
    out = np.array(values, float)
    flat = out.reshape(len(out), -1)
    index = np.arange(len(out))
    for j in range(flat.shape[1]):
        good = np.isfinite(flat[:, j])
        flat[~good, j] = np.interp(index[~good], index[good], flat[good, j]) if good.any() else 0.0
    return out


def column(s: Segment) -> int:
    """Column of a segment in its channel's array, all trailing axes flat."""
    axis = "xyz".index(s.component[-1])
    return axis if s.channel == "force" else 3 * int(s.component.split()[1]) + axis


def calmed(segments: Sequence[Segment], difference: Float[np.ndarray, " N"], passage: float) -> Float[np.ndarray, " N"]:
    """A difference of two runs, each series smoothed by a Gaussian.

    Args:
        difference: long vector.
        passage: width, s: the time that a pressure wave takes through the tissue. Of a wave that stands between probe
            and support (period twice that) 0.7 % is left, of one against a free surface (four times) 29 %.
    """
    out = np.empty(len(difference))
    for s in segments:
        spacing = float(np.median(np.diff(s.time))) if len(s.time) > 1 else passage
        out[s.rows] = gaussian_filter1d(np.asarray(difference[s.rows], float), passage / spacing, mode="nearest")
    return out

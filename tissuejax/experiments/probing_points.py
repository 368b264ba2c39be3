"""What stands beside the body in a series of states: the probe's tip, the markers, and how far off each one is."""

from pathlib import Path

import meshio
import numpy as np
from jaxtyping import Float

from tissuejax.recordings.recording import Recording

PROBE, MARKER = 0, 1  # point data "kind"


def tip_at(recording: Recording, t: float) -> Float[np.ndarray, "3"]:
    """Centre of the tip at time `t`, m."""
    time, path = np.asarray(recording.inputs["probe/time"]), np.asarray(recording.inputs["probe/position"])
    return np.array([np.interp(t, time, column) for column in path.T])


def markers_at(recording: Recording | None, t: float) -> Float[np.ndarray, "k 3"] | None:
    """Markers at the sample nearest to time `t`, m; None without any."""
    channel = None if recording is None else recording.channels.get("markers")
    if channel is None:
        return None
    return np.asarray(channel.values, float)[int(np.argmin(np.abs(np.asarray(channel.time) - t)))]


def write_points(predicted: Recording, t: float, target: Path, measured: Recording | None = None) -> Path:
    """Tip and predicted markers at time `t` as points of a VTU file, m.

    Point data: kind (0 the tip, 1 a marker), radius (of the tip, 0 of a marker), residual (measured minus predicted;
    zero where nothing was measured) and seen (1 where it was).
    """
    shown, real = markers_at(predicted, t), markers_at(measured, t)
    shown = np.zeros((0, 3)) if shown is None else shown
    gap = np.full_like(shown, np.nan) if real is None else real - shown
    seen = np.all(np.isfinite(gap), axis=1)
    places = np.concatenate([tip_at(predicted, t)[None], np.nan_to_num(shown)])
    data = {
        "kind": np.array([PROBE] + [MARKER] * len(shown)),
        "radius": np.array([float(predicted.attributes["probe/radius"])] + [0.0] * len(shown)),
        "residual": np.concatenate([np.zeros((1, 3)), np.where(seen[:, None], gap, 0.0)]),
        "seen": np.concatenate([[0], seen.astype(int)]),
    }
    meshio.Mesh(places, [("vertex", np.arange(len(places))[:, None])], data).write(target)
    return target

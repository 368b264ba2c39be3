"""A cutting recording made ready: the path of the blade, where it meets tissue, and the force against its motion."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from tissuejax.arrays import Given
from tissuejax.errors import InputError
from tissuejax.recordings.recording import Channel, Geometry, Recording, Sample

FORCE = "cutting_force"
ANGLE = 30.0  # degrees between the bevels where a file does not say
START = 1e-3  # m: a record whose blade is deeper in the tissue than this at its first sample starts in the cut
TURNING = 3.0  # bevels
FACTOR = 1e-2  # a thickness of more than this in m is not a blade's


class Path(NamedTuple):
    """The blade's way, on its own clock; n samples.

    Attributes:
        time: s. x: of the edge, from where the tissue begins, m. speed: along x, m/s.
        front: how far the cut has come, m. fresh: share of the motion that parts new tissue, 0 to 1.
        depth: of the cut, m. length: of the tissue along the path, m.
        thickness: of the blade, m. angle: between the bevels, radians. half: tissue on either side, m.
        notch: how far the cut reached before the start, m.
    """

    time: Float[Given, " n"]
    x: Float[Given, " n"]
    speed: Float[Given, " n"]
    front: Float[Given, " n"]
    fresh: Float[Given, " n"]
    depth: Float[Given, " n"]
    length: Float[Given, ""]
    thickness: Float[Given, ""]
    angle: Float[Given, ""]
    half: Float[Given, ""]
    notch: Float[Given, ""]


def path_of(recording: Recording, geometry: Geometry) -> Path:
    """The path of a cutting recording through the bounding box of its sample.

    The edge stands where its mean over the depth is; a cut made before reaches to attribute `notch` (m along x).

    Raises:
        InputError: a thickness that is no blade's, a path that never enters or runs beside the tissue, a record that
            starts in the cut.
    """
    time = np.asarray(recording.inputs["blade/time"], float)
    tip = np.asarray(recording.inputs["blade/tip"], float)
    low, high = np.asarray(geometry.points).min(0), np.asarray(geometry.points).max(0)
    thickness = float(recording.attributes["blade/thickness"])
    where = f"recording {recording.name}"
    if not 0 < thickness < FACTOR:
        raise InputError(f"{where}: blade/thickness {thickness:.4g} m; a blade has 0.0002 to 0.01 m: is it in mm?")
    y = float(np.median(tip[:, 1]))
    half = min(y - low[1], high[1] - y)
    if half < thickness:
        raise InputError(
            f"{where}: the blade runs at y = {1e3 * y:.1f} mm, the tissue lies between {1e3 * low[1]:.1f} and "
            f"{1e3 * high[1]:.1f} mm: the cut would be off the tissue; check the frame and the units"
        )
    profile = np.asarray(recording.attributes["blade/profile"], float)
    edge = float(np.mean(profile[:, 0] - profile[0, 0]))
    x = tip[:, 0] + edge - low[0]
    depth = recording.inputs.get("depth")
    depth = high[2] - np.maximum(tip[:, 2], low[2]) if depth is None else np.asarray(depth, float)
    notch = float(recording.attributes.get("notch", low[0])) - low[0]
    if x[0] > START and notch < x[0] - START:
        raise InputError(
            f"{where}: the record starts in the cut: the edge stands {1e3 * x[0]:.1f} mm inside the tissue at t = "
            f"{time[0]:.4g} s. Entry tells the strength and zero of the force: record from before contact, or say "
            "with the "
            "attribute `notch` how far the cut reached already (a second pass)"
        )
    if x.max() < START:
        raise InputError(
            f"{where}: the blade never enters the tissue (edge at most {1e3 * x.max():.1f} mm); check frame"
        )
    length = float(high[0] - low[0])
    front = np.clip(np.maximum.accumulate(np.maximum(x, notch)), 0, length)
    step = np.diff(x, prepend=x[0])
    grown = np.diff(front, prepend=front[0])
    moved = np.where(np.abs(step) > 1e-12, step, 1.0)
    fresh = np.clip(np.where(np.abs(step) > 1e-12, grown / moved, 0.0), 0, 1)
    moving = np.maximum.accumulate(np.where(np.abs(step) > 1e-12, np.arange(len(step)), 0))
    fresh = fresh[moving]  # at rest the blade is held by what it was parting
    speed = np.gradient(x, time)
    angle = np.radians(float(recording.attributes.get("blade/angle", ANGLE)))
    inside = (x > 0) & (x < length)
    return Path(
        time, x, speed, front, fresh, np.where(inside, np.maximum(depth, 0), 0.0), length, thickness, angle, half, notch
    )


def bevel_of(path: Path) -> float:
    """Length of a bevel along the way, m."""
    return float(0.5 * path.thickness / np.tan(path.angle / 2))


def steady(path: Path, time: Float[np.ndarray, " m"]) -> np.ndarray:
    """True where a balance of energies has something to say: not at a turn of the blade nor within `TURNING` bevels
    after it, of the end of a cut made before or of the far side of the tissue, nor within one of the entry."""
    bevel = bevel_of(path)
    step = np.diff(path.x, prepend=path.x[0])
    heading = np.sign(np.where(np.abs(step) > 1e-9, step, 0.0))
    last, since, way = 1.0, np.inf, np.zeros(len(step))
    for i, (h, d) in enumerate(zip(heading, np.abs(step), strict=True)):
        turned = h != 0 and h != last
        last, since = (h, 0.0) if turned else (last, since + d)
        way[i] = since
    old = np.maximum.accumulate(np.concatenate([[path.notch], path.front[:-1]]))
    joining = (np.abs(path.x - old) < TURNING * bevel) & np.isfinite(way)
    out = (path.x > path.length - bevel) | (np.abs(path.x) < bevel)
    turn = heading != np.append(heading[1:], heading[-1])  # a sample at a turn belongs to neither stroke
    calm = (way > TURNING * bevel) & (heading != 0) & ~turn & ~joining & ~out
    return np.interp(time, path.time, calm) > 0.99


def against_motion(recording: Recording) -> Float[np.ndarray, " f"]:
    """Force against the cut, N: minus the x component of the tissue's force on the blade, or x where files have it so.

    Which of the two is read from the record itself: pushing a blade forward is never helped by the tissue.
    """
    channel = recording.channels["force"]
    force = np.asarray(channel.values, float)[:, 0]
    time = np.asarray(recording.inputs["blade/time"], float)
    speed = np.gradient(np.asarray(recording.inputs["blade/tip"], float)[:, 0], time)
    at = np.interp(np.asarray(channel.time), time, speed)
    return force if np.sum(force * at) > 0 else -force


def drawn(sample: Sample) -> Sample:
    """The sample with one more channel for each cut: `cutting_force`, the force against the motion, N.

    Raises:
        InputError: no body, or no cutting recording.
    """
    if sample.geometry is None:
        raise InputError(f"{sample.name}: a cutting needs the body: /geometry with points, cells and fixed")
    recordings = {}
    for name, r in sample.recordings.items():
        if r.experiment == "cutting" and FORCE not in r.channels:
            seen = r.channels["force"]
            made = Channel(np.asarray(seen.time), against_motion(r), "N", seen.noise_std)
            r = Recording(name, r.experiment, r.inputs, {FORCE: made}, r.attributes)
        recordings[name] = r
    return Sample(sample.name, recordings, sample.geometry, sample.density, sample.gravity, sample.source, sample.notes)

"""A probing sample from the files of a lab: body, path of the probe, force, markers, described by one TOML file.

    sample  = "phantom"
    density = "1060 kg/m^3"
    gravity = [0, 0, -9.81]
    [body]
    surface = "phantom.stl"          # or cloud = "points.csv", mesh = "body.vtu", slab = "20 mm"
    unit = "mm"
    edge = "6 mm"
    [[probing]]
    recording = "press"
    radius = "8 mm"
    probe   = { file = "probe.csv" }                            # columns time, x, y, z: the centre of the ball
    force   = { file = "force.csv", noise = "3 mN" }            # columns time, Fx, Fy, Fz: of the tissue on the probe
    markers = { file = "markers.c3d", noise = "0.1 mm" }        # C3D, TRC, or CSV of time, m1_x, m1_y, m1_z, ...
    [registration]                   # brings the probe's and the markers' frame to the body's
    unit = "mm"
    moving = [[0, 0, 0], [80, 0, 0], [0, 60, 0]]
    target = [[5, 5, 0], [85, 5, 0], [5, 65, 0]]

Columns are found by their names and units stand in them ("x (mm)", "Fz_N"); `columns = ["px", "py", "pz"]`, `time` and
`unit` in a table say otherwise, `sign = -1` turns it round, `rate = "10 Hz"` gives times to files without, `every = 5`
keeps each fifth point of a full field. Image correlation: a list of files, one a frame, makes markers of its points;
`z = "20 mm"` says how high a plane view lies. A file in a frame of its own has a `registration` of its own in its
table.
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tissuejax.errors import InputError, unknown
from tissuejax.mesh.body_files import body
from tissuejax.mesh.registration import Rigid, register
from tissuejax.mesh.series_files import Series, points_over_time, vector_over_time
from tissuejax.recordings.conversions import noise_estimate
from tissuejax.recordings.files import read_all
from tissuejax.recordings.places import resolve
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.units import factor, quantity

WHOLE = ("sample", "density", "gravity", "source", "notes", "body", "probing", "registration")
PART = ("recording", "radius", "edge", "start", "probe", "force", "markers", "table")
GRAVITY = 9.80665  # m/s^2, standard acceleration of gravity


def describes_a_body(path: Path) -> bool:
    """Whether a TOML file describes a probing of a body (it has a [body])."""
    try:
        return "body" in tomllib.loads(path.read_text("utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError):
        return False


def probing_sample(path: Path) -> Sample:
    """The sample that a probing side file describes; how it was made stands in its notes.

    Raises:
        InputError: the file and key, what was found, what was expected.
    """
    try:
        side = tomllib.loads(path.read_text("utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: found text that is not TOML ({error}), expected a probing side file") from error
    try:
        return _sample(side, path)
    except InputError as error:
        raise error if str(error).startswith(str(path)) else InputError(f"{path}: {error}") from error


def _sample(side: Mapping[str, Any], path: Path) -> Sample:
    for key in side:
        if key not in WHOLE:
            raise unknown("key", key, WHOLE)
    if not isinstance(side.get("body"), dict):
        raise InputError('body: found nothing, expected [body] with surface, cloud, mesh or slab, e.g. slab = "20 mm"')
    parts = side.get("probing")
    if not isinstance(parts, list) or not parts:
        raise InputError("probing: found nothing, expected one [[probing]] for each recording")
    made, notes, lift = body(side["body"], path)
    rigid = None
    if "registration" in side:
        rigid = _rigid(side["registration"])
        off = 1e3 * float(np.nanmax(rigid.residuals))
        notes.append(f"Registration by {len(rigid.residuals)} points, the worst {off:.2f} mm off.")
    recordings: dict[str, Recording] = {}
    for part in parts:
        for recording in _recordings(part, path, rigid, lift, float(np.ptp(made.points[:, 2])), notes):
            if recording.name in recordings:
                raise InputError(f"probing: two recordings are called {recording.name!r}; give each its own name")
            recordings[recording.name] = recording
    density = side.get("density")
    return Sample(
        str(side.get("sample", path.stem)),
        recordings,
        made,
        None if density is None else quantity(density, "kg/m^3", "density"),
        _gravity(side.get("gravity")),
        str(side.get("source", "")),
        " ".join([*([str(side["notes"])] if "notes" in side else []), *notes]),
    )


def _gravity(value: object) -> tuple[float, float, float] | None:
    if value is None or value is False:
        return None
    if value is True:
        return (0.0, 0.0, -GRAVITY)
    if not isinstance(value, list) or len(value) != 3 or not all(isinstance(v, int | float) for v in value):
        raise InputError(f"gravity: found {value!r}, expected three numbers in m/s^2, such as [0, 0, -9.81], or true")
    x, y, z = map(float, value)
    return x, y, z


def _rigid(table: Mapping[str, Any]) -> Rigid:
    for key in ("unit", "moving", "target"):
        if key not in table:
            raise InputError(
                f"registration.{key}: found nothing, expected unit, moving and target: the same points twice"
            )
    scale = factor(str(table["unit"]), "m")
    try:
        moving, target = (scale * np.array(table[k], float) for k in ("moving", "target"))
    except (ValueError, TypeError):
        raise InputError("registration: found lists of another shape, expected three numbers for each point") from None
    return register(moving, target)


def _recordings(
    part: Mapping[str, Any], path: Path, rigid: Rigid | None, lift: float, height: float, notes: list[str]
) -> list[Recording]:
    for key in part:
        if key not in PART:
            raise unknown("key in [[probing]]", key, PART)
    if "table" in part:
        return _tabled(str(part["table"]), path, height)
    for key in ("radius", "probe", "force"):
        if key not in part:
            raise InputError(f"probing.{key}: found nothing, expected radius, probe and force (markers may be missing)")
    radius = quantity(part["radius"], "m", "probing.radius")
    if not radius > 0:
        raise InputError(f"probing.radius: found {part['radius']!r}, expected the radius of the ball, above zero")
    up = np.array([0.0, 0.0, lift])  # the body was lifted onto z = 0, and what was measured in its frame goes with it
    own = {k: _own(part[k], rigid) for k in ("probe", "force", "markers") if k in part}
    probe = vector_over_time(part["probe"], path, "probe", "m")
    force = vector_over_time(part["force"], path, "force", "N")
    channels = {"force": Channel(force.time, _turned(force.values, own["force"]), "N", _noise(force, "N", "force"))}
    if "markers" in part:
        markers, frame = points_over_time(part["markers"], path), own["markers"]
        notes += [f"Markers: {sentence}." for sentence in markers.said]
        if markers.on_support and frame is None:
            notes.append(
                "Markers: the view is plane and its height is not said, so they lie at z = 0, where the body stands: "
                'say it with z = "20 mm" in markers, or bring them to the body with a registration of their own.'
            )
        moved = markers.values if frame is None else frame(markers.values)
        channels["markers"] = Channel(markers.time, moved + up, "m", _noise(markers, "m", "markers"))
    position = probe.values if own["probe"] is None else own["probe"](probe.values)
    attributes: dict[str, Any] = {"probe/radius": radius}
    if "edge" in part:
        attributes["probe/edge"] = quantity(part["edge"], "m", "probing.edge")
    if "start" in part:
        attributes["start"] = quantity(part["start"], "s", "probing.start")
    inputs = {"probe/time": probe.time, "probe/position": position + up}
    return [Recording(str(part.get("recording", "r1")), "probing", inputs, channels, attributes)]


def _own(spec: object, rigid: Rigid | None) -> Rigid | None:
    """The registration of one file, where it has another frame than the rest; else that of all."""
    own = spec.get("registration") if isinstance(spec, dict) else None
    if own is not None and not isinstance(own, dict):
        raise InputError(f"registration: found {own!r}, expected {{ unit = ..., moving = [...], target = [...] }}")
    return rigid if own is None else _rigid(own)


def _turned(values: np.ndarray, rigid: Rigid | None) -> np.ndarray:
    return values if rigid is None else values @ rigid.rotation.T


def _tabled(file: str, path: Path, height: float) -> list[Recording]:
    """The probings of a table's side file, pressed into the middle of the body from above.

    The tip touches at zero depth: its centre starts a radius above the body's height, as the side file may not know it.
    """
    found = []
    for name, sample in read_all(resolve(file, path)).items():
        for key, recording in sample.recordings.items():
            if recording.experiment != "probing":
                raise InputError(f"{file}: {key} is of kind {recording.experiment!r}, expected probings")
            position = np.array(recording.inputs["probe/position"], float)
            touching = float(recording.attributes.get("height", 0.0)) + float(recording.attributes["probe/radius"])
            position[:, 2] += height + float(recording.attributes["probe/radius"]) - touching
            inputs = {**recording.inputs, "probe/position": position}
            label = key if len(sample.recordings) > 1 or name == "sample" else name
            found.append(Recording(label, "probing", inputs, recording.channels, recording.attributes))
    return found


def _noise(series: Series, unit: str, what: str) -> float:
    """The noise level as stated, or the median over all components of what neighbouring samples differ by."""
    if series.noise is not None:
        stated = quantity(series.noise, unit, f"{what}.noise")
        if not stated > 0:
            raise InputError(
                f"{what}.noise: found {series.noise!r}, expected a standard deviation above zero; leave it out where "
                "the noise was not recorded"
            )
        return stated
    flat = series.values.reshape(len(series.time), -1)
    seen = [noise_estimate(series.time, c) for c in flat.T if np.isfinite(c).all()]
    found = float(np.median(seen)) if seen else 0.0
    if not found > 0:
        raise InputError(f'{what}.noise: can\'t be estimated from these data; give it, e.g. noise = "0.1 {unit}"')
    return found

"""Writing recording files, version 1: what is written reads back the same, or nothing is written."""

import os
from pathlib import Path

import h5py
import numpy as np

from tissuejax.errors import InputError
from tissuejax.recordings.hdf5 import MARK, read_labelled
from tissuejax.recordings.layouts import layout, scalars
from tissuejax.recordings.recording import Geometry, Recording, Sample
from tissuejax.storage import replacing


def write(sample: Sample, path: str | os.PathLike) -> Path:
    """Write a sample as a recording file, atomically, after reading the new file back with all checks.

    Raises:
        InputError: the sample lacks what the format requires (such as a noise level) or breaks one of its rules;
            nothing is written.
    """
    path = Path(path)
    with replacing(path) as temporary:
        with h5py.File(temporary, "w") as file:
            _put_sample(file, sample)
        read_labelled(temporary, path)
    return path


def _put_sample(file: h5py.File, sample: Sample) -> None:
    file.attrs["format"] = MARK
    file.attrs["version"] = 1
    file.attrs["sample"] = sample.name
    for name in ("density", "gravity", "source", "notes"):
        value = getattr(sample, name)
        if value is not None and value != "":
            file.attrs[name] = value
    if sample.geometry is not None:
        _put_geometry(file.create_group("geometry"), sample.geometry)
    # Creation order is kept so that recordings come back in the order they were given.
    group = file.create_group("recordings", track_order=True)
    for name, recording in sample.recordings.items():
        if not name or "/" in name or name == ".":
            raise InputError(f"recording {name!r}: a name in a recording file has no '/', and is not empty; rename it")
        _put_recording(group.create_group(name), recording)


def _put_geometry(group: h5py.Group, geometry: Geometry) -> None:
    group["points"] = np.asarray(geometry.points, float)
    group["cells"] = np.asarray(geometry.cells)
    group["cells"].attrs["cell_type"] = geometry.cell_type
    group["fixed"] = np.asarray(geometry.fixed)
    if geometry.surface_points is not None:
        group["surface_points"] = np.asarray(geometry.surface_points, float)


def _put_recording(group: h5py.Group, recording: Recording) -> None:
    group.attrs["experiment"] = recording.experiment
    left = dict(recording.attributes)
    for item in layout(recording.experiment):
        channel = recording.channels.get(item.channel) if item.role == "channel" else None
        if channel is not None:
            group[item.path] = np.asarray(channel.values, float)
            if item.time not in group:
                group[item.time] = np.asarray(channel.time, float)
            noise = channel.noise_std
        else:
            noise = left.pop(f"{item.path}/noise_std", None)
            values = recording.inputs.get(item.path) if item.role in ("input", "time") else left.pop(item.path, None)
            if values is None or item.path in group:
                continue
            group[item.path] = np.asarray(values, float)
        if noise is not None:
            owner = item.path.rpartition("/")[0]
            (group[owner] if owner else group[item.path]).attrs["noise_std"] = float(noise)
    for scalar in scalars(recording.experiment):
        value = left.pop(scalar.path, None)
        if value is not None:
            (group.require_group(scalar.owner) if scalar.owner else group).attrs[scalar.name] = float(value)
    for name, value in left.items():
        group.attrs[name] = value

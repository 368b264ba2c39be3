"""What is in a file, in numbers and words: for `tissuejax inspect` and for its figure (drawn in `report/`)."""

import os
from collections.abc import Mapping

import numpy as np

from tissuejax.errors import InputError
from tissuejax.recordings import checks, files
from tissuejax.recordings.recording import Recording, Sample


def describe(path: str | os.PathLike, name: str | None = None) -> dict[str, object]:
    """All samples of a file (or the one called `name`): format, recordings, ranges, noise, and remarks.

    Returns plain dicts, lists, numbers and text, ready for JSON.

    Raises:
        InputError: as `files.read`.
    """
    known = [name] if name else files.names(path)
    samples = [describe_sample(files.read(path, n)) for n in known]
    return {"file": os.fspath(path), "samples": samples}


def describe_sample(sample: Sample) -> dict[str, object]:
    """One sample: its body, its recordings, and remarks on what a fit should know."""
    found: dict[str, object] = {
        "sample": sample.name,
        "source": sample.source,
        "notes": sample.notes,
        "density": sample.density,
        "gravity": None if sample.gravity is None else list(sample.gravity),
    }
    if sample.geometry is not None:
        points = np.asarray(sample.geometry.points)
        found["geometry"] = {
            "points": len(points),
            "cells": len(sample.geometry.cells),
            "cell_type": sample.geometry.cell_type,
            "fixed": len(sample.geometry.fixed),
            "size": np.ptp(points, axis=0).tolist(),
            "surface_points": 0 if sample.geometry.surface_points is None else len(sample.geometry.surface_points),
        }
    found["recordings"] = [describe_recording(r) for r in sample.recordings.values()]
    found["remarks"] = remarks(sample)
    return found


def describe_recording(recording: Recording) -> dict[str, object]:
    """One recording: its kind, how long, what was done (ranges) and what was measured (ranges, noise)."""
    times = [np.asarray(v) for k, v in recording.inputs.items() if k.rpartition("/")[2] == "time"]
    times += [np.asarray(c.time) for c in recording.channels.values()]
    return {
        "name": recording.name,
        "experiment": recording.experiment,
        "duration": max(float(np.ptp(t)) for t in times),
        "inputs": {k: _range(v) for k, v in recording.inputs.items()},
        "channels": {
            k: {**_range(c.values), "unit": c.unit, "noise_std": c.noise_std, "rate": _rate(np.asarray(c.time))}
            for k, c in recording.channels.items()
        },
        "attributes": {k: np.asarray(v).tolist() if np.ndim(v) else v for k, v in recording.attributes.items()},
    }


def remarks(sample: Sample) -> list[str]:
    """Sentences on what is unusual and worth knowing before a fit; none where all is plain."""
    said = []
    try:
        checks.distinct(sample.recordings)
    except InputError as error:
        said.append(str(error))
    for name, recording in sample.recordings.items():
        for key, channel in recording.channels.items():
            values = np.asarray(channel.values)
            lost = np.isnan(values).reshape(len(values), -1).any(axis=1).mean()
            if lost > 0:
                share = float(np.isnan(values).mean())
                said.append(f"{name}: {share:.1%} of {key} is missing (NaN), in {lost:.0%} of the samples.")
            if not channel.noise_std:
                said.append(f"{name}: no noise level for {key}; a fit estimates it.")
        stretch = recording.inputs.get("stretch")
        if stretch is not None and abs(float(np.asarray(stretch)[0].max()) - 1.0) > 0.02:
            said.append(f"{name}: starts at stretch {np.asarray(stretch)[0]}, not at rest (1).")
    return said


def lines(described: Mapping[str, object]) -> list[str]:
    """The description of one sample as lines of text, a line a recording."""
    out = [f"sample {described['sample']}" + (f"  ({described['source']})" if described["source"] else "")]
    geometry = described.get("geometry")
    if geometry:
        size = " x ".join(f"{1e3 * s:.1f}" for s in geometry["size"])
        out.append(f"  body: {geometry['cells']} {geometry['cell_type']} cells, {geometry['points']} points, {size} mm")
    for r in described["recordings"]:
        out.append(f"  {r['name']}: {r['experiment']}, {r['duration']:.4g} s")
        for kind in ("inputs", "channels"):
            for name, c in r[kind].items():
                if name.rpartition("/")[2] == "time":
                    continue
                noise = f", noise {c['noise_std']:.3g}" if c.get("noise_std") is not None else ""
                unit = f" {c['unit']}" if "unit" in c else ""
                shape = " x ".join(str(n) for n in c["shape"])
                out.append(f"    {name}: {shape} values from {c['min']:.5g} to {c['max']:.5g}{unit}{noise}")
    return out + [f"  note: {remark}" for remark in described["remarks"]]


def _range(values: object) -> dict[str, object]:
    values = np.asarray(values, float)
    if not np.isfinite(values).any():
        return {"shape": list(values.shape), "min": None, "max": None}
    return {"shape": list(values.shape), "min": float(np.nanmin(values)), "max": float(np.nanmax(values))}


def _rate(time: np.ndarray) -> float | None:
    """Samples a second, by the median step."""
    return float(1.0 / np.median(np.diff(time))) if len(time) > 1 else None

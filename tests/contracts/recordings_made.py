"""Samples of every kind made from the layout tables, and small lab tables, for the tests of readers and writers."""

from pathlib import Path

import numpy as np

from tissuejax.recordings.layouts import LAYOUTS, NEEDS_GEOMETRY, layout, scalars
from tissuejax.recordings.recording import Channel, Geometry, Recording, Sample

SIZES = {"n": 7, "f": 5, "m": 4, "k": 3, "c": 6, "p": 8}


def recording(
    kind: str, rng: np.random.Generator, name: str = "r1", noise: float = 0.5, full: bool = True
) -> Recording:
    """A recording with everything its layout names (without the optional items if not `full`)."""
    made = {}
    for item in layout(kind):
        shape = tuple(SIZES.get(s, s) for s in item.shape)
        values = rng.uniform(0.6, 1.4, shape)
        made[item.path] = np.cumsum(values) if item.role == "time" else values
        if item.nan and full:
            made[item.path][1, 0] = np.nan
    items = [i for i in layout(kind) if full or not i.optional]
    inputs = {i.path: made[i.path] for i in items if i.role == "input"}
    timed = {i.shape[0] for i in items if i.role == "input"}
    times = {i.path: made[i.path] for i in items if i.role == "time" and i.shape[0] in timed}
    channels = {i.channel: Channel(made[i.time], made[i.path], i.unit, noise) for i in items if i.role == "channel"}
    attributes = {i.path: made[i.path] for i in items if i.role == "attribute"}
    attributes |= {s.path: float(rng.uniform(0.001, 1)) for s in scalars(kind) if full or not s.optional}
    if full:
        attributes["start"] = 12.5
        attributes |= {f"{i.path}/noise_std": 0.01 for i in items if i.noise and i.role == "input"}
    return Recording(name, kind, times | inputs, channels, attributes)


def cube() -> Geometry:
    """One hexahedron, its bottom held."""
    points = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], float)
    return Geometry(points, np.arange(8).reshape(1, 8), "hexahedron", np.arange(4), points[4:])


def sample(kind: str, seed: int = 0, noise: float = 0.5, full: bool = True) -> Sample:
    """A sample with one recording of a kind."""
    rng = np.random.default_rng(seed)
    geometry = cube() if kind in NEEDS_GEOMETRY else None
    gravity = (0.0, 0.0, -9.81) if full else None
    words = {"source": "made", "notes": "for a test"} if full else {}
    return Sample("s1", {"r1": recording(kind, rng, noise=noise, full=full)}, geometry, 1060.0, gravity, **words)


def same(a: Sample, b: Sample) -> None:
    """Assert that two samples are equal, value by value."""
    assert (a.name, a.density, a.gravity, a.source, a.notes) == (b.name, b.density, b.gravity, b.source, b.notes)
    assert list(a.recordings) == list(b.recordings)
    assert (a.geometry is None) == (b.geometry is None)
    for one in ("points", "cells", "fixed", "surface_points"):
        if a.geometry is not None:
            np.testing.assert_array_equal(getattr(a.geometry, one), getattr(b.geometry, one))
    for name, x in a.recordings.items():
        y = b.recordings[name]
        assert (x.name, x.experiment) == (y.name, y.experiment)
        for mine, other in ((x.inputs, y.inputs), (x.attributes, y.attributes)):
            assert mine.keys() == other.keys()
            for key in mine:
                np.testing.assert_array_equal(np.asarray(mine[key]), np.asarray(other[key]))
        assert x.channels.keys() == y.channels.keys()
        for key, channel in x.channels.items():
            np.testing.assert_array_equal(channel.values, y.channels[key].values)
            np.testing.assert_array_equal(channel.time, y.channels[key].time)
            assert (channel.unit, channel.noise_std) == (y.channels[key].unit, y.channels[key].noise_std)


KINDS = sorted(LAYOUTS)
UNI = """
file = "t.csv"
experiment = "uniaxial"
[columns]
time = { column = "t", unit = "ms" }
stretch = { column = "l" }
nominal_stress = { column = "P", unit = "kPa" }
"""
ROWS = "t,l,P\n0,1,0\n500,1.1,2\n1000,1.2,5\n"


def put(folder: Path, table: str = ROWS, side: str = UNI, name: str = "t.csv") -> Path:
    """A table and its side file; the path of the side file."""
    (folder / name).write_text(table)
    (folder / "s.toml").write_text(side)
    return folder / "s.toml"

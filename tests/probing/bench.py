"""A small probing for tests: a box of 192 hexes pressed by a ball, sensors in fewer frames than the real ones."""

import numpy as np

from tissuejax.energies import catalogue
from tissuejax.experiments.probing_settings import ProbingSettings
from tissuejax.mesh.columns import box
from tissuejax.model import Model
from tissuejax.recordings.recording import Channel, Recording, Sample

SIZE = (0.04, 0.036, 0.015)
BODY = box(SIZE, (8, 8, 3))
VALUES = {"energy.C10": 500.0, "energy.C20": 300.0, "volumetric.K": 10e3}
QUICK = ProbingSettings(mesh="file", compression=3.0, interval=0.04, step=8e-4, stiffness_damping=1e-4, processes=1)
MARKERS = np.array([[0.012, 0.003, 0.015], [-0.007, 0.011, 0.015], [0.001, -0.012, 0.015]])


def model(*effects) -> Model:
    return Model(catalogue.energy("reduced-polynomial-2"), catalogue.volumetric("quadratic"), effects)


def recording(name: str = "r1", place=(0.002, -0.001), depth: float = 3e-3, radius: float = 8e-3, **attributes):
    """Down, hold and up in 2.4 s, sliding sideways a little during the hold."""
    t = np.arange(0, 2.41, 0.01)
    z = SIZE[2] + radius + np.interp(t, [0, 0.2, 1.0, 1.6, 2.2, 2.4], [5e-4, 5e-4, -depth, -depth, 1e-3, 1e-3])
    x = place[0] + np.interp(t, [0, 1.0, 1.6, 2.4], [0, 0, 1e-3, 1e-3])
    path = np.stack([x, np.full_like(t, place[1]), z], 1)
    times, frames = np.arange(0.02, 2.4, 0.04), np.arange(0.02, 2.4, 0.0667)
    force = Channel(times, np.zeros((len(times), 3)), "N", 0.003)
    markers = Channel(frames, np.tile(MARKERS, (len(frames), 1, 1)), "m", 6e-5)
    return Recording(
        name, "probing", {"probe/time": t, "probe/position": path}, {"force": force, "markers": markers},
        {"probe/radius": radius, **attributes},
    )  # fmt: skip


def sample(*recordings: Recording, **what) -> Sample:
    recordings = recordings or (recording(),)
    given = {"geometry": BODY, "density": 1000.0} | what
    return Sample("bench", {r.name: r for r in recordings}, **given)


def measured(predicted: Recording, like: Recording, rng: np.random.Generator) -> Recording:
    """A prediction as a measurement with the sensors' noise."""
    channels = {}
    for name, channel in like.channels.items():
        values = np.asarray(predicted.channels[name].values, float)
        noisy = values + rng.normal(0, channel.noise_std, values.shape)
        channels[name] = Channel(channel.time, noisy, channel.unit, channel.noise_std)
    return Recording(like.name, like.experiment, like.inputs, channels, like.attributes)

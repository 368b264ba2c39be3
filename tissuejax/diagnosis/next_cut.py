"""The next cut to record: which further stroke tells the effects apart that this record can't.

Each proposal is a record that could be made; it is worth what it adds to the separation of two explanations: both are
fitted to the present record, their predictions of the new one are compared in units of its noise. Fitted parameters are
carried over; what the new record alone could adjust (its zero) is taken out.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from tissuejax.experiments.cutting_record import FORCE
from tissuejax.experiments.predictor import predictor
from tissuejax.model import Model
from tissuejax.recordings.recording import Channel, Recording, Sample


class Stroke(NamedTuple):
    """A record to make: what to do in words, the recording without a measurement, and by how many standard deviations
    of the noise (root of the sum over samples) two explanations differ in it."""

    what: str
    recording: Recording
    apart: float = 0.0


def planned(sample: Sample, name: str) -> tuple[Stroke, ...]:
    """Records that the same rig could make next: back in the same cut, through it again, half as fast, half as deep."""
    r = sample.recordings[name]
    time, tip = np.asarray(r.inputs["blade/time"], float), np.asarray(r.inputs["blade/tip"], float)
    top = float(np.asarray(sample.geometry.points)[:, 2].max())
    reached = float(tip[:, 0].max())
    profile = np.asarray(r.attributes["blade/profile"], float)
    edge = float(np.mean(profile[:, 0] - profile[0, 0]))
    shallow = tip.copy()
    shallow[:, 2] = top - 0.5 * (top - tip[:, 2])
    opened = {"notch": reached + edge}

    def made(key, time, tip, **more):
        inputs = {"blade/time": time, "blade/tip": tip}
        if "depth" in r.inputs:
            factor = 0.5 if key == "shallow" else 1.0
            inputs["depth"] = factor * np.interp(
                np.arange(len(time)), np.arange(len(time)), np.asarray(r.inputs["depth"])
            )
        noise = next(iter(r.channels.values())).noise_std
        empty = Channel(time, np.zeros((len(time), 3)), "N", noise)
        return Recording(key, "cutting", inputs, {"force": empty}, dict(r.attributes) | more)

    slow = made("slow", 4 * time, tip)
    return (
        Stroke("a second pass in the same cut", made("again", time, tip, **opened)),
        Stroke("the return stroke, recorded to the end", made("back", time, tip[::-1].copy(), **opened)),
        Stroke("the same cut in fresh tissue, four times slower", slow),
        Stroke("the same cut in fresh tissue, half as deep", made("shallow", time, shallow)),
    )


def next_cut(
    sample: Sample, name: str, one: tuple[Model, Mapping[str, float]], other: tuple[Model, Mapping[str, float]]
) -> tuple[Stroke, ...]:
    """Planned strokes, best first, by how far two fitted explanations differ in them.

    Args:
        one, other: model and fitted values of each explanation.
    """
    out = []
    for stroke in planned(sample, name):
        r = stroke.recording
        with_it = Sample(sample.name, {r.name: r}, sample.geometry, sample.density, sample.gravity)
        a, b = (
            np.asarray(predictor(model.across(()), with_it).predict(dict(values))[r.name].channels[FORCE].values)
            for model, values in (one, other)
        )
        noise = r.channels["force"].noise_std or 0.02 * float(np.abs(a).max())
        out.append(stroke._replace(apart=float(np.linalg.norm(a - b - np.mean(a - b)) / noise)))
    return tuple(sorted(out, key=lambda s: -s.apart))

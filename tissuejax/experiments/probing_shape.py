"""The body as it is when the probe is deepest: simulated once more with the probe stopped there, for pictures."""

from collections.abc import Mapping
from typing import NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Float, Int

from tissuejax.experiments import programs
from tissuejax.experiments.homogeneous import local
from tissuejax.experiments.probing_predictor import ProbingPredictor, _predict, _vector
from tissuejax.mesh.facets import boundary


class Deformed(NamedTuple):
    """One recording at its deepest moment.

    Attributes:
        name: of the recording. time: s, of the marker frame shown (of the deepest point without markers).
        points: deformed node positions, m. facets: the whole surface.
        centre, radius: of the probe's tip, m.
        rest, measured, simulated: markers, m; NaN where one was not seen.
    """

    name: str
    time: float
    points: Float[np.ndarray, "N 3"]
    facets: Int[np.ndarray, "S v"]
    centre: Float[np.ndarray, "3"]
    radius: float
    rest: Float[np.ndarray, "K 3"]
    measured: Float[np.ndarray, "K 3"]
    simulated: Float[np.ndarray, "K 3"]


def deformed(predictor: ProbingPredictor, values: Mapping[str, float], name: str) -> Deformed:
    """Simulate recording `name` down to its deepest point; the program is the one that predicts."""
    setup = predictor.setups[name]
    probe = setup.scene.pressed
    time, path = np.asarray(probe.time), np.asarray(probe.position)
    bottom = int(path[:, 2].argmin())
    held = np.where((np.arange(len(time)) <= bottom)[:, None], path, path[bottom])
    stopped = eqx.tree_at(lambda s: s.scene.probe.position, setup, held)
    theta = _vector(local(predictor.model, values, name))
    out = programs.run(_predict, predictor.model.across(()), theta, stopped)
    body, when = setup.scene.body, float(time[bottom])
    none = np.zeros((0, 3))
    rest = measured = simulated = none
    channel = predictor.sample.recordings[name].channels.get("markers")
    if channel is not None:
        clock = np.asarray(channel.time, float)
        frame = int(np.clip(np.searchsorted(clock, when), 0, len(clock) - 1))
        when, measured = float(clock[frame]), np.asarray(channel.values, float)[frame]
        count = len(measured)
        rest = np.asarray(setup.test.rest, float)[:count]
        simulated = np.asarray(out.channels["markers"], float)[frame, :count]
    return Deformed(
        name, when, np.asarray(body.points, float) + np.asarray(out.displacement, float),
        boundary(np.asarray(body.cells), body.element.cells).nodes, path[bottom].astype(float),
        float(probe.shape.reach()), rest, measured, simulated,
    )  # fmt: skip

"""Stiffness maps of probings: one reverse pass a recording gives the pull of the residual on every element.

With residual r = measured - predicted over sigma, the misfit falls by sum r dp/dlnk_e for every unit by which the
logarithm of element e's stiffness grows (see `stiffness_map`).
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.diagnosis.probing import ProbingBench
from tissuejax.diagnosis.probing_runs import COARSE
from tissuejax.diagnosis.probing_series import column
from tissuejax.diagnosis.stiffness_map import StiffnessMap
from tissuejax.experiments import workers
from tissuejax.experiments.probing import simulated
from tissuejax.experiments.probing_setup import Setup
from tissuejax.mesh.quality import cell_volumes
from tissuejax.model import Model


def pulled(model: Model, theta: Float[Array, " p"], setup: Setup, weights: dict[str, Array]) -> Float[Array, " E"]:
    """Derivative of sum weights * channels by the logarithm of every element's stiffness."""
    count = len(setup.scene.body.cells)

    def along(logarithm: Array) -> Array:
        scene = setup.scene.put({"tissue.stiffness": jnp.exp(logarithm)})
        channels = simulated(
            model, dict(zip(model.declared, theta)), eqx.tree_at(lambda s: s.scene, setup, scene)
        ).channels
        seen = {name: jnp.where(w != 0, channels[name], 0.0) for name, w in weights.items()}  # NaN where never seen
        return sum(jnp.sum(w * seen[name]) for name, w in weights.items())

    return jax.grad(along)(jnp.zeros(count, setup.scene.body.points.dtype))


def stiffness_maps(bench: ProbingBench, values: dict, prediction: Float[np.ndarray, " N"]) -> list[StiffnessMap]:
    """A map of every fitted recording, for the model at `values`."""
    jobs, made = [], []
    ready = bench.runs.ready[COARSE]
    for name in bench.fitted:
        _, bare, theta, setup = bench.runs.job(bench.at(values), name, COARSE)
        measured = ready.sample.recordings[name].channels
        channels = dict.fromkeys(s.channel for s in bench.segments if s.recording == name)
        weights = {c: np.zeros(np.shape(measured[c].values)) for c in channels}
        for s in bench.segments:
            if s.recording == name:
                flat = weights[s.channel].reshape(len(weights[s.channel]), -1)
                pull = (bench.y - prediction)[s.rows] / bench.sigma[s.rows] ** 2
                flat[bench.finite[s.rows.start], column(s)] = pull
        whole = {"force": (len(setup.force_times), 3), "markers": (len(setup.marker_times), len(setup.test.rest), 3)}
        padded = {
            c: np.pad(w, [(0, n - m) for n, m in zip(whole[c], w.shape, strict=True)]) for c, w in weights.items()
        }
        jobs.append((pulled, bare, theta, setup, padded))
    for name, gain in zip(bench.fitted, workers.run_all(jobs, ready.settings.processes), strict=True):
        body = ready.setups[name].scene.body
        points, cells = np.asarray(body.points, float), np.asarray(body.cells)
        volume = cell_volumes(points, cells, "hexahedron" if cells.shape[1] == 8 else "tetra")
        gain = np.asarray(gain, float)
        made.append(StiffnessMap(name, points, cells, points[cells].mean(1), gain, gain / volume))
    return made

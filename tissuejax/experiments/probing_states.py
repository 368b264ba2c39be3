"""The states a probing passes through, kept on disk for ParaView and pictures: the simulation behind a prediction."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tissuejax.experiments.homogeneous import local
from tissuejax.experiments.probing import assembled
from tissuejax.experiments.probing_points import write_points
from tissuejax.experiments.probing_predictor import ProbingPredictor
from tissuejax.progress import Progress
from tissuejax.recordings.recording import Recording
from tissuejax.tled.stream import run_to_file, to_vtu, to_xdmf

STATES = 24  # kept of a run


def keep_states(
    made: ProbingPredictor,
    values: Mapping[str, float],
    name: str,
    folder: Path,
    progress: Progress,
    states: int = STATES,
    predicted: Recording | None = None,
    measured: Recording | None = None,
) -> dict[str, Path]:
    """Simulate recording `name` and write its states: HDF5, an XDMF series over it, and VTU files with their PVD list.

    With `predicted` (and `measured`) each state has a second VTU file: the tip and the markers (`probing_points`).

    Returns:
        Paths: "states", "xdmf", "pvd".

    Raises:
        UnstableSimulation: the run broke down.
    """
    model = made.model.across(())
    scene, _ = assembled(model, local(made.model, values, name), made.setups[name])
    needed = scene.clock.frames if scene.clock.needed is None else int(scene.clock.needed)
    chunk = max(1, -(-needed // states))
    scene = scene.put({"clock.frames": needed, "clock.needed": None})
    folder.mkdir(parents=True, exist_ok=True)
    run = folder / f"{name}.states.h5"
    run.unlink(missing_ok=True)
    run_to_file(scene, run, progress, chunk=chunk)
    import h5py

    with h5py.File(run) as file:
        times = np.asarray(file["states/time"])
    pieces = [to_vtu(run, folder / f"{name}.{k:03d}.vtu", k) for k in range(len(times))]
    pvd = folder / f"{name}.pvd"
    parts = [pieces]
    if predicted is not None:
        marks = (folder / f"{name}.points.{k:03d}.vtu" for k in range(len(times)))
        parts.append([write_points(predicted, t, p, measured) for t, p in zip(times, marks, strict=True)])
    sets = "".join(
        f'<DataSet timestep="{t:.9g}" part="{k}" file="{p.name}"/>'
        for k, files in enumerate(parts)
        for t, p in zip(times, files, strict=True)
    )
    pvd.write_text(
        f'<?xml version="1.0"?><VTKFile type="Collection" version="0.1"><Collection>{sets}</Collection></VTKFile>'
    )
    return {"states": run, "xdmf": to_xdmf(run, folder / f"{name}.xdmf"), "pvd": pvd}

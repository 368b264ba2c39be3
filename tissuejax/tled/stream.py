"""Long runs in chunks: watched while they run, written as they go, stopped and resumed bit for bit.

A run is cut into chunks of `CHUNK` frames. After each one the failure check is looked at, channels and state are
appended to one HDF5 file, and progress is shown. A run that was stopped goes on from the last chunk in the file, and
because a run that was not stopped passes through the same chunks, both give the same bits. `to_xdmf` and `to_vtu`
make the stored states readable in ParaView.
"""

from pathlib import Path
from typing import TypeVar

import h5py
import jax
import jax.numpy as jnp
import meshio
import numpy as np

from tissuejax.errors import InputError
from tissuejax.progress import Progress, Silent
from tissuejax.tled.scene import Scene
from tissuejax.tled.simulate import COMPILER_OPTIONS, Outcome, check, proceed
from tissuejax.tled.step import State, machine, start

CHUNK = 64
SILENT = Silent()
Item = TypeVar("Item", h5py.Group, h5py.Dataset)
CHANNELS = ("time", "end_time", "force", "torque", "reaction", "work", "markers")


@jax.jit
def _rest(scene: Scene) -> State:
    return start(machine(scene))


def _go_on(scene: Scene, state: State) -> Outcome:
    return proceed(machine(scene), state)


_chunk = jax.jit(_go_on, compiler_options=COMPILER_OPTIONS)


def run_to_file(
    scene: Scene, path: str | Path, progress: Progress = SILENT, chunks: int | None = None, chunk: int = CHUNK
) -> Path:
    """Simulate a scene chunk by chunk into an HDF5 file; go on where the file ends.

    Args:
        scene: frames are rounded up to whole chunks.
        path: `/channels/*` grow by frames, `/states/displacement/K` (N, 3) after chunk K, `/resume` is the last state;
            `/probe` is the path of a round probe.
        progress: advanced after each chunk.
        chunks: stop after so many (None: to the end).
        chunk: frames in each; a run is gone on with in the chunks it began with.

    Raises:
        UnstableSimulation: with the file holding all that was computed before.
        InputError: a file that belongs to another scene.
    """
    path, scene = Path(path), scene.cast(scene.body.points.dtype)
    total = -(-scene.clock.frames // chunk)
    work = scene.put({"clock.frames": chunk})
    state = _rest(scene)
    with h5py.File(path, "a") as file:
        done = int(file.attrs.get("chunks", 0))
        if done:
            state = _load(file, state, path)
        else:
            file["points"], file["cells"] = np.asarray(scene.body.points), np.asarray(scene.body.cells)
            file.attrs["cell_type"] = scene.body.element.cells
            _tell_probe(file, scene.probe)
        stop = total if chunks is None else min(total, done + chunks)
        with progress.stage("simulating", total=stop - done) as stage:
            for k in range(done, stop):
                part = work.put({"clock.start": scene.clock.start + scene.clock.interval * (k * chunk)})
                out = _chunk(part, state)
                check(out, part)
                state = out.state
                for name in CHANNELS:
                    if getattr(out, name) is not None:
                        _append(file, f"channels/{name}", getattr(out, name))
                file[f"states/displacement/{k}"] = np.asarray(state.u.T)
                _append(file, "states/time", jnp.atleast_1d(out.end_time[-1]))
                _save(file, state)
                file.attrs["chunks"] = k + 1
                file.flush()
                stage.advance(note=f"t = {float(out.end_time[-1]):.3g} s")
    return path


def _tell_probe(file: h5py.File, probe) -> None:
    """Path (m, over s) and radius (m) of a round probe, so that a run can be shown with it."""
    if probe is None or not np.isfinite(float(probe.shape.reach())):
        return
    offset = 0.0 if probe.offset is None else np.asarray(probe.offset)
    file["probe/time"], file["probe/position"] = np.asarray(probe.time), np.asarray(probe.position) + offset
    file["probe/radius"] = float(probe.shape.reach())


def _stored(file: h5py.File, name: str, kind: type[Item]) -> Item:
    found = file[name]
    if not isinstance(found, kind):
        raise InputError(f"{file.filename}: found no {kind.__name__} {name}, expected a file of states")
    return found


def _cell_type(file: h5py.File) -> str:
    return str(file.attrs["cell_type"])


def _append(file: h5py.File, name: str, values) -> None:
    values = np.asarray(values)
    if name not in file:
        file.create_dataset(name, data=values, maxshape=(None, *values.shape[1:]), chunks=True)
        return
    series = _stored(file, name, h5py.Dataset)
    old = len(series)
    series.resize(old + len(values), axis=0)
    series[old:] = values


def _save(file: h5py.File, state: State) -> None:
    for i, leaf in enumerate(jax.tree.leaves(state)):
        name = f"resume/{i}"
        if name in file:
            _stored(file, name, h5py.Dataset)[...] = np.asarray(leaf)
        else:
            file[name] = np.asarray(leaf)


def _load(file: h5py.File, like: State, path: Path) -> State:
    leaves, tree = jax.tree.flatten(like)
    count = len(_stored(file, "resume", h5py.Group))
    stored = [_stored(file, f"resume/{i}", h5py.Dataset)[...] for i in range(count)]
    if [s.shape for s in stored] != [leaf.shape for leaf in leaves]:
        raise InputError(f"{path} holds the run of another scene (states of other shapes); give a new file name")
    return jax.tree.unflatten(tree, [jnp.asarray(s) for s in stored])


def to_xdmf(path: str | Path, target: str | Path) -> Path:
    """The stored states as an XDMF time series for ParaView: a small text that points into the HDF5 file."""
    path, target = Path(path), Path(target)
    with h5py.File(path) as file:
        times = _stored(file, "states/time", h5py.Dataset)[...]
        kind = _cell_type(file).capitalize().replace("Tetra", "Tetrahedron")
        points, cells = (_stored(file, name, h5py.Dataset).shape for name in ("points", "cells"))

    def item(name, shape, number):
        size = " ".join(map(str, shape))
        return f'<DataItem Dimensions="{size}" NumberType="{number}" Format="HDF">{path.name}:/{name}</DataItem>'

    grids = "".join(
        f'<Grid><Time Value="{t:.9g}"/>'
        f'<Topology TopologyType="{kind}" NumberOfElements="{cells[0]}">{item("cells", cells, "Int")}</Topology>'
        f'<Geometry GeometryType="XYZ">{item("points", points, "Float")}</Geometry>'
        f'<Attribute Name="displacement" AttributeType="Vector" Center="Node">'
        f"{item(f'states/displacement/{k}', points, 'Float')}</Attribute></Grid>"
        for k, t in enumerate(times)
    )
    series = f'<Grid GridType="Collection" CollectionType="Temporal">{grids}</Grid>'
    target.write_text(f'<Xdmf Version="3.0"><Domain>{series}</Domain></Xdmf>')
    return target


def to_vtu(path: str | Path, target: str | Path, index: int = -1) -> Path:
    """One stored state as a mesh file (VTU or whatever meshio makes of the suffix), displacement as point data."""
    with h5py.File(path) as file:
        k = range(len(_stored(file, "states/displacement", h5py.Group)))[index]
        names = ("points", "cells", f"states/displacement/{k}")
        points, cells, displacement = (_stored(file, name, h5py.Dataset)[...] for name in names)
        meshio.Mesh(points, [(_cell_type(file), cells)], {"displacement": displacement}).write(target)
    return Path(target)

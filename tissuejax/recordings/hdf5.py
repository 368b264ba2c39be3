"""Recording files, version 1 (HDF5): reading, with every check of the format.

The layouts of the experiment kinds are data in `layouts.py`; here is the engine that walks them. Writing is in
`hdf5_writing.py`.
"""

import re
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import h5py
import numpy as np

from tissuejax.errors import InputError, unknown
from tissuejax.recordings import checks
from tissuejax.recordings.format import Format
from tissuejax.recordings.hdf5_items import WHOLE, Holder, Source, attribute, path_of, plain, shape_text
from tissuejax.recordings.layouts import CELL_NODES, LAYOUTS, NEEDS_GEOMETRY, Item, Scalar, layout, scalars
from tissuejax.recordings.recording import Channel, Geometry, Recording, Sample

MARK = "tissue-recording"
SIGNATURE = b"\x89HDF\r\n\x1a\n"
Found = TypeVar("Found")


class Hdf5(Format):
    """Recording format version 1: one sample a file."""

    name = "HDF5 recording file (version 1)"
    endings = (".h5", ".hdf5")

    def recognises(self, path: Path, head: bytes) -> bool:
        """By the HDF5 signature."""
        return head.startswith(SIGNATURE)

    def names(self, path: Path) -> list[str]:
        """The one sample's name."""
        return [_with_file(path, path, lambda file, source: source.required_text(file, "sample"))]

    def read(self, path: Path, name: str = "") -> Sample:
        """The sample of the file; there is one, so `name` need not be given."""
        return read_labelled(path, path)


def read_labelled(path: Path, label: Path) -> Sample:
    """The sample in the file at `path`, which messages call `label`.

    Raises:
        InputError: the file, the HDF5 path, what was found and what was expected.
    """
    return _with_file(path, label, _sample)


def _with_file(path: Path, label: Path, use: Callable[[h5py.File, Source], Found]) -> Found:
    try:
        with h5py.File(path, "r") as file:
            return use(file, Source(label))
    # h5py tells of damage by many kinds of errors.
    except (OSError, RuntimeError, KeyError, ValueError, TypeError, MemoryError) as error:
        raise InputError(
            f"{label}: found a file that HDF5 can't read ({error}), expected a whole {Hdf5.name}. "
            "It may be cut short or damaged: copy or export it again."
        ) from error


def _sample(file: h5py.File, source: Source) -> Sample:
    _refuse_links(file, source)
    mark = source.text(file, "format")
    if mark != MARK:
        found = "nothing" if mark is None else repr(mark)
        raise source.refusal("/ attribute 'format'", found, repr(MARK), "Is it an HDF5 file of another kind?")
    version = source.number(file, "version")
    if version != 1:
        found = "nothing" if version is None else f"version {version:g}"
        raise source.refusal("/ attribute 'version'", found, "1", "This program reads version 1 only.")
    name = source.required_text(file, "sample")
    density = source.number(file, "density")
    if density is not None:
        checks.positive(density, source.label, "/ attribute 'density'", "a density in kg/m^3", zero=True)
    gravity = None
    if "gravity" in file.attrs:
        gravity = source.array("/ attribute 'gravity'", file.attrs["gravity"], (3,), {})
        checks.finite(gravity, source.label, "/ attribute 'gravity'")
    group = file.get("recordings")
    if not isinstance(group, h5py.Group) or not len(group):
        raise source.refusal("/recordings", "no recordings" if group else "nothing", "a group with recordings in it")
    recordings = {key: _recording(group[key], source) for key in _in_order(group)}
    geometry = _geometry(file, source)
    if geometry is None:
        for key, recording in recordings.items():
            if recording.experiment in NEEDS_GEOMETRY:
                needed = f"points, cells and fixed: recording {key!r} is of kind {recording.experiment!r}"
                raise source.refusal("/geometry", "nothing", needed)
    return Sample(
        name=name,
        recordings=recordings,
        geometry=geometry,
        density=density,
        gravity=None if gravity is None else tuple(gravity.tolist()),
        source=source.text(file, "source") or "",
        notes=source.text(file, "notes") or "",
    )


def _refuse_links(group: h5py.Group, source: Source) -> None:
    """Refuse links and storage outside the file: a file that was sent could show other files of the reader's."""
    for name in group:
        link = group.get(name, getlink=True)
        place = f"{path_of(group).rstrip('/')}/{name}"
        if isinstance(link, h5py.ExternalLink):
            advice = "A recording file holds its own data: copy them in."
            raise source.refusal(place, f"a link to another file ({link.filename})", "data in this file", advice)
        if isinstance(link, h5py.SoftLink):
            raise source.refusal(
                place, f"a soft link to {link.path}", "data in their own place", "Copy the data there."
            )
        item = group[name]
        if isinstance(item, h5py.Group):
            _refuse_links(item, source)
        elif isinstance(item, h5py.Dataset) and (item.external or item.is_virtual):
            advice = "A recording file holds its own data: copy them in."
            raise source.refusal(place, "data stored in another file", "data in this file", advice)


def _in_order(group: h5py.Group) -> list[str]:
    """Names in the order of writing where the file kept it, else r2 before r10."""
    if group.id.get_create_plist().get_link_creation_order():
        return list(group)
    return sorted(group, key=lambda n: [int(p) if p.isdigit() else p for p in re.split(r"(\d+)", n)])


def _recording(group: Holder | h5py.Datatype, source: Source) -> Recording:
    if not isinstance(group, h5py.Group):
        raise source.refusal(path_of(group), "a dataset", "a group, one a recording")
    kind = source.required_text(group, "experiment", "the kind of experiment")
    if kind not in LAYOUTS:
        wrong = unknown("experiment kind", kind, LAYOUTS)
        raise source.refusal(attribute(group, "experiment"), repr(kind), "a kind of the format", str(wrong))
    # Attributes that the format doesn't name are kept as they are.
    attributes = {k: plain(v) for k, v in group.attrs.items() if k != "experiment"}
    start = source.number(group, "start")
    if start is not None:
        attributes["start"] = start
    sizes: dict[str, int] = {}
    inputs, channels = {}, {}
    items = layout(kind)
    read = {item.path: values for item in items if (values := _item(group, item, sizes, source)) is not None}
    for item in items:
        if item.path not in read or item.role == "time":
            continue
        values = read[item.path]
        noise = _noise(group, item, source)
        if item.role == "channel":
            channels[item.channel] = Channel(read[item.time], values, item.unit, noise)
            continue
        (inputs if item.role == "input" else attributes)[item.path] = values
        if noise is not None:
            attributes[f"{item.path}/noise_std"] = noise
    timed = {i.shape[0] for i in items if i.role == "input" and i.path in inputs}
    times = {i.path: read[i.path] for i in items if i.role == "time" and i.shape[0] in timed}
    for scalar in scalars(kind):
        value = _scalar(group, scalar, source)
        if value is not None:
            attributes[scalar.path] = value
    return Recording(path_of(group).rsplit("/", 1)[-1], kind, times | inputs, channels, attributes)


def _item(group: h5py.Group, item: Item, sizes: dict[str, int], source: Source) -> np.ndarray | None:
    place = f"{path_of(group)}/{item.path}"
    owner, _, leaf = item.path.rpartition("/")
    found = group.get(item.path)
    if found is None and item.role == "attribute" and owner in group:
        found = group[owner].attrs.get(leaf)
    if found is None:
        # Half an optional group is a mistake, not "not recorded".
        if item.optional and not (owner and owner in group):
            return None
        raise source.refusal(place, "nothing", f"a dataset of shape {shape_text(item.shape)} in {item.unit}")
    if isinstance(found, h5py.Group):
        raise source.refusal(place, "a group", f"a dataset of shape {shape_text(item.shape)}")
    values = source.array(place, found, item.shape, sizes)
    checks.finite(values, source.label, place, item.nan)
    if item.role == "time":
        checks.increasing(values, source.label, place)
    if item.stretch:
        checks.stretches(values, source.label, place)
    return values


def _noise(group: h5py.Group, item: Item, source: Source) -> float | None:
    """`noise_std` of the dataset or of the subgroup that it lies in; None where it was not recorded."""
    if not item.noise:
        return None
    owner = item.path.rpartition("/")[0]
    holders = [source.holder(group, path) for path in (item.path, owner) if path]
    for holder in holders:
        value = source.number(holder, "noise_std")
        if value is not None:
            checks.noise_level(value, source.label, attribute(holder, "noise_std"), item.unit)
            return value
    return None


def _scalar(group: h5py.Group, scalar: Scalar, source: Source) -> float | None:
    """A number that is an attribute of its owner, or of a dataset in it, or a dataset of its own."""
    holders: list[Holder] = [group]
    if scalar.owner and scalar.owner in group:
        owner = source.holder(group, scalar.owner)
        inside = owner.values() if isinstance(owner, h5py.Group) else ()
        holders = [owner, *(d for d in inside if isinstance(d, h5py.Dataset))]
    elif scalar.owner:
        holders = []
    place = attribute(holders[0] if holders else group, scalar.name)
    value = None
    for holder in holders:
        if scalar.name in holder.attrs:
            place, value = attribute(holder, scalar.name), source.number(holder, scalar.name)
    if value is None and isinstance(group.get(scalar.path), h5py.Dataset):
        place = f"{path_of(group)}/{scalar.path}"
        value = float(source.dataset(group, scalar.path, ()))
    if value is None:
        if scalar.optional:
            return None
        raise source.refusal(place, "nothing", f"a number in {scalar.unit}, above zero")
    checks.positive(value, source.label, place, f"a number in {scalar.unit}")
    return value


def _geometry(file: h5py.File, source: Source) -> Geometry | None:
    group = file.get("geometry")
    if group is None:
        return None
    if not isinstance(group, h5py.Group):
        raise source.refusal("/geometry", "a dataset", "a group")
    points = source.dataset(group, "points", ("N", 3))
    cells = source.dataset(group, "cells", ("E", "k"), WHOLE)
    fixed = source.dataset(group, "fixed", ("F",), WHOLE)
    kind = source.required_text(source.holder(group, "cells"), "cell_type", f"one of {', '.join(CELL_NODES)}")
    if CELL_NODES.get(kind) != cells.shape[1]:
        found = f"cell_type {kind!r} with {cells.shape[1]} nodes a cell"
        raise source.refusal("/geometry/cells", found, "'hexahedron' with 8 or 'tetra' with 4")
    for name, nodes in (("cells", cells), ("fixed", fixed)):
        if nodes.min() < 0 or nodes.max() >= len(points):
            found = f"node numbers from {nodes.min()} to {nodes.max()}"
            raise source.refusal(
                f"/geometry/{name}", found, f"0 to {len(points) - 1}, there being {len(points)} points"
            )
    surface = source.dataset(group, "surface_points", ("S", 3)) if "surface_points" in group else None
    return Geometry(points, cells, kind, fixed, surface)

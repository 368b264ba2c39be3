"""Reading and writing recordings, whatever their format: the one door to files of measured data.

    sample = read("liver.h5")
    sample = read("fits/ecoflex/ecoflex.toml#EF10_0T")      # one sample of many
    write(sample, "ecoflex.h5")

The format is chosen by the content of a file, then by its ending; a new format is one new file in this folder.
"""

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import tissuejax.recordings as folder
from tissuejax.errors import InputError, unknown
from tissuejax.families import members
from tissuejax.recordings import checks
from tissuejax.recordings.format import Format
from tissuejax.recordings.hdf5_writing import write
from tissuejax.recordings.places import refuse_no_file
from tissuejax.recordings.recording import Sample
from tissuejax.storage import shown

__all__ = ["formats", "names", "read", "read_all", "reader", "write"]

BODIES = (".stl", ".ply", ".obj", ".off", ".vtu", ".vtk", ".msh", ".inp")  # endings of surfaces and meshes


def formats() -> dict[str, Format]:
    """The formats that can be read, by name."""
    return {name: kind() for name, kind in members(folder, Format).items()}


def names(path: str | os.PathLike) -> list[str]:
    """The names of the samples in a file, in file order."""
    path, chosen = _split(path)
    if chosen:
        return [chosen]
    with _readable(path):
        known = _format(path).names(path)
    for name in known:
        checks.named(name, path, "sample")
    return known


def read(path: str | os.PathLike, name: str | None = None) -> Sample:
    """The sample in a file.

    Args:
        path: a recording file or a side file; "file#NAME" means `name`.
        name: which sample, where the file holds several.

    Raises:
        InputError: no such file, an empty file, an unknown format, anything the format's checks refuse, several
            samples and no name, or an unknown name.
    """
    path, chosen = _split(path)
    name = name or chosen
    with _readable(path):
        kind = _format(path)
        known = kind.names(path)
    if name is None:
        if len(known) > 1:
            first = ", ".join(known[:8]) + (", ..." if len(known) > 8 else "")
            raise InputError(
                f"{path}: found {len(known)} samples ({first}), expected one: name it as {path}#{known[0]}"
            )
        name = known[0]
    if name not in known:
        raise InputError(f"{path}: {unknown('sample', name, known)}")
    return _one(kind, path, name)


def read_all(path: str | os.PathLike) -> dict[str, Sample]:
    """Every sample of a file by name, in file order."""
    known, one = reader(path)
    return {name: one(name) for name in known}


def reader(path: str | os.PathLike) -> tuple[list[str], Callable[[str], Sample]]:
    """The names of a file's samples, in file order, and what reads one of them; each may be refused by itself."""
    path, chosen = _split(path)
    with _readable(path):
        kind = _format(path)
        known = [chosen] if chosen else kind.names(path)
    return known, partial(_one, kind, path)


def _one(kind: Format, path: Path, name: str) -> Sample:
    with _readable(path):
        sample = kind.read(path, name)
    checks.named(sample.name, path, "sample")
    for recording in sample.recordings:
        checks.named(recording, path, "recording")
    checks.noise_levels(sample.recordings, path)
    return sample


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """What the operating system refuses becomes one sentence about the file."""
    try:
        yield
    except OSError as error:
        name = shown(error.filename or path)
        raise InputError(
            f"{name}: can't be read ({error.strerror or error}); check its rights and its disk, or name another file"
        ) from error


def _split(path: str | os.PathLike) -> tuple[Path, str | None]:
    text = os.fspath(path)
    if "#" in text and not Path(text).exists():
        text, _, name = text.rpartition("#")
        return Path(text), name or None
    return Path(text), None


def _format(path: Path) -> Format:
    known: Mapping[str, Format] = formats()
    what = "; ".join(f"{name} ({', '.join(f.endings)})" for name, f in known.items())
    refuse_no_file(path, what)
    with open(path, "rb") as file:
        head = file.read(4096)
    if not head:
        raise InputError(f"{path}: found an empty file, expected one of: {what}")
    for kind in known.values():
        if kind.recognises(path, head):
            return kind
    if path.suffix.lower() in BODIES:
        raise InputError(
            f"{path}: found a body, expected recordings: name it in the side file of a probing, as `surface` or `mesh` "
            "of [body] beside a [[probing]] for each press (docs/own-probing.md; data/probing is an example)"
        )
    raise InputError(f"{path}: found a file of another format, expected one of: {what}")

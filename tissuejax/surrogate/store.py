"""One HDF5 file: format version, what is in it, its errors, the tables, and a hash that tells a damaged file."""

import hashlib
import json
from pathlib import Path

import equinox as eqx
import h5py
import jax
import numpy as np

from tissuejax.errors import InputError
from tissuejax.storage import plain, replacing
from tissuejax.surrogate.cardinal import Table
from tissuejax.surrogate.drag import Rub
from tissuejax.surrogate.precompute import Precomputed
from tissuejax.surrogate.surrogate import Memory, Rig, Surface, Surrogate

FORMAT, VERSION = "tissuejax surrogate", 3


def write(made: Precomputed, path: str | Path) -> Path:
    """Write the file, whole or not at all; numbers of the shape in single precision."""
    arrays = _arrays(made)
    record = dict(made.record) | {"hash": _hash(arrays)}
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        file.attrs["format"], file.attrs["version"] = FORMAT, VERSION
        file.attrs["record"] = json.dumps(plain(record))
        for name, values in arrays.items():
            options = {"compression": "gzip", "shuffle": True} if values.size > 1000 else {}
            file.create_dataset(name, data=values, **options)
    return Path(path)


def read(path: str | Path) -> Precomputed:
    """Read and check a file.

    Raises:
        InputError: no such file, another kind or version, cut off, changed, or with a NaN.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such file; make one with `tissuejax precompute`")
    try:
        with h5py.File(path) as file:
            if file.attrs.get("format") != FORMAT:
                raise InputError(f"{path}: not a surrogate; `tissuejax precompute` writes one")
            version = int(file.attrs["version"])
            if version != VERSION:
                raise InputError(
                    f"{path}: version {version}, this program reads version {VERSION}; precompute it again"
                )
            record = json.loads(file.attrs["record"])
            arrays: dict[str, np.ndarray] = {}
            file.visititems(lambda n, d: arrays.update({n: d[...]}) if isinstance(d, h5py.Dataset) else None)
    except (OSError, KeyError, ValueError) as fault:
        raise InputError(f"{path}: damaged or cut off ({fault}); precompute it again") from fault
    bad = [n for n, v in arrays.items() if not np.isfinite(v).all()]
    if bad:
        raise InputError(f"{path}: {bad[0]} holds a value that is not a number; precompute it again")
    if _hash(arrays) != record.get("hash"):
        raise InputError(
            f"{path}: its content does not agree with its hash, it was changed or damaged; precompute it again"
        )
    try:
        return Precomputed(_surrogate(arrays, record), record, arrays["cells"])
    except KeyError as fault:
        raise InputError(f"{path}: {fault} is missing; precompute it again") from fault


def _named(part, prefix="") -> dict[str, np.ndarray]:
    found = {}
    for name, value in vars(part).items():
        if isinstance(value, eqx.Module):
            found |= _named(value, f"{prefix}{name}/")
        elif value is not None and not isinstance(value, tuple):
            found[f"{prefix}{name}"] = np.asarray(value)
    return found


def _arrays(made: Precomputed) -> dict[str, np.ndarray]:
    arrays = _named(jax.tree.map(np.asarray, made.surrogate))
    small = ("surface/modes", "surface/settled", "memory/")
    slim = {n: v.astype(np.float32) if n.startswith(small) else v for n, v in arrays.items()}
    return slim | {"cells": np.asarray(made.cells, np.int32)}


def _hash(arrays: dict[str, np.ndarray]) -> str:
    digest = hashlib.sha256()
    for name in sorted(arrays):
        digest.update(name.encode() + str(arrays[name].shape).encode() + np.ascontiguousarray(arrays[name]).tobytes())
    return digest.hexdigest()


def _surrogate(arrays: dict[str, np.ndarray], record: dict) -> Surrogate:
    def leaf(name):
        return np.asarray(arrays[name], float)

    def tab(name):
        return Table(*(leaf(f"{name}/{part}") for part in ("origin", "spacing", "coefficients")))

    def some(kind, group):
        return kind(*(leaf(f"{group}/{name}") for name in kind.__dataclass_fields__))

    memory = None
    if "memory/g" in arrays:
        memory = Memory(tab("memory/stress"), tab("memory/strain"), leaf("memory/g"), leaf("memory/tau"))
    surface = Surface(
        tuple(record["mesh"]), tab("surface/coefficients"), leaf("surface/modes"), tab("surface/settled_coefficients"),
        leaf("surface/settled"), tab("surface/lines"),
    )  # fmt: skip
    return Surrogate(
        leaf("low"), leaf("high"), leaf("depth"), leaf("radius"), tab("touch"), tab("law"), surface, memory,
        some(Rub, "rub"), some(Rig, "rig"), leaf("factor"),
    )  # fmt: skip

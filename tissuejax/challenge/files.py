"""Challenge cases on disk: recordings in format version 1, keys sealed in a folder of their own, a manifest of hashes.

DIR/manifest.json          what was made, and the hash of the sealed keys
DIR/cases/NAME.h5          what the diagnosis sees
DIR/sealed/keys.json       the truth, opened by grading alone
DIR/results/NAME/          what the diagnosis answered
"""

import hashlib
import json
from pathlib import Path

import h5py
import numpy as np

from tissuejax.challenge.material_cases import Case
from tissuejax.errors import InputError
from tissuejax.storage import replacing


def sha256(path: Path) -> str:
    """Hash of a file's bytes, as hexadecimal digits."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def write_material(case: Case, path: Path) -> None:
    """The recordings of a material-test case, without a word on the truth."""
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        file.attrs.update({"format": "tissue-recording", "version": 1, "sample": case.name, "density": 1060.0})
        for trial in case.trials:
            group = file.create_group(f"recordings/{trial.name}")
            group.attrs["experiment"] = trial.kind
            for name in ("start", "area", "height", "diameter"):
                group.attrs[name] = float(getattr(trial, name))
            group["time"] = trial.time
            group["shear" if trial.kind == "simple-shear" else "stretch"] = trial.drive
            group["nominal_stress"] = case.stress[trial.name]
            if case.noise is not None:
                group["nominal_stress"].attrs["noise_std"] = case.noise
            group["direction"] = np.asarray(trial.direction, float)


def read_manifest(folder: Path) -> dict:
    """What `make` wrote.

    Raises:
        InputError: no manifest there.
    """
    path = Path(folder) / "manifest.json"
    if not path.exists():
        raise InputError(f"{path}: no such file; make a challenge first with `tissuejax challenge make {folder}`")
    return json.loads(path.read_text())


def read_keys(folder: Path, manifest: dict) -> dict:
    """The sealed keys by case name.

    Raises:
        InputError: missing, or not the ones whose hash the manifest holds.
    """
    path = Path(folder) / "sealed" / "keys.json"
    if not path.exists():
        raise InputError(
            f"{path}: the sealed keys are not here; put them back, or make the challenge again by its seed"
        )
    found = sha256(path)
    if found != manifest["keys_sha256"]:
        raise InputError(
            f"{path}: sha256 {found[:12]}, sealed was {manifest['keys_sha256'][:12]}; the keys were changed "
            "after the challenge was made, so nothing is graded"
        )
    return json.loads(path.read_text())

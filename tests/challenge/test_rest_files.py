"""A case with a rest on disk: what the diagnosis can read of it, and that the project reads it."""

import h5py
import numpy as np

from tissuejax.challenge.files import read_manifest
from tissuejax.challenge.make import make
from tissuejax.recordings.files import read


def test_every_case_is_a_recording_and_says_nothing_of_its_rest(tmp_path):
    make(tmp_path, "rest", 4, seed=1)
    for entry in read_manifest(tmp_path)["cases"]:
        path = tmp_path / "cases" / f"{entry['name']}.h5"
        sample, kept = read(path), read(tmp_path / "kept" / f"{entry['name']}.h5")
        assert "kept" not in sample.recordings
        assert list(kept.recordings) == ["kept"]
        assert not np.any(np.asarray(kept.recordings["kept"].channels["nominal_stress"].values))
        with h5py.File(path) as file:
            assert not {"rest", "effects", "category"} & set(file.attrs)

"""The project's own recordings: unchanged, reproducible, and saying what their closed form says."""

import hashlib
import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest

from tissuejax.recordings import files

DATA = Path(__file__).resolve().parents[2] / "data"
FOLDERS = sorted(p for p in DATA.iterdir() if p.is_dir() and not p.name.startswith((".", "_")))


def maker():
    spec = importlib.util.spec_from_file_location("make_demo", DATA / "make_demo.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda p: p.name)
def test_a_source_says_what_it_is_and_is_unchanged(folder):
    text = (folder / "README.md").read_text()
    for word in ("Units", "Provenance", "Licence"):
        assert word in text
    sums = dict(reversed(line.split()) for line in (folder / "SHA256SUMS").read_text().splitlines())
    assert set(sums) == {p.name for p in folder.iterdir()} - {"README.md", "SHA256SUMS"}
    for name, expected in sums.items():
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == expected, f"{name} has changed"


def test_the_script_makes_the_same_numbers(tmp_path):
    # Values, not bytes: the HDF5 library may lay them out otherwise in another version.
    maker().main(tmp_path)
    for name in ("elastic", "relaxing"):
        ours, new = files.read(DATA / "demo" / f"{name}.h5"), files.read(tmp_path / f"{name}.h5")
        assert list(ours.recordings) == list(new.recordings)
        for key, r in ours.recordings.items():
            np.testing.assert_allclose(r.inputs["stretch"], new.recordings[key].inputs["stretch"], rtol=1e-13)
            a, b = (s.recordings[key].channels["nominal_stress"].values for s in (ours, new))
            np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)


def test_the_elastic_sample_is_its_textbook_formula_plus_noise():
    """Uniaxial P = 2 (l - l^-2) W'(I1), planar P = 2 (l - l^-3) W'(I1), W' = C10 + 2 C20 (I1 - 3)."""
    truth = json.loads((DATA / "demo" / "truth.json").read_text())["elastic"]
    for r in files.read(DATA / "demo" / "elastic.h5").recordings.values():
        l = r.inputs["stretch"]
        planar = r.experiment == "planar"
        i1 = l**2 + l**-2 + 1 if planar else l**2 + 2 / l
        slope = truth["energy.C10"] + 2 * truth["energy.C20"] * (i1 - 3)
        left = r.channels["nominal_stress"].values - 2 * (l - l ** (-3 if planar else -2)) * slope
        n = len(left)
        assert n == 300
        assert abs(left.mean()) < 4 * truth["noise_std"] / np.sqrt(n)
        assert abs(left.std() / truth["noise_std"] - 1) < 4 / np.sqrt(2 * n)
        assert abs(np.corrcoef(left[1:], left[:-1])[0, 1]) < 4 / np.sqrt(n)


def test_the_relaxing_sample_relaxes_by_its_time_constant():
    """At a hold each isochoric stress is (1 - g) S_e + h, h decaying as exp(-t/tau): so does the nominal stress."""
    make = maker()
    truth = make.TRUTH["relaxing"]
    time = np.linspace(0, 30, 3001)
    stretch = np.interp(time, [0, 0.001, 30], [1, 1.3, 1.3])
    stress = make.nominal_stress("uniaxial", time, stretch, truth)
    rest = (1 - truth["fraction"]) * make.nominal_stress("uniaxial", time, stretch, make.TRUTH["elastic"])[-1]
    decay = np.log((stress[1:1001] - rest) / (stress[1] - rest))
    np.testing.assert_allclose(decay, -(time[1:1001] - time[1]) / truth["tau"], atol=2e-5)
    np.testing.assert_allclose(stress[1] / rest, 1 / (1 - truth["fraction"]), rtol=1e-2)

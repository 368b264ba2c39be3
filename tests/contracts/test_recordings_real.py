"""The side files under `fits/` read the real sets, and give the numbers that their sources state."""

from pathlib import Path

import numpy as np
import pytest

from tests.conftest import outside
from tissuejax.recordings import files

FITS = Path(__file__).resolve().parents[2] / "fits"


@pytest.fixture(autouse=True)
def shared(monkeypatch):
    monkeypatch.setenv("TISSUEJAX_SHARED", str(outside("recordings").parent))


def stress(recording):
    return recording.channels["nominal_stress"].values


COUNTS = {
    "rubber/rubber.toml": (3, 9),
    "ecoflex/ecoflex.toml": (19, 190),
    "ecoflex/ecoflex-each.toml": (190, 190),
    "human-brain/brain.toml": (4, 8),
    "human-brain/brain-to-failure.toml": (4, 4),
    "human-brain/brain-compound-shear.toml": (1, 10),
    "porcine-skin/skin.toml": (1, 5),
    "muscle-fibre/fibre.toml": (4, 16),
    "rat-tail-tendon/tendon.toml": (10, 10),
    "beef/beef.toml": (148, 148),
}


# 190 files, as one sample a material and one a specimen: ten seconds of reading each
@pytest.mark.parametrize("side", [pytest.param(s, marks=[pytest.mark.slow] * ("ecoflex" in s)) for s in COUNTS])
def test_every_sample_of_every_set_reads(side):
    found = files.read_all(FITS / side)
    assert (len(found), sum(len(s.recordings) for s in found.values())) == COUNTS[side]
    assert all(s.source for s in found.values())


def test_rubber():
    found = files.read_all(FITS / "rubber/rubber.toml")
    treloar = found["Treloar_1944"].recordings
    assert {k: r.experiment for k, r in treloar.items()} == {k: k for k in ("uniaxial", "equibiaxial", "planar")}
    pull = treloar["uniaxial"]
    np.testing.assert_allclose([pull.inputs["stretch"][-1], stress(pull)[-1]], [7.6, 6.3176e6])
    equibiaxial = found["Meunier_2008"].recordings["equibiaxial"]
    np.testing.assert_allclose([equibiaxial.inputs["stretch"][-1], stress(equibiaxial)[-1]], [2.06, 1.32e6], rtol=1e-3)


def test_ecoflex_loads_and_compressions():
    area = np.pi * 0.025**2
    for material, load in (("EF10_100T", 78), ("EF50_0T", 1167)):
        tests = files.read(FITS / "ecoflex/ecoflex.toml", material).recordings.values()
        assert np.mean([-stress(r).min() * area for r in tests]) == pytest.approx(load, abs=0.5)
        for r in tests:
            assert r.inputs["stretch"].min() == pytest.approx(1 / 3, abs=1e-3)


def test_brain():
    cortex = files.read(FITS / "human-brain/brain.toml", "CX").recordings
    axial = cortex["tension-compression"]
    at = dict(zip(axial.inputs["stretch"], stress(axial)))
    np.testing.assert_allclose([at[0.9], at[1.1]], [-1148.4, 415.1])
    assert cortex["shear"].inputs["shear"].max() == 0.2
    assert stress(cortex["shear"]).max() == pytest.approx(543.5)
    compound = files.read(FITS / "human-brain/brain-compound-shear.toml").recordings
    for label, expected in (("shear at 0.75", 300), ("shear at 1.05", 150)):
        r = compound[label]
        assert r.attributes["axial_stretch"] == float(label[-4:])
        assert np.interp(0.2, r.inputs["shear"], stress(r)) == pytest.approx(expected, rel=0.05)


def test_skin():
    equibiaxial = files.read(FITS / "porcine-skin/skin.toml").recordings["equibiaxial"]
    true = stress(equibiaxial)[-1] * equibiaxial.inputs["stretch"][-1]
    np.testing.assert_allclose(true, [0.365e6, 0.604e6], rtol=2e-3)


def test_muscle_fibre_peaks_and_noise():
    relaxed = files.read(FITS / "muscle-fibre/fibre.toml", "Relaxed").recordings
    peaks = [stress(relaxed[f"ramp {t} s"]).max() for t in ("0.1", "1", "10", "100")]
    np.testing.assert_allclose(peaks, [17.1e3, 12.0e3, 9.7e3, 8.0e3], rtol=7e-3)
    assert all(r.inputs["time"][0] == 0 and r.inputs["stretch"][0] == 1 for r in relaxed.values())
    assert all(100 < r.channels["nominal_stress"].noise_std < 3000 for r in relaxed.values())


def test_tendon_and_beef_forces():
    tendon = files.read_all(FITS / "rat-tail-tendon/tendon.toml")
    areas = {n: s.recordings["tension"].attributes["area"] for n, s in tendon.items()}
    peaks = [stress(s.recordings["tension"]).max() * areas[n] for n, s in tendon.items() if n.startswith("relax")]
    np.testing.assert_allclose([min(peaks), max(peaks)], [1.24, 3.26], rtol=5e-3)
    beef = [s.recordings["indentation"] for s in files.read_all(FITS / "beef/beef.toml").values()]
    forces = np.array([r.channels["force"].values[:, 2].max() for r in beef])
    np.testing.assert_allclose([forces.min(), np.median(forces), forces.max()], [0.55, 1.16, 9.7], rtol=0.01)

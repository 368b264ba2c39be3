"""Simulate and predict: the files they write hold what the textbook says, and go back in."""

import csv
import json
from importlib.util import find_spec

import numpy as np
import pytest

from tests.probing import bench
from tissuejax.cli import main
from tissuejax.errors import InputError
from tissuejax.experiments.probing_points import write_points
from tissuejax.experiments.virtual import corners
from tissuejax.recordings.files import read, write
from tissuejax.recordings.recording import Channel, Recording


def rows(path):
    with open(path) as file:
        return [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]


def test_corners_are_joined_by_lines():
    time, drive = corners("0:1 2:1.2 4:1.2", 2.0)
    np.testing.assert_allclose(time, [0, 0.5, 1, 1.5, 2, 2.5, 3, 3.5, 4])
    np.testing.assert_allclose(drive, [1, 1.05, 1.1, 1.15, 1.2, 1.2, 1.2, 1.2, 1.2])
    assert corners("0:1,1 1:1.2,1.1", 1.0)[1].shape == (2, 2)
    for wrong in ("0:1", "1:1 0:2", "a:b c:d", "0 1"):
        with pytest.raises(InputError, match="corners"):
            corners(wrong, 1.0)


def test_a_simulated_tension_test_is_the_textbook_one_and_can_be_fitted(tmp_path, capsys):
    path = ["--mode", "uniaxial", "--path", "0:1 10:1.4", "--rate", "4"]
    assert main(["simulate", "-e", "neo-hookean", "--set", "energy.mu=3 kPa", *path, "-o", str(tmp_path)]) == 0
    told = rows(tmp_path / "uniaxial-nominal_stress.csv")
    l = np.array([r["stretch (1)"] for r in told])
    np.testing.assert_allclose([r["nominal_stress (Pa)"] for r in told], 3000 * (l - l**-2), rtol=1e-6, atol=1e-4)
    assert {p.name for p in (tmp_path / "print").iterdir()} == {"simulated.svg", "simulated.pdf"}
    assert (tmp_path / "simulated.png").stat().st_size > 10000
    noisy = tmp_path / "noisy"
    again = ["-e", "neo-hookean", "--set", "energy.mu=3 kPa", *path, "--noise", "15 Pa", "-o", str(noisy), "--json"]
    assert main(["simulate", *again]) == 0
    capsys.readouterr()
    file = noisy / "neo-hookean-simulated.h5"
    assert read(file).recordings["uniaxial"].channels["nominal_stress"].noise_std == 15.0
    assert (
        main(["fit", str(file), "-e", "neo-hookean", "--multistart", "1", "-o", str(tmp_path / "fit"), "--json"]) == 0
    )
    fit = json.loads(capsys.readouterr().out)["parameters"]["energy.mu"]
    assert abs(fit["value"] - 3000) < 4 * fit["std"]
    predicted = ["predict", str(tmp_path / "fit" / "result.json"), str(file), "-o", str(tmp_path / "p"), "--json"]
    assert main(predicted) == 0
    apart = json.loads(capsys.readouterr().out)["errors"]["uniaxial/nominal_stress"]
    differences = []
    for row in rows(tmp_path / "p" / "uniaxial-nominal_stress.csv"):
        l = row["stretch (1)"]
        assert row["nominal_stress (Pa)"] == pytest.approx(fit["value"] * (l - l**-2), abs=1e-3)
        differences.append(row["nominal_stress measured (Pa)"] - row["nominal_stress (Pa)"])
        assert abs(differences[-1]) < 5 * 15 + 1
    assert apart["rmse"] == pytest.approx(np.sqrt(np.mean(np.square(differences))), rel=1e-6)
    assert apart["rmse"] == pytest.approx(15.0, rel=0.5)  # the noise that was added, 41 samples
    assert main([*predicted[:-1], "--force"]) == 0
    assert "RMSE" in capsys.readouterr().out


def test_what_cannot_be_simulated_is_refused(tmp_path, capsys):
    base = ["simulate", "-e", "neo-hookean", "-o", str(tmp_path)]
    assert main([*base, "--path", "0:1 1:1.1", "--states"]) == 2
    assert main([*base, "--path", "0:1 1:1.1", "--published", "in-vivo-1"]) == 2
    assert main([*base, "--path", "0:1 1:-1.1"]) == 2
    assert "positive" in capsys.readouterr().err


def test_tip_and_markers_stand_beside_the_states(tmp_path):
    meshio = pytest.importorskip("meshio")
    time = np.array([0.0, 1.0])
    inputs = {"probe/time": time, "probe/position": np.array([[0.0, 0.0, 0.03], [0.0, 0.0, 0.02]])}
    places = np.array([[[0.01, 0.0, 0.0], [0.0, 0.01, 0.0]]] * 2)
    moved = places + np.array([[[0.0] * 3] * 2, [[1e-4, 0.0, 0.0], [np.nan] * 3]])
    one, two = (
        Recording("r", "probing", inputs, {"markers": Channel(time, x, "m", 1e-5)}, {"probe/radius": 8e-3})
        for x in (places, moved)
    )
    mesh = meshio.read(write_points(one, 0.9, tmp_path / "p.vtu", two))
    np.testing.assert_allclose(mesh.points, [[0, 0, 0.021], *places[1]], atol=1e-12)
    assert mesh.point_data["radius"].tolist() == [8e-3, 0, 0]
    assert mesh.point_data["kind"].tolist() == [0, 1, 1]
    assert mesh.point_data["seen"].tolist() == [0, 1, 0]
    np.testing.assert_allclose(mesh.point_data["residual"], [[0] * 3, [1e-4, 0, 0], [0] * 3], atol=1e-15)
    bare = Recording("r", "probing", inputs, {}, {"probe/radius": 8e-3})
    assert len(meshio.read(write_points(bare, 0.0, tmp_path / "q.vtu")).points) == 1


@pytest.mark.slow
def test_states_of_a_probing_can_be_opened_and_pictured(tmp_path, capsys):
    meshio = pytest.importorskip("meshio")
    write(bench.sample(), tmp_path / "probe.h5")
    t = np.arange(0, 2.41, 0.05)
    z = 0.015 + 0.008 + np.interp(t, [0, 0.2, 1.0, 1.6, 2.2, 2.4], [5e-4, 5e-4, -3e-3, -3e-3, 1e-3, 1e-3])
    np.savetxt(tmp_path / "path.csv", np.stack([t, 0 * t, 0 * t, z], 1), delimiter=",", header="t,x,y,z", comments="")
    what = ["--body", str(tmp_path / "probe.h5"), "--path", str(tmp_path / "path.csv"), "--radius", "8 mm"]
    how = ["--states", "--compression", "10", "-o", str(tmp_path / "out"), "--json"]
    assert main(["simulate", "-e", "neo-hookean", "--set", "energy.mu=1 kPa", *what, *how]) == 0
    files = json.loads(capsys.readouterr().out)["files"]
    bodies = [meshio.read(p) for p in (tmp_path / "out").glob("probing.[0-9]*.vtu")]
    deepest = min(body.point_data["displacement"][:, 2].min() for body in bodies)
    assert deepest == pytest.approx(-3e-3, rel=0.05)  # between points of contact a node lies a little deeper
    assert len(list((tmp_path / "out").glob("probing.points.*.vtu"))) == len(bodies)
    assert ("probing picture" in files) == (find_spec("pyvista") is not None)

"""Tables that programs write and that `import` once refused: marked headers, thousands, no names, repeated columns."""

import zipfile

import numpy as np
import pytest

from tissuejax.cli import main
from tissuejax.mesh.probing_files import probing_sample
from tissuejax.recordings.files import read
from tissuejax.recordings.plausible import slips
from tissuejax.report.overview import Overview

T = np.linspace(0.0, 2000.0, 41)
U = 1e-3 * T  # mm, of 25 mm
F = 0.2 * U + 0.05 * U**2  # N, on 12 mm^2
SIZES = ["--height", "25mm", "--area", "12 mm^2"]


def written(path, *lines):
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def holds_it(path, recording="r1", times=1.0):
    r = read(path).recordings[recording]
    np.testing.assert_allclose(r.inputs["time"], T, atol=1e-3)
    np.testing.assert_allclose(r.inputs["stretch"], 1 + U / 25, rtol=1e-5)
    np.testing.assert_allclose(r.channels["nominal_stress"].values, times * F / 12e-6, rtol=1e-4)


def test_numpys_savetxt_is_read(tmp_path):
    path = tmp_path / "my.dat"
    np.savetxt(path, np.stack([T, U, F], 1), header="time(s) displacement(mm) force(N)")
    assert main(["import", str(path), *SIZES]) == 0
    holds_it(tmp_path / "my.toml")


@pytest.mark.parametrize(("mark", "decimal", "thousands"), [(";", ",", "."), (";", ".", ",")])
def test_marks_between_thousands(mark, decimal, thousands, tmp_path):
    def cell(v):
        return f"{v:,.7f}".translate(str.maketrans({",": thousands, ".": decimal}))

    rows = [mark.join(map(cell, row)) for row in zip(T, U, F, strict=True)]
    path = written(tmp_path / "my.csv", f"sep={mark}", mark.join(["Time (s)", "Weg (mm)", "Kraft (N)"]), *rows)
    assert main(["import", path, *SIZES]) == 0
    holds_it(tmp_path / "my.toml")


def test_columns_without_names_can_be_told(tmp_path, capsys):
    rows = [f"{t},0,{u},{f}" for t, u, f in zip(T, U, F, strict=True)]
    path = written(tmp_path / "my.csv", *rows)
    assert main(["import", path, "--columns", "time s, -, extension mm, load N", *SIZES]) == 0
    holds_it(tmp_path / "my.toml")
    for wrong, said in (("time s, blub mm", "blub"), ("time s, -, extension", "no unit"), ("time mm", "'s'")):
        assert main(["import", path, "--columns", wrong, "--force", *SIZES]) == 2
        assert said in capsys.readouterr().err


def test_columns_that_begin_again_are_another_specimen(tmp_path):
    rows = [f"{t},{u},{f},{t},{u},{2 * f}" for t, u, f in zip(T, U, F, strict=True)]
    head = [
        "Specimen 1,,,Specimen 2,,",
        ",".join(["Time", "Extension", "Load"] * 2),
        ",".join(["(s)", "(mm)", "(N)"] * 2),
    ]
    assert main(["import", written(tmp_path / "my.csv", *head, *rows), *SIZES]) == 0
    holds_it(tmp_path / "my.toml", "1")
    holds_it(tmp_path / "my.toml", "2", 2.0)


@pytest.mark.parametrize(("inside", "said"), [("curve.txt", "unpack"), ("xl/workbook.xml", "CSV")])
def test_an_archive_is_called_one(inside, said, tmp_path, capsys):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as packed:
        packed.writestr(inside, "1 2 3")
    assert main(["import", str(tmp_path / "a.zip")]) == 2
    assert said in capsys.readouterr().err


def indented(tmp_path):
    rows = [f"{t},{u},{f}" for t, u, f in zip(T, U, F, strict=True)]
    return written(tmp_path / "dent.csv", "Time (s),Indentation (mm),Force (N)", *rows)


def test_an_indentation_into_a_layer(tmp_path, capsys):
    path = indented(tmp_path)
    assert main(["import", path, "--radius", "5mm"]) == 0
    assert "--slab" in capsys.readouterr().out
    assert main(["import", path, "--radius", "5mm", "--slab", "12mm", "--force"]) == 0
    sample = probing_sample(tmp_path / "dent-body.toml")
    (r,) = sample.recordings.values()
    # the tip touches the layer's top at the start: its centre is a radius above, and comes down by the depth
    np.testing.assert_allclose(np.asarray(r.inputs["probe/position"])[[0, -1], 2], [17e-3, 15e-3], atol=1e-9)
    assert np.ptp(sample.geometry.points[:, 2]) == pytest.approx(12e-3)
    assert main(["import", path, "--radius", "5mm", "--slab", "0mm", "--force"]) == 2


def test_the_overview_leaves_out_what_was_not_measured(tmp_path):
    assert main(["import", indented(tmp_path), "--radius", "5mm"]) == 0
    shown, total = Overview().prepare(read(tmp_path / "dent.toml"))
    assert [c.channel for c in shown] == ["force z"]
    assert total == 1


def test_samples_without_a_time_are_counted_on_the_axis(tmp_path):
    held = np.where(T < 1000, U, 1.0)  # a hold: drawn over stretch and over time
    rows = [f"{u},{f}" for u, f in zip(held, F, strict=True)]
    path = written(tmp_path / "my.csv", "Displacement (mm),Force (N)", *rows)
    assert main(["import", path, *SIZES]) == 0
    plot = Overview()
    axes = plot.draw(plot.prepare(read(tmp_path / "my.toml"))).axes
    assert [ax.get_xlabel() for ax in axes] == ["stretch", "sample"]


def test_a_stress_that_was_set_is_no_saturated_sensor(tmp_path):
    rows = [f"{t},{0.1 * (1 - np.exp(-t / 300))},{min(t, 50.0)}" for t in T]
    path = written(tmp_path / "my.csv", "Time (s),Shear strain,Shear stress (kPa)", *rows)
    assert main(["import", path]) == 0
    sample = read(tmp_path / "my.toml")
    (said,) = [s for s in slips(sample, tuple(sample.recordings)) if "exactly" in s]
    assert "creep" in said


def test_the_template_of_a_cut_is_a_side_file_that_reads(tmp_path, capsys):
    assert main(["import", "--template", "cutting", str(tmp_path / "my.toml")]) == 0
    t = np.linspace(0, 1, 30)
    rows = [f"{a},{20 * a},{0.1 * a},0,{9}" for a in t]
    written(tmp_path / "my.csv", "t,x,Fx,Fz,deep", *rows)
    sample = read(tmp_path / "my.toml")
    (r,) = sample.recordings.values()
    assert r.experiment == "cutting"
    assert r.attributes["blade/thickness"] == pytest.approx(0.365e-3)
    np.testing.assert_allclose(np.ptp(np.asarray(r.inputs["blade/tip"]), axis=0).max(), 20e-3)

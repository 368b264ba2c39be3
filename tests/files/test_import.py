"""`tissuejax import` on tables as labs have them: what is guessed is what the table holds, and the side file runs."""

import json
import tomllib

import numpy as np
import pytest

from tissuejax.cli import main
from tissuejax.recordings.files import read
from tissuejax.recordings.guessing import guessed

T = np.linspace(0, 10, 41)
U = 0.5 * T  # mm, of 25 mm
F = 0.2 * U + 0.05 * U**2  # N, on 12 mm^2


def table(columns, rows, mark=",", decimal=".", above="", below="", encoding="utf-8", end="\n"):
    """Bytes of a table."""
    body = [mark.join(f"{v:.6g}".replace(".", decimal) for v in row) for row in rows]
    text = "\n".join([*([above] if above else []), *columns, *body, *([below] if below else [])]) + "\n"
    return text.replace("\n", end).encode(encoding)


ROWS = np.stack([T, U, F], axis=1)
LAYOUTS = {
    "plain": table(["Time (s),Displacement (mm),Force (N)"], ROWS),
    "semicolon, comma": table(["Zeit [s];Weg [mm];Kraft [N]"], ROWS, ";", ","),
    "units row": table(["Time,Extension,Load", "(sec),(mm),(N)"], ROWS, end="\r\n"),
    "tab, units row bare": table(["Test time\tCrosshead\tStandard force", "s\tmm\tN"], ROWS, "\t"),
    "latin-1": table(
        ["Prüfzeit;Standardweg;Standardkraft", "s;mm;N"], ROWS, ";", ",", "Prüfer;Müller", encoding="latin-1"
    ),
    "utf-16": table(["time_s,displacement_mm,force_N"], ROWS, encoding="utf-16"),
    "kN, um": table(["t in s;Weg in um;F in kN"], ROWS * [1, 1e3, 1e-3], ";", ","),
    "no names": table([], ROWS),
    "text after": table(["Time (s),Displacement (mm),Force (N)"], ROWS, below="\nEnd of test\n"),
}


@pytest.mark.parametrize("layout", [k for k in LAYOUTS if k != "no names"])
def test_one_command_makes_a_side_file_that_reads_right(layout, tmp_path, capsys):
    path = tmp_path / "my.csv"
    path.write_bytes(LAYOUTS[layout])
    code = main(["import", str(path), "--height", "25mm", "--area", "12 mm^2", "--json"])
    said = json.loads(capsys.readouterr().out)
    assert code == 0, said
    r = read(tmp_path / "my.toml").recordings["r1"]
    np.testing.assert_allclose(r.inputs["time"], T, atol=1e-4)
    np.testing.assert_allclose(r.inputs["stretch"], 1 + U / 25, rtol=1e-5)
    np.testing.assert_allclose(r.channels["nominal_stress"].values, F / 12e-6, rtol=1e-5)
    assert any("tension" in s for s in said["assumed"])


def test_columns_without_names_are_refused_with_what_to_do(tmp_path, capsys):
    (tmp_path / "my.csv").write_bytes(LAYOUTS["no names"])
    assert main(["import", str(tmp_path / "my.csv")]) == 2
    assert "--template" in capsys.readouterr().err


def test_sizes_in_the_key_lines_are_taken(tmp_path):
    above = "Specimen label;liver 3\nProbenlänge;25,0;mm\nBreite;6 mm\nDicke (mm);2,0\n"
    (tmp_path / "my.csv").write_bytes(
        table(["Zeit;Weg;Kraft", "(s);(mm);(N)"], ROWS, ";", ",", above, encoding="cp1252")
    )
    guess = guessed(tmp_path / "my.csv")
    assert guess.specimen == {"height": "25.0 mm", "width": "6 mm", "thickness": "2.0 mm"}
    assert guess.sample == "liver 3"


def test_what_is_lacking_is_said_and_a_side_file_written(tmp_path, capsys):
    (tmp_path / "my.csv").write_bytes(LAYOUTS["plain"])
    assert main(["import", str(tmp_path / "my.csv")]) == 2
    assert "height, area" in capsys.readouterr().out
    assert main(["inspect", str(tmp_path / "my.toml")]) == 2
    assert "measure it" in capsys.readouterr().err


SENSES = {
    # name of the file, sign of displacement and force in the table -> stretch at the end
    "pull": ("pull.csv", 1, 1, 1.2),
    "compression": ("compression-1.csv", 1, 1, 0.8),
    "both fall": ("a.csv", -1, -1, 0.8),
    "opposite": ("b.csv", 1, -1, 0.8),
}


@pytest.mark.parametrize("sense", SENSES)
def test_the_sense_of_the_load(sense, tmp_path):
    name, u, f, end = SENSES[sense]
    (tmp_path / name).write_bytes(table(["Time (s),Displacement (mm),Force (N)"], ROWS * [1, u, f]))
    assert main(["import", str(tmp_path / name), "--height", "25mm", "--area", "12 mm^2"]) == 0
    r = next(iter(read((tmp_path / name).with_suffix(".toml")).recordings.values()))
    assert r.inputs["stretch"][-1] == pytest.approx(end)
    assert np.sign(r.channels["nominal_stress"].values[-1]) == np.sign(end - 1)


def test_a_time_that_runs_backwards_is_left_out_and_said(tmp_path, capsys):
    rows = ROWS.copy()
    rows[20:, 0] -= 3
    (tmp_path / "my.csv").write_bytes(table(["Time (s),Strain,Stress (kPa)"], rows * [1, 0.1, 1]))
    assert main(["import", str(tmp_path / "my.csv")]) == 0
    out = capsys.readouterr().out
    assert "backwards at line 22" in out
    assert "No time was recorded" in read(tmp_path / "my.toml").notes


def test_specimens_side_by_side_become_recordings(tmp_path):
    rows = np.stack([U, F, 2 * F, 3 * F], axis=1)
    (tmp_path / "my.csv").write_bytes(table(["disp_mm,A1_force_N,A2_force_N,B_force_N"], rows))
    assert main(["import", str(tmp_path / "my.csv"), "--height", "25mm", "--area", "12mm2"]) == 0
    found = read(tmp_path / "my.toml").recordings
    assert list(found) == ["a1", "a2", "b"]
    np.testing.assert_allclose(found["b"].channels["nominal_stress"].values, 3 * F / 12e-6, rtol=1e-5)


def test_nothing_is_overwritten_unasked(tmp_path, capsys):
    (tmp_path / "my.csv").write_bytes(LAYOUTS["plain"])
    argv = ["import", str(tmp_path / "my.csv"), str(tmp_path / "x.h5"), "--height", "25mm", "--area", "12mm^2"]
    assert main(argv) == 0
    assert main(argv) == 2
    assert "--force" in capsys.readouterr().err
    assert main([*argv, "--force"]) == 0
    assert read(tmp_path / "x.h5").recordings["r1"].inputs["stretch"][-1] == pytest.approx(1.2)


@pytest.mark.parametrize(
    "kind", ["tension", "compression", "planar", "equibiaxial", "biaxial", "simple-shear", "probing"]
)
def test_each_template_is_a_side_file_that_reads(kind, tmp_path, capsys):
    assert main(["import", "--template", kind]) == 0
    text = capsys.readouterr().out
    told = tomllib.loads(text)
    columns = [c for spec in told["columns"].values() for c in (spec if isinstance(spec, list) else [spec])]
    names = [c["column"] for c in columns]
    rows = [[k * 0.5 if "time" in n else 1 + 0.01 * k if "stretch" in n else 0.1 * k for n in names] for k in range(30)]
    (tmp_path / "my.csv").write_bytes(table([",".join(names)], rows))
    (tmp_path / "my.toml").write_text(text)
    (recording,) = read(tmp_path / "my.toml").recordings.values()
    assert recording.experiment == ("uniaxial" if kind in ("tension", "compression") else kind)


def test_a_normal_force_is_no_load_of_a_shear_test(tmp_path):
    rows = np.stack([T, 2 * U, F, 0.1 + T], axis=1)
    (tmp_path / "my.csv").write_bytes(table(["time,shear strain,shear stress,normal force", "s,%,Pa,N"], rows))
    assert main(["import", str(tmp_path / "my.csv")]) == 0
    r = read(tmp_path / "my.toml").recordings["r1"]
    assert r.experiment == "simple-shear"
    np.testing.assert_allclose(r.inputs["shear"], 0.02 * U, rtol=1e-5)
    np.testing.assert_allclose(r.channels["nominal_stress"].values, F, rtol=1e-5)
    (tmp_path / "press.csv").write_bytes(table(["time (s),shear strain,normal force (N)"], rows[:, [0, 1, 3]]))
    assert main(["import", str(tmp_path / "press.csv")]) == 2


def test_a_rheometers_oscillation_is_a_shear_test(tmp_path, capsys):
    names = ["osc. stress\tangular frequency\ttime\tstrain\tG'", "Pa\trad/s\ts\t%\tPa"]
    rows = np.stack([F, 0 * T + 1, T, U, 0 * T + 100], axis=1)
    (tmp_path / "gel.txt").write_bytes(table(names, rows, "\t", above="Geometry\t40mm parallel plate\n"))
    assert main(["import", str(tmp_path / "gel.txt")]) == 0
    assert "amplitudes" in capsys.readouterr().out
    r = read(tmp_path / "gel.toml").recordings["r1"]
    assert r.experiment == "simple-shear"
    np.testing.assert_allclose(r.inputs["shear"], 0.01 * U, rtol=1e-5)
    np.testing.assert_allclose(r.channels["nominal_stress"].values, F, rtol=1e-5)


def test_names_wider_than_the_rows_count_from_the_left(tmp_path):
    (tmp_path / "my.csv").write_bytes(table(["time (s),strain,stress (kPa),s"], ROWS * [1, 0.1, 1]))
    assert main(["import", str(tmp_path / "my.csv")]) == 0
    r = read(tmp_path / "my.toml").recordings["r1"]
    np.testing.assert_allclose(r.channels["nominal_stress"].values, 1e3 * F, rtol=1e-5)


@pytest.mark.parametrize(("dead", "column"), [(1, "Displacement (mm)"), (2, "Force (N)")])
def test_a_column_that_does_not_move_tells_no_sense(dead, column, tmp_path):
    rows = ROWS.copy()
    rows[:, dead] = 0
    (tmp_path / "my.csv").write_bytes(table(["Time (s),Displacement (mm),Force (N)"], rows))
    guess = guessed(tmp_path / "my.csv")
    assert [s for s in guess.said if "sense" in s] == [
        f"the sense of the load can't be told, because {column!r} does not change: tension counts positive"
    ]
    assert not [s for s in guess.said if "fall" in s or "rise" in s]


def test_a_time_that_stands_still_is_not_called_running_backwards(tmp_path):
    rows = ROWS.copy()
    rows[1::2, 0] = rows[:-1:2, 0]
    (tmp_path / "my.csv").write_bytes(table(["Time (s),Displacement (mm),Force (N)"], rows))
    (said,) = (s for s in guessed(tmp_path / "my.csv").said if "time column" in s)
    assert "stands still at line 3 (two rows at 0)" in said


NAMED = {
    # names of deformation and load -> the side file's quantities
    "Compression (mm),Load (N)": ("displacement", "force"),
    "elongation (mm),tension (mN)": ("displacement", "force"),
    "Tension (%),Tension (kPa)": ("strain", "nominal_stress"),
    "lambda [-],P [kPa]": ("stretch", "nominal_stress"),
    "Traversenweg absolut (mm),Standardkraft (N)": ("displacement", "force"),
    "gauge length (mm),F1 (N)": ("length", "force"),
    "LVDT (mm),Channel 2 (N)": ("displacement", "force"),
}


@pytest.mark.parametrize("names", NAMED)
def test_what_columns_are_called(names, tmp_path):
    (tmp_path / "my.csv").write_bytes(table([f"time (s),{names}"], ROWS + [0, 1, 0]))
    guess = guessed(tmp_path / "my.csv")
    ((pair, _),) = guess.pairs
    assert tuple(g.quantity for g in pair) == NAMED[names]
    assert any("one column left" in s for s in guess.said) == ("LVDT" in names or "F1" in names)


@pytest.mark.parametrize("names", ["LVDT 1 (mm),LVDT 2 (mm),Load (N)", "Extension (mm),G' (kPa),E-modulus (kPa)"])
def test_what_may_be_several_things_is_asked_for(names, tmp_path, capsys):
    rows = np.stack([T, U, U, F], axis=1)
    (tmp_path / "my.csv").write_bytes(table([f"time (s),{names}"], rows))
    assert main(["import", str(tmp_path / "my.csv"), "--experiment", "equibiaxial"]) == 2
    assert "--template equibiaxial" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("names", "told"),
    [
        ("stretch x,stretch y,stress x (kPa),stress y (kPa)", ""),
        ("stretch_1,stretch_2,stress_1 (kPa),stress_2 (kPa)", ""),
        ("a,b,c,d", "time s, stretch, stretch, stress kPa, stress kPa"),
    ],
)
def test_two_axes_are_a_biaxial_test(names, told, tmp_path):
    rows = np.stack([T, 1 + U / 25, 1 + U / 50, F, 0.5 * F], axis=1)
    (tmp_path / "my.csv").write_bytes(table([f"time (s),{names}"], rows))
    assert main(["import", str(tmp_path / "my.csv"), *(["--columns", told] if told else [])]) == 0
    r = read(tmp_path / "my.toml").recordings["r1"]
    assert r.experiment == "biaxial"
    np.testing.assert_allclose(r.inputs["stretch"][-1], [1.2, 1.1])
    np.testing.assert_allclose(r.channels["nominal_stress"].values[-1], [1e3 * F[-1], 500 * F[-1]])


def test_tension_and_compression_name_columns_by_their_unit(tmp_path):
    (tmp_path / "my.csv").write_bytes(table(["t,u,f"], ROWS))
    (tmp_path / "my.toml").write_text(
        'file = "my.csv"\nexperiment = "compression"\n[columns]\ncompression = { column = "u", unit = "mm" }\n'
        'tension = { column = "f", unit = "N", sign = -1 }\n[specimen]\nheight = "25 mm"\narea = "12 mm^2"\n'
    )
    r = next(iter(read(tmp_path / "my.toml").recordings.values()))
    np.testing.assert_allclose(r.inputs["stretch"], 1 - U / 25, rtol=1e-5)
    np.testing.assert_allclose(r.channels["nominal_stress"].values, F / 12e-6, rtol=1e-5)


STATED = {
    "on one line": ("# gauge_length = 25 mm, area = 12 mm^2\n", {"height": "25 mm", "area": "12 mm^2"}),
    "with semicolons": ("Height = 25,5 mm; Diameter = 4 mm\n", {"height": "25.5 mm", "diameter": "4 mm"}),
    "in cells": ("Initial length (mm),25,Diameter (mm),4\n", {"height": "25 mm", "diameter": "4 mm"}),
    "in cells with units": ("Width,6,mm,Thickness,2,mm\n", {"width": "6 mm", "thickness": "2 mm", "height": "?"}),
    "by symbols": ("L0=25 mm\nA0=12 mm^2\n", {"height": "25 mm", "area": "12 mm^2"}),
    "A0, a length": ("L0=25 mm\nb0=6 mm\na0=2 mm\n", {"height": "25 mm", "width": "6 mm", "thickness": "2 mm"}),
    "a table": (
        "Specimen name,L0 (mm),Width (mm),Thickness (mm)\npig-3,25,6,2\n\n",
        {"height": "25 mm", "width": "6 mm", "thickness": "2 mm"},
    ),
}


@pytest.mark.parametrize("case", STATED)
def test_sizes_above_the_table(case, tmp_path):
    above, sizes = STATED[case]
    (tmp_path / "my.csv").write_bytes(table(["Time (s),Displacement (mm),Force (N)"], ROWS, above=above.rstrip("\n")))
    guess = guessed(tmp_path / "my.csv")
    assert guess.specimen == sizes
    assert guess.sample == ("pig-3" if case == "a table" else "my")
    if not guess.lacking:
        assert main(["import", str(tmp_path / "my.csv")]) == 0
        (r,) = read(tmp_path / "my.toml").recordings.values()
        np.testing.assert_allclose(r.inputs["time"], T, atol=1e-4)


def test_sizes_that_stand_in_columns(tmp_path):
    rows = np.concatenate([ROWS, np.tile([6.0, 2.0, 25.0], (len(T), 1))], axis=1)
    names = ["Time (s),Displacement (mm),Force (N),Width (mm),Thickness,L0 (mm)"]
    (tmp_path / "my.csv").write_bytes(table(names, rows))
    guess = guessed(tmp_path / "my.csv")
    assert guess.specimen == {"height": "25 mm", "width": "6 mm", "thickness": "2 mm"}
    assert any("'Thickness', which has no unit and is taken as mm" in s for s in guess.said)
    assert not guess.unused
    rows[-1, 3] = 5.5
    (tmp_path / "other.csv").write_bytes(table(names, rows))
    guess = guessed(tmp_path / "other.csv")
    assert guess.lacking == ("area",)
    assert any("'Width (mm)' is not the same in all rows" in s for s in guess.said)


CLOCKS = {
    "iso": lambda t: f"2024-03-01 12:00:{t:06.3f}",
    "of day": lambda t: f"9:59:{50 + t:06.3f}" if t < 10 else "10:00:00.000",
    "over midnight": lambda t: f"23:59:{55 + t:06.3f}" if t < 5 else f"00:00:{t - 5:06.3f}",
    "german, over midnight": lambda t: (
        f"31.01.2024 23:59:{55 + t:06.3f}" if t < 5 else f"01.02.2024 00:00:{t - 5:06.3f}"
    ),
    "one date in any order": lambda t: f"03/01/2024 1:00:{t:06.3f} PM",
}


@pytest.mark.parametrize("clock", CLOCKS)
def test_times_of_day_are_seconds_from_the_first(clock, tmp_path, capsys):
    rows = "".join(f"{CLOCKS[clock](t)},{e:.6g},{f:.6g}\n" for t, e, f in zip(T, U / 25, F))
    (tmp_path / "my.csv").write_text("Timestamp,Strain,Stress (kPa)\n" + rows)
    assert main(["import", str(tmp_path / "my.csv")]) == 0
    assert "assumed: 'Timestamp' holds times of day: read as seconds from the first one" in capsys.readouterr().out
    np.testing.assert_allclose(read(tmp_path / "my.toml").recordings["r1"].inputs["time"], T, atol=1e-3)


@pytest.mark.parametrize("cell", ["03/{d:02d}/2024 12:00:00", "day {d}"])
def test_a_time_that_can_not_be_read_is_said(cell, tmp_path, capsys):
    rows = "".join(f"{cell.format(d=k % 28 + 1)},{e:.6g},{f:.6g}\n" for k, (e, f) in enumerate(zip(U / 25, F)))
    (tmp_path / "my.csv").write_text("Time,Strain,Stress (kPa)\n" + rows)
    assert main(["import", str(tmp_path / "my.csv")]) == 0
    out = capsys.readouterr().out
    assert "'Time' can't be read as times" in out
    assert "samples are taken as 1 s apart" in out


def test_what_is_assumed_and_what_is_not_used_is_printed(tmp_path, capsys):
    rows = np.stack([T, U, F, 20 + 0 * T], axis=1)
    (tmp_path / "my.csv").write_bytes(table(["Time (s),Displacement (mm),Force (N),Room (degC)"], rows))
    assert main(["import", str(tmp_path / "my.csv"), "--height", "25mm", "--area", "12mm^2"]) == 0
    out = capsys.readouterr().out
    written = (tmp_path / "my.toml").read_text().splitlines()
    said = [line.removeprefix("# Assumed: ").rstrip(".") for line in written if line.startswith("# Assumed")]
    assert said
    assert all(f"assumed: {s}" in out for s in said)
    assert "not used: Room (degC)" in out


def test_a_diameter_under_pressure_is_no_displacement(tmp_path):
    (tmp_path / "my.csv").write_bytes(table(["Time (s),Diameter (mm),Pressure (mmHg)"], ROWS + [0, 5, 0]))
    assert main(["import", str(tmp_path / "my.csv")]) == 2


def test_a_load_that_rises_as_the_specimen_shortens_is_compression(tmp_path, capsys):
    rows = np.stack([T, 25 - U, F], axis=1)
    (tmp_path / "my.csv").write_bytes(table(["Time (s),Height (mm),Force (N)"], rows))
    assert main(["import", str(tmp_path / "my.csv"), "--height", "25mm", "--area", "12mm^2"]) == 0
    assert "'Force (N)' rises as the specimen shortens: compression counts positive" in capsys.readouterr().out
    r = read(tmp_path / "my.toml").recordings["r1"]
    assert r.inputs["stretch"][-1] == pytest.approx(0.8)
    np.testing.assert_allclose(r.channels["nominal_stress"].values, -F / 12e-6, rtol=1e-5)

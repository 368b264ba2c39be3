"""Raw exports: each reader returns the numbers that were worked out from the real file by other means."""

import os
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tissuejax.errors import InputError
from tissuejax.recordings.exports.export import BLOCK, by_description, recognised, table_exports
from tissuejax.recordings.exports.tracked import marker_export, marker_exports, tracked
from tissuejax.recordings.guessing import guessed

HERE = Path(__file__).parent / "vendor"
SHARED = Path(os.environ.get("TISSUEJAX_SHARED", Path(__file__).parents[3] / "shared")) / "vendor-files"
shared = pytest.mark.skipif(not SHARED.is_dir(), reason="no shared folder of vendor files (TISSUEJAX_SHARED)")


def exported(path, name):
    kind = recognised(path)
    assert kind is not None
    assert kind.name == name
    return kind.read(path)


def of_block(found, block, column):
    return found.columns.numbers(column)[found.columns.cells[BLOCK] == block]


def test_bluehill_raw_data():
    e = exported(HERE / "instron-bluehill-cyclic/Specimen_RawData_6.csv.gz", "instron-bluehill")
    number = e.columns.numbers
    assert len(e.columns.lines) == 18011
    assert e.units["Time"] == "sec"
    assert e.units["Extension"] == "mm"
    assert e.units["Load"] == "N"
    assert number("Time")[-1] == 360.06
    np.testing.assert_allclose([number("Load").min(), number("Load").max()], [-52.97507, 0.35677])
    np.testing.assert_allclose([number("Extension").min(), number("Extension").max()], [-12.04865, -2.04555])
    assert set(e.columns.text("Segment ID")) == {"22412", "22476"}
    assert set(number("Total Cycle Count")) == {0, 1, 2}
    assert e.header["Text Inputs : Specimen label"] == "22L.3"


def test_bluehill_results_alone_are_refused(tmp_path):
    path = tmp_path / "results.csv"
    path.write_text(
        '"Results Table 1"\n"","Maximum Load","Width"\n"","(N)","(mm)"\n"1","12.1","6.0"\n"2","13.0","6.1"\n'
    )
    with pytest.raises(InputError, match="table of results"):
        exported(path, "instron-bluehill")


def test_trios_creep():
    e = exported(HERE / "ta-trios-creep/creep_experiment.txt.gz", "ta-trios")
    number = e.columns.numbers
    assert len(e.columns.lines) == 483
    assert len(e.columns.cells) == 24
    assert e.blocks == ("Creep - 1",)
    assert e.units["Step time"] == "min"
    assert e.units["Stress"] == "MPa"
    assert e.units["Strain"] == "%"
    assert number("Step time")[-1] == 2.9003781636556
    assert number("Strain")[-1] == 13.1024721726591
    np.testing.assert_allclose(number("Torque"), 1533.98083057255)


def test_trios_becomes_simple_shear_in_si(tmp_path):
    from tissuejax.cli import main
    from tissuejax.recordings.files import read

    path = HERE / "ta-trios-creep/creep_experiment.txt.gz"
    assert main(["import", str(path), str(tmp_path / "creep.toml")]) == 0
    (r,) = read(tmp_path / "creep.toml").recordings.values()
    assert r.experiment == "simple-shear"
    assert r.inputs["shear"][-1] == pytest.approx(0.131024721726591)
    assert r.inputs["time"][-1] == pytest.approx(60 * 2.9003781636556)


def test_fischerscope():
    e = exported(HERE / "fischerscope/FS1.txt.gz", "fischerscope")
    assert len(e.blocks) == 10
    assert len(e.columns.lines) == 12000
    first = e.blocks[0]
    assert of_block(e, first, "t")[-1] == 120
    assert of_block(e, first, "h").max() == 1.53835
    assert e.columns.numbers("F").max() == 299.995
    assert e.units["F"] == "mN"


def test_afm_workshop():
    e = exported(HERE / "afm-workshop/force-distance.csv.gz", "afm-workshop")
    assert e.blocks == ("extend", "retract")
    extend, retract = (of_block(e, way, "Force(nN)") for way in e.blocks)
    assert len(extend) == len(retract) == 1015
    np.testing.assert_allclose([extend.min(), extend.max()], [1244.4072, 4240.6828])
    np.testing.assert_allclose([retract.min(), retract.max()], [380.7126, 3809.6950])


def test_hand_written_instron_headers():
    plain = guessed(HERE / "instron-minimal/sample_bluehill.csv", sizes={"height": "100mm", "area": "100 mm^2"})
    assert {g.quantity: g.unit for g in plain.pairs[0][0]} == {"displacement": "mm", "force": "kN"}
    e = exported(HERE / "instron-minimal/sample_wavematrix_torsion.csv", "instron-wavematrix")
    assert len(e.columns.lines) == 11
    assert e.columns.numbers("Torque (N·m)").max() == 50
    with pytest.raises(InputError, match="torsion"):
        guessed(HERE / "instron-minimal/sample_wavematrix_torsion.csv")


def test_four_specimens_on_one_grid():
    found = guessed(HERE / "sandia-shear-coupon/shear.csv")
    assert [label for _, label in found.pairs] == ["va1", "va2", "vp2", "vp6"]
    assert found.missing


def test_c3d():
    t = tracked(HERE / "c3d-qualisys/beam_load101_V2_a.c3d")
    assert t.position.shape == (600, 6, 3)
    assert t.unit == "m"
    assert t.labels == ("Tip - 1", "Tip - 2", "Tip - 3", "Base - 1", "Base - 2", "Base - 3")
    assert t.time[-1] == pytest.approx(5.99)
    np.testing.assert_allclose(t.position[0, 0], [0.072858, 0.030468, 0.073172], atol=5e-7)
    assert np.isfinite(t.position).all()


def test_dice():
    t = tracked(HERE / "dice-full-field/DICe_solution_0.txt.gz")
    assert t.position.shape == (2, 972, 3)
    assert t.unit == "pixel"
    moved = t.position[1] - t.position[0]
    np.testing.assert_allclose([moved[:, 1].min(), moved[:, 1].max()], [-0.71772, -0.45644])
    np.testing.assert_allclose(t.position[0, 0], [46, 366, 0])


@shared
def test_hysitron(tmp_path):
    path = SHARED / "hysitron/RobinSteel0000LC.txt"
    e = exported(path, "hysitron")
    assert len(e.columns.lines) == 5304
    assert e.columns.numbers("Load (µN)").max() == 3000.027013
    assert e.columns.numbers("Depth (nm)").max() == 159.745188
    cut = tmp_path / "cut.txt"
    cut.write_bytes(b"".join(path.read_bytes().splitlines(True)[:200]))
    with pytest.raises(InputError, match="expected 5304"):
        exported(cut, "hysitron")


@shared
def test_chiaro(tmp_path):
    with zipfile.ZipFile(next((SHARED / "optics11-chiaro").glob("*.zip"))) as packed:
        packed.extractall(tmp_path)
    path = next(tmp_path.glob("*.txt"))
    e = exported(path, "optics11-chiaro")
    number = e.columns.numbers
    assert len(e.columns.lines) == 13827
    assert number("Load (uN)").max() == pytest.approx(0.04924, abs=5e-6)
    assert number("Piezo (nm)").max() == pytest.approx(88079.735, abs=5e-4)
    # The load is the lever's stiffness times its bending: 0.019 N/m times nm is 1e-3 uN.
    np.testing.assert_allclose(number("Load (uN)"), 0.019 * number("Cantilever (nm)") * 1e-3, atol=2e-6)
    assert guessed(path).specimen == {"radius": "27.500 um"}


@shared
def test_agilent():
    e = exported(SHARED / "agilent/Popin.xls", "agilent-nanosuite")
    assert len(e.blocks) == 12
    depth = of_block(e, "Test 001", "Displacement Into Surface")
    assert len(depth) == 431
    assert np.nanmax(depth) == pytest.approx(996.92361, abs=1e-5)
    assert np.nanmax(of_block(e, "Test 001", "Load On Sample")) == pytest.approx(95.103163, rel=1e-7)
    assert np.nanmax(np.abs(e.columns.numbers("Modulus"))) < 1e300


@shared
def test_ncorr():
    t = tracked(SHARED / "ncorr-multidic/DIC2DpairResults_C_201_C_202.mat")
    assert t.position.shape == (5, 7469, 3)
    np.testing.assert_allclose(np.nanmean(t.position[4] - t.position[0], axis=0)[:2], [-2.5513, 0.6878], atol=5e-5)
    assert t.unit == "pixel"


@shared
def test_labelled_csv_whose_time_runs_backwards():
    path = SHARED / "soft-robotics-database/Ecoflex 00-30.csv"
    found = guessed(path)
    assert "runs backwards" in found.time_fault
    assert dict(found.specimen) == {"height": "33 mm", "width": "6 mm", "thickness": "3 mm", "area": "0.18 cm^2"}
    strain, stress = found.pairs[0][0]
    assert (strain.quantity, strain.unit) == ("strain", "1")  # 16 is a ratio: ln(1 + 16) stands beside it
    assert (stress.quantity, stress.unit) == ("nominal_stress", "MPa")


# Formats without a real file: made here from their public description. These tests show that the readers do what
# they say, not that the machines write so.
DESCRIBED = {
    "zwick-testxpert": (
        "Prüfzeit;Standardweg;Standardkraft;Prüfzeit;Standardweg;Standardkraft\ns;mm;N;s;mm;N\n"
        + "".join(f"{k},0;0,{k};1,{k};{k},0;0,{k};2,{k}\n" for k in range(6)),
        {"1": [1.0, 1.5], "2": [2.0, 2.5]},
        "Standardkraft",
    ),
    "biomomentum-mach-1": (
        "<Mach-1 File>\n<INFO>\nDate:\t1/1/2020\n<END INFO>\n<Find Contact>\n"
        "<DATA>\nTime, s\tPosition (z), mm\tFz, gf\n"
        + "".join(f"{k}\t0.{k}\t{k}.5\n" for k in range(5))
        + "<END DATA>\n<Stress Relaxation>\n<DATA>\nTime, s\tPosition (z), mm\tFz, gf\n"
        + "".join(f"{k}\t0.{k}\t1{k}.5\n" for k in range(5))
        + "<END DATA>\n",
        {"1 Find Contact": [0.5, 4.5], "2 Stress Relaxation": [10.5, 14.5]},
        "Fz, gf",
    ),
    "anton-paar": (
        "Indentation parameters\nMax load\t5.00 mN\n\nTime [s]\tPd [nm]\tFn [mN]\n"
        + "".join(f"0.{k}\t{10 * k}\t0.{k}\n" for k in range(6)),
        {"1": [0.0, 0.5]},
        "Fn [mN]",
    ),
    "cellscale-univert": (
        "SetName,Cycle,Time_S,Size_mm,Displacement_mm,Force_N\n"
        + "".join(f"Pull,1-Stretch,{k}.0,1{k}.0,{k}.0,0.{k}\n" for k in range(6)),
        {"1": [0.0, 0.5]},
        "Force_N",
    ),
    "cellscale-biotester": (
        "SetName,Cycle,Time_S,XSize_um,YSize_um,XForce_mN,YForce_mN\n"
        + "".join(f"Bi,1-Stretch,{k}.0,50{k}0,40{k}0,{k}.5,{k}.7\n" for k in range(6)),
        {"1": [0.5, 5.5]},
        "XForce_mN",
    ),
}


@pytest.mark.parametrize("name", DESCRIBED)
def test_formats_written_from_their_description(name, tmp_path):
    content, ends, column = DESCRIBED[name]
    path = tmp_path / "export.csv"
    path.write_text(content, encoding="utf-8")
    e = exported(path, name)
    assert "description" in table_exports()[name].basis
    for block, (first, last) in ends.items():
        values = of_block(e, block, column) if BLOCK in e.columns.cells else e.columns.numbers(column)
        assert (values[0], values[-1]) == (first, last)


def test_biotester_gives_two_stretches(tmp_path):
    from tissuejax.cli import main
    from tissuejax.recordings.files import read

    (tmp_path / "b.csv").write_text(DESCRIBED["cellscale-biotester"][0])
    assert main(["import", str(tmp_path / "b.csv"), "--area", "5 mm^2"]) == 0
    r = read(tmp_path / "b.toml").recordings["r1"]
    np.testing.assert_allclose(r.inputs["stretch"][-1], [5050 / 5000, 4050 / 4000])
    np.testing.assert_allclose(r.channels["nominal_stress"].values[-1], [5.5e-3 / 5e-6, 5.7e-3 / 5e-6])


def test_an_anton_paar_table_with_its_units_in_a_row_is_an_indentation(tmp_path):
    (tmp_path / "a.txt").write_text(
        "Measurement:\tTest1\n\nTime\tPd\tFn\n[s]\t[nm]\t[mN]\n"
        + "".join(f"0.{k}\t{10 * k}\t0.{k}\n" for k in range(6))
    )
    guess = guessed(tmp_path / "a.txt")
    assert guess.experiment == "probing"
    ((pair, _),) = guess.pairs
    assert [(g.column, g.quantity, g.unit) for g in pair] == [("Pd", "displacement", "nm"), ("Fn", "force", "mN")]


POINTS = {
    "trc": "PathFileType\t4\t(X/Y/Z)\tx.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n10\t10\t2\t2\tmm\n"
    "Frame#\tTime\tA\t\t\tB\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n1\t0.0\t1\t2\t3\t4\t5\t6\n2\t0.1\t1.5\t2.5\t3.5\t\t\t\n",
    "gom": "GOM Correlate\nid;x [mm];y [mm];z [mm];displacement x [mm];displacement y [mm];displacement z [mm]\n"
    "1;1;2;3;0.5;0.5;0.5\n2;4;5;6;0;0;0\n",
    "vic-3d": '"X", "Y", "Z", "U", "V", "W", "exx", "sigma", "x", "y"\n1, 2, 3, 0.5, 0.5, 0.5, 0, 0.01, 100, 200\n'
    "4, 5, 6, 9, 9, 9, 0, -1, 100, 200\n",
    "matchid": "coor.X [mm];coor.Y [mm];coor.Z [mm];disp.Horizontal Displacement U [mm];"
    "disp.Vertical Displacement V [mm];disp.Out-Of-Plane: W [mm]\n1;2;3;0.5;0.5;0.5\n4;5;6;0;0;0\n",
}


@pytest.mark.parametrize(
    ("name", "content", "unit"),
    [
        (
            "gom",
            "id;x [mm];y [mm];z [mm];displacement_x [mm];displacement_y [mm];displacement_z [mm]\n"
            "1;1;2;3;0.5;0.5;0.5\n2;4;5;6;0;0;0\n",
            "mm",
        ),
        (
            "vic-3d",
            '"X [mm]","Y [mm]","Z [mm]","U [mm]","V [mm]","W [mm]","exx [1]","sigma [pixel]"\n'
            "1,2,3,0.5,0.5,0.5,0,0.01\n4,5,6,9,9,9,0,-1\n",
            "mm",
        ),
        (
            "gom",
            "index,x [px],y [px],displacement x [px],displacement y [px]\n1,1,2,0.5,0.5\n2,4,5,0,0\n",
            "pixel",
        ),
    ],
)
def test_a_table_of_points_is_one_stage(name, content, unit, tmp_path):
    (tmp_path / "p.csv").write_text(content)
    assert marker_export(tmp_path / "p.csv").name == name
    t = tracked(tmp_path / "p.csv")
    assert t.unit == unit
    assert t.position.shape == (2, 2, 3)
    assert t.plane == (unit == "pixel")
    np.testing.assert_allclose(t.position[1, 0, :2], [1.5, 2.5])
    assert np.isnan(t.position[1, 1]).all() == (name == "vic-3d")


def test_a_biaxial_table_with_displacements_along_axes_is_no_full_field(tmp_path):
    rows = "".join(f"0.{k},{k},{2 * k},0.{k},0.{k}\n" for k in range(8))
    (tmp_path / "b.csv").write_text("time (s),displacement x (mm),displacement y (mm),force x (N),force y (N)\n" + rows)
    assert marker_export(tmp_path / "b.csv") is None
    assert guessed(tmp_path / "b.csv").experiment == "biaxial"


@pytest.mark.parametrize("name", POINTS)
def test_points_written_from_their_description(name, tmp_path):
    path = tmp_path / ("p.trc" if name == "trc" else "p.csv")
    path.write_text(POINTS[name])
    assert marker_export(path).name == name
    assert "description" in marker_exports()[name].basis
    t = tracked(path)
    assert t.unit == "mm"
    np.testing.assert_allclose(t.position[0, 0], [1, 2, 3])
    np.testing.assert_allclose(t.position[1, 0], [1.5, 2.5, 3.5])
    assert np.isnan(t.position[1, 1]).all() == (name in ("trc", "vic-3d"))


def test_every_reader_from_a_description_says_so_and_no_other():
    families = {**table_exports(), **marker_exports()}
    described = {name for name, kind in families.items() if by_description(kind.basis)}
    assert described == {
        *("instron-wavematrix", "zwick-testxpert", "biomomentum-mach-1", "anton-paar"),
        *("cellscale-univert", "cellscale-biotester", "trc", "gom", "vic-3d", "matchid"),
    }


def test_an_import_says_that_no_real_file_was_seen(tmp_path):
    (tmp_path / "w.csv").write_text(
        '"Total Time (s)","Total Cycles","Position(Linear:Digital Position) (mm)","Load(Linear:Load) (kN)"\n'
        + "".join(f"0.{k},1,3.{k},0.00{k}\n" for k in range(6))
    )
    said = guessed(tmp_path / "w.csv").said
    assert "it is an export of Instron WaveMatrix (no real file was at hand: the reader follows its public" in said[0]

"""Tables with a side file: each quantity by algebra, several samples and recordings, every refusal with its place."""

import gzip

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.contracts.recordings_made import ROWS, UNI, put
from tissuejax.errors import InputError
from tissuejax.recordings import files
from tissuejax.recordings.table import read_table

QUICK = settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def only(side, name=None):
    """The only recording of the only sample (or the one named)."""
    sample = files.read(side)
    return sample.recordings[name or next(iter(sample.recordings))]


def side(columns: str, experiment: str = "uniaxial", more: str = "", specimen: str = "") -> str:
    return f'file = "t.csv"\nexperiment = "{experiment}"\n{more}\n[columns]\n{columns}\n[specimen]\n{specimen}\n'


def test_units_become_si(tmp_path):
    r = only(put(tmp_path))
    np.testing.assert_allclose(r.inputs["time"], [0, 0.5, 1])
    np.testing.assert_allclose(r.inputs["stretch"], [1, 1.1, 1.2])
    np.testing.assert_allclose(r.channels["nominal_stress"].values, [0, 2000, 5000])
    assert r.channels["nominal_stress"].noise_std > 0


def test_the_example_of_the_module_text_reads(tmp_path):
    from tissuejax.recordings import table

    example = "\n".join(line[4:] for line in table.__doc__.splitlines() if line.startswith("    "))
    assert len([line for line in example.splitlines() if line and not line.startswith("[")]) <= 15
    rows = "animal,test_id,time_s,crosshead,load\n" + "".join(
        f"{a},{k},{5 + t},{2 + 0.3 * t},{0.1 + t * k}\n" for a in ("pig", "cow") for k in (1, 2) for t in range(3)
    )
    found = read_table(put(tmp_path, rows, example, "tests.csv"))
    assert {s: list(f.recordings) for s, f in found.items()} == {"pig": ["1", "2"], "cow": ["1", "2"]}
    r = found["pig"].recordings["1"]
    area = np.pi * 0.025**2
    np.testing.assert_allclose(r.inputs["time"], [0, 1, 2])
    np.testing.assert_allclose(r.inputs["stretch"], [1, 0.99, 0.98])
    np.testing.assert_allclose(r.channels["nominal_stress"].values, np.array([-0.1, -1.1, -2.1]) / area)
    np.testing.assert_allclose(r.channels["nominal_stress"].noise_std, 0.02 / area)
    np.testing.assert_allclose([r.attributes[k] for k in ("area", "height", "diameter")], [area, 0.03, 0.05])


MOTIONS = {
    # quantity, what the column holds, its unit, specimen -> stretch, by hand
    "strain": ([0, 10, -20], "%", "", [1, 1.1, 0.8]),
    "true_strain": ([0, 0.1, -0.2], "1", "", [1, np.exp(0.1), np.exp(-0.2)]),
    "displacement": ([0, 1, -4], "mm", 'height = "2 cm"', [1, 1.05, 0.8]),
    "length": ([20, 21, 16], "mm", 'height = "2 cm"', [1, 1.05, 0.8]),
    "radial_stretch": ([1, 1.25, 0.8], "1", "", [1, 0.64, 1.5625]),
}


@pytest.mark.parametrize("quantity", MOTIONS)
def test_each_measure_of_deformation(quantity, tmp_path):
    values, unit, specimen, stretch = MOTIONS[quantity]
    rows = "t,u,P\n" + "".join(f"{i},{v},1\n" for i, v in enumerate(values))
    text = side(
        f'time = {{ column = "t", unit = "s" }}\n{quantity} = {{ column = "u", unit = "{unit}" }}\n'
        'nominal_stress = { column = "P", unit = "Pa" }',
        specimen=specimen,
    )
    np.testing.assert_allclose(only(put(tmp_path, rows, text)).inputs["stretch"], stretch, rtol=1e-14)


def test_lengths_without_a_height_count_from_the_first(tmp_path):
    text = side('length = { column = "l", unit = "mm" }\nnominal_stress = { column = "P", unit = "Pa" }')
    r = only(put(tmp_path, "l,P\n4,0\n5,1\n", text))
    np.testing.assert_allclose(r.inputs["stretch"], [1, 1.25])
    np.testing.assert_allclose(r.inputs["time"], [0, 1])


AREAS = {
    'area = "2 cm^2"': 2e-4,
    'diameter = "20 mm"': np.pi * 1e-4,
    'width = "10 mm"\nthickness = "2 mm"': 2e-5,
    # V = pi r^2 h is kept: a disc of 20 mm x 10 mm that has settled to 8 mm
    'frozen_diameter = "20 mm"\nfrozen_height = "10 mm"\nheight = "8 mm"': np.pi * 1e-4 * 10 / 8,
}


@pytest.mark.parametrize("specimen", AREAS)
def test_force_over_each_kind_of_area(specimen, tmp_path):
    text = side('stretch = { column = "l" }\nforce = { column = "P", unit = "mN" }', specimen=specimen)
    r = only(put(tmp_path, ROWS, text))
    np.testing.assert_allclose(r.channels["nominal_stress"].values, np.array([0, 2e-3, 5e-3]) / AREAS[specimen])


def test_settling_refers_stretch_to_the_frozen_height(tmp_path):
    specimen = 'frozen_height = "10 mm"\nheight = "8 mm"'
    text = side(
        'stretch = { column = "l" }\nnominal_stress = { column = "P", unit = "Pa" }',
        "uniaxial",
        "settling = true",
        specimen,
    )
    np.testing.assert_allclose(only(put(tmp_path, ROWS, text)).inputs["stretch"], [0.8, 0.88, 0.96])


@pytest.mark.parametrize("kind", ["uniaxial", "planar", "equibiaxial"])
def test_true_stress_becomes_nominal(kind, tmp_path):
    text = side('stretch = { column = "l" }\ntrue_stress = { column = "P", unit = "Pa" }', kind)
    values = only(put(tmp_path, ROWS, text)).channels["nominal_stress"].values
    np.testing.assert_allclose(values, [0, 2 / 1.1, 5 / 1.2])


def test_biaxial_true_stress_becomes_nominal_axis_by_axis(tmp_path):
    text = side(
        'stretch = [{ column = "a" }, { column = "b" }]\n'
        'true_stress = [{ column = "p", unit = "Pa" }, { column = "q", unit = "Pa" }]',
        "biaxial",
    )
    r = only(put(tmp_path, "a,b,p,q\n1,1,0,0\n1.25,1.6,10,16\n", text))
    np.testing.assert_allclose(r.channels["nominal_stress"].values, [[0, 0], [8, 10]])


@pytest.mark.parametrize(
    ("quantity", "unit", "given"), [("shear", "%", 20), ("angle", "deg", 45), ("displacement", "mm", 5)]
)
def test_simple_shear(quantity, unit, given, tmp_path):
    text = side(
        f'{quantity} = {{ column = "g", unit = "{unit}" }}\ntrue_stress = {{ column = "P", unit = "Pa" }}',
        "simple-shear",
        specimen='height = "10 mm"',
    )
    r = only(put(tmp_path, f"g,P\n0,0\n{given},3\n", text))
    np.testing.assert_allclose(r.inputs["shear"], [0, {"shear": 0.2, "angle": 1.0, "displacement": 0.5}[quantity]])
    np.testing.assert_allclose(r.channels["nominal_stress"].values, [0, 3])


def test_compression_counted_positive_turns_loads_and_shortenings(tmp_path):
    columns = 'displacement = { column = "l", unit = "mm" }\nforce = { column = "P", unit = "N" }'
    text = side(columns, more='positive = "compression"', specimen='height = "10 mm"\narea = "1 m^2"')
    r = only(put(tmp_path, ROWS, text))
    np.testing.assert_allclose(r.inputs["stretch"], [0.9, 0.89, 0.88])
    np.testing.assert_allclose(r.channels["nominal_stress"].values, [0, -2, -5])


def test_probing_presses_down_and_is_pushed_up(tmp_path):
    columns = 'displacement = { column = "l", unit = "mm" }\nforce = { column = "P", unit = "N" }'
    r = only(put(tmp_path, ROWS, side(columns, "probing", specimen='height = "20 mm"\nradius = "5 mm"')))
    np.testing.assert_allclose(r.inputs["probe/position"][:, 2], [0.024, 0.0239, 0.0238])
    np.testing.assert_allclose(r.channels["force"].values[:, 2], [0, 2, 5])
    assert r.attributes["probe/radius"] == 0.005


def test_parts_filters_zeroing_and_decimation(tmp_path):
    rows = "mode,t,x,P\n" + "".join(f"{m},{t},{1 + 0.01 * t},{t + 3}\n" for m in ("UT", "PS", "no") for t in range(8))
    text = """
file = "t.csv"
sample = "rubber"
[columns]
time = { column = "t", unit = "s" }
stretch = { column = "x" }
nominal_stress = { column = "P", unit = "Pa", zero = 2 }
[[part]]
where = { mode = ["UT"], t = "<= 5" }
recording = "pull {mode}"
experiment = "uniaxial"
every = 2
[[part]]
where = { mode = "PS", t = ">= 2" }
recording = "planar"
experiment = "planar"
relative_to_first = true
noise = { nominal_stress = "4 Pa", stretch = "1 %" }
"""
    found = files.read(put(tmp_path, rows, text))
    pull, planar = found.recordings["pull UT"], found.recordings["planar"]
    np.testing.assert_allclose(pull.inputs["time"], [0, 2, 4])
    np.testing.assert_allclose(pull.channels["nominal_stress"].values, [-0.5, 1.5, 3.5])
    assert planar.inputs["stretch"][0] == 1
    assert planar.experiment == "planar"
    assert planar.channels["nominal_stress"].noise_std == 4
    assert planar.attributes["stretch/noise_std"] == 0.01


def test_sizes_from_a_second_table(tmp_path):
    (tmp_path / "sizes.csv").write_text("id;d;h\nb;20;5\na;10;4\n")
    text = """
file = "t.csv"
sample = "{id}"
experiment = "uniaxial"
[columns]
displacement = { column = "u", unit = "mm" }
force = { column = "F", unit = "N" }
[specimen]
file = "sizes.csv"
key = "id"
height = { column = "h", unit = "mm" }
diameter = { column = "d", unit = "mm" }
"""
    found = read_table(put(tmp_path, "id,u,F\na,0,0\na,1,1\nb,0,0\nb,1,1\n", text))
    assert list(found) == ["a", "b"]
    np.testing.assert_allclose(found["a"].recordings["r1"].inputs["stretch"], [1, 1.25])
    np.testing.assert_allclose(found["b"].recordings["r1"].inputs["stretch"], [1, 1.2])
    values = found["b"].recordings["r1"].channels["nominal_stress"].values
    np.testing.assert_allclose(values, [0, 1 / (np.pi * 1e-4)])


def test_one_bad_sample_does_not_bar_the_others(tmp_path):
    text = UNI.replace('"uniaxial"', '"uniaxial"\nsample = "{id}"')
    path = put(tmp_path, "id,t,l,P\na,0,1,0\na,1,1.1,1\nb,0,1,0\nb,1,-1,1\n", text)
    assert files.names(path) == ["a", "b"]
    assert files.read(path, "a").name == "a"
    assert files.read(f"{path}#a").name == "a"
    with pytest.raises(InputError, match="'b'.*stretch -1"):
        files.read(path, "b")
    with pytest.raises(InputError, match=r"2 samples \(a, b\).*#a"):
        files.read(path)
    with pytest.raises(InputError, match="unknown sample 'c'"):
        files.read(path, "c")


@pytest.mark.parametrize("mark", [",", ";", "\t", " "])
def test_separators_are_seen(mark, tmp_path):
    np.testing.assert_allclose(only(put(tmp_path, ROWS.replace(",", mark))).inputs["stretch"], [1, 1.1, 1.2])


def test_european_file_with_comments_and_no_header(tmp_path):
    text = """
file = "t.csv"
experiment = "uniaxial"
header = false
decimal = ","
separator = "semicolon"
skip = 1
[columns]
time = { column = 1, unit = "s" }
strain = { column = 2, unit = "%" }
nominal_stress = { column = 3, unit = "kPa" }
"""
    r = only(put(tmp_path, "Prüfung 5\n# a comment\n0;0;0\n\n1;10,5;2,5\n", text))
    np.testing.assert_allclose(r.inputs["stretch"], [1, 1.105])
    np.testing.assert_allclose(r.channels["nominal_stress"].values, [0, 2500])


def test_gzip_and_windows_text(tmp_path):
    path = put(tmp_path, side=UNI.replace("t.csv", "t.csv.gz"))
    (tmp_path / "t.csv.gz").write_bytes(gzip.compress(("\ufeff" + ROWS.replace("\n", "\r\n")).encode()))
    np.testing.assert_allclose(only(path).inputs["stretch"], [1, 1.1, 1.2])


def test_a_table_finds_the_side_file_of_its_name(tmp_path):
    put(tmp_path)
    with pytest.raises(InputError, match=r"t\.toml beside it.*`tissuejax import "):
        files.read(tmp_path / "t.csv")
    (tmp_path / "t.toml").write_text(UNI)
    assert list(files.read(tmp_path / "t.csv").recordings) == ["r1"]


def test_changed_files_are_read_anew(tmp_path):
    path = put(tmp_path)
    assert only(path).inputs["stretch"][1] == 1.1
    import os

    put(tmp_path, ROWS.replace("1.1", "1.15"))
    os.utime(tmp_path / "t.csv", ns=(1, 1))
    assert only(path).inputs["stretch"][1] == 1.15


def test_missing_rows_are_dropped_on_request(tmp_path):
    r = only(put(tmp_path, ROWS.replace("1.1", "NaN"), 'missing = "drop"\n' + UNI))
    np.testing.assert_allclose(r.inputs["stretch"], [1, 1.2])


@QUICK
@given(
    data=st.lists(st.tuples(st.floats(1e-3, 50), st.floats(0.05, 8), st.floats(-1e7, 1e7)), min_size=2, max_size=40),
    diameter=st.floats(0.5, 80),
    height=st.floats(0.5, 80),
    positive=st.sampled_from(["tension", "compression"]),
)
def test_what_a_machine_wrote_comes_back(data, diameter, height, positive, tmp_path):
    """From stretch and nominal stress to the machine's force and displacement, to a file, and back."""
    steps, stretch, stress = np.array(data).T
    time, sign = np.cumsum(steps), {"tension": 1, "compression": -1}[positive]
    u, force = sign * (stretch - 1) * height, sign * stress * np.pi * diameter**2 / 4 * 1e-6
    rows = "t,u,F\n" + "".join(f"{a!r},{b!r},{c!r}\n" for a, b, c in zip(time.tolist(), u.tolist(), force.tolist()))
    columns = (
        'time = { column = "t", unit = "s" }\ndisplacement = { column = "u", unit = "mm" }\n'
        'force = { column = "F", unit = "N" }'
    )
    specimen = f'height = "{height!r} mm"\ndiameter = "{diameter!r} mm"'
    path = put(tmp_path, rows, side(columns, more=f'positive = "{positive}"', specimen=specimen))
    files.write(files.read(path), tmp_path / "out.h5")
    r = only(tmp_path / "out.h5")
    np.testing.assert_array_equal(r.inputs["time"], time)
    np.testing.assert_allclose(r.inputs["stretch"], stretch, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(r.channels["nominal_stress"].values, stress, rtol=1e-11, atol=1e-9)


def test_shared_files_are_found_or_said_how_to_find(tmp_path, monkeypatch):
    inner = tmp_path / "checkout" / "fits"
    inner.mkdir(parents=True)
    path = put(inner, side=UNI.replace("t.csv", "shared:recordings/t.csv"))
    monkeypatch.delenv("TISSUEJAX_SHARED", raising=False)
    with pytest.raises(
        InputError, match="TISSUEJAX_SHARED is not set.*Set TISSUEJAX_SHARED to the folder.*recordings/"
    ):
        files.read(path)
    (tmp_path / "shared" / "recordings").mkdir(parents=True)
    (tmp_path / "shared" / "recordings" / "t.csv").write_text(ROWS)
    assert only(path).inputs["stretch"][1] == 1.1
    monkeypatch.setenv("TISSUEJAX_SHARED", str(tmp_path / "nowhere"))
    with pytest.raises(InputError, match="nowhere"):
        files.read(path)

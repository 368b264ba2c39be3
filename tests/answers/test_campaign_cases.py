"""What a campaign says of its cases: suspect ones, dead sensors, files that can't be read, selections, progress."""

import io
import json

import numpy as np
import pytest

import tissuejax as tj
from tests.cohorts import SETTINGS, STRETCH, cohort, pull
from tissuejax.campaign.run import begin, fits, go_on, status, table
from tissuejax.campaign.store import Store
from tissuejax.cli import main
from tissuejax.errors import InputError
from tissuejax.fitting.advice import suspect
from tissuejax.progress import Lines
from tissuejax.recordings.hdf5_writing import write


def test_what_a_fit_would_call_suspect_is_counted_and_said(tmp_path, capsys):
    files = cohort(tmp_path, 2, bad=False)
    stiffening = pull("stiff", 1e5 * (STRETCH - 1) ** 3)
    write(stiffening, tmp_path / "stiff.h5")
    c = str(tmp_path / "c")
    asked = ["--energy", "neo-hookean", "--multistart", "1"]
    assert main(["campaign", "run", c, *files, str(tmp_path / "stiff.h5"), *asked]) == 0
    assert "3 cases: 3 done, 1 of them not to be used as they are (misfit 1), 0 failed" in capsys.readouterr().out
    assert main(["campaign", "report", c, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["suspect"], told["suspect_kinds"], told["usable"]) == (1, {"misfit": 1}, 2)
    rows = {r["sample"]: r for r in table(tmp_path / "c")}
    alone = tj.fit(stiffening, "neo-hookean", search=tj.Search(multistart=1))
    assert rows["stiff"]["suspect"] == "; ".join(suspect(alone)) != ""
    assert rows["s0"]["suspect"] == rows["s1"]["suspect"] == ""
    assert (tmp_path / "c" / "cases.csv").read_text().startswith("sample,status,fit,suspect,")
    page = (tmp_path / "c" / "report.html").read_text()
    assert "not to be used as they are (misfit 1)" in page
    assert "<th>std energy.mu (Pa)</th>" in page
    assert main(["campaign", "run", str(tmp_path / "d"), str(tmp_path / "stiff.h5"), *asked]) == 4
    assert main(["campaign", "report", str(tmp_path / "d")]) == 4
    assert main(["campaign", "status", str(tmp_path / "d")]) == 0


def test_specimens_of_one_name_in_several_files_are_kept_apart(tmp_path):
    """Two laboratories called theirs "s"; one file lies there twice, and is one specimen."""
    rng, stiffness = np.random.default_rng(4), {"a": 1000.0, "b": 2000.0, "c": 2000.0}
    elastic = STRETCH - STRETCH**-2
    noise = 5 * rng.normal(size=20)
    for name, mu in stiffness.items():
        (tmp_path / name).mkdir()
        write(pull("s", mu * elastic + noise), tmp_path / name / "s.h5")
    write(pull("t", 3000.0 * elastic + noise), tmp_path / "a" / "t.h5")
    files = [tmp_path / "a" / "t.h5", *(tmp_path / name / "s.h5" for name in stiffness)]
    begin(tmp_path / "camp", [str(f) for f in files], SETTINGS)
    assert go_on(tmp_path / "camp")["done"] == 4
    found = {name: r["parameters"]["energy.mu"]["value"] for name, r in fits(tmp_path / "camp").items()}
    assert list(found) == ["t", "s of a/s.h5", "s of b/s.h5"]
    np.testing.assert_allclose(list(found.values()), [3000.0, 1000.0, 2000.0], rtol=0.02)
    assert [r["sample"] for r in table(tmp_path / "camp")] == [*found, "s of c/s.h5"]


def test_a_fit_of_an_earlier_version_is_not_taken_for_a_good_one(tmp_path):
    store = begin(tmp_path / "c", cohort(tmp_path, 1, bad=False), SETTINGS)
    go_on(tmp_path / "c")
    path = store.path(store.planned()[0][0].key)
    row = json.loads(path.read_text())
    del row["answer"]["suspect"]
    path.write_text(json.dumps(row))
    assert status(tmp_path / "c")["suspect_kinds"] == {"not judged": 1}


def test_a_dead_sensor_is_a_failure_and_not_a_stiffness_of_zero(tmp_path):
    dead = tmp_path / "dead.h5"
    write(pull("dead", np.zeros(20)), dead)
    begin(tmp_path / "c", [*cohort(tmp_path, 1, bad=False), str(dead)], SETTINGS)
    told = go_on(tmp_path / "c")
    assert (told["done"], told["failed"]) == (1, 1)
    with pytest.raises(InputError) as refused:
        tj.fit(dead, "neo-hookean")
    assert told["failures"]["dead"] == str(refused.value)
    assert "zero throughout" in told["failures"]["dead"]


def test_a_file_that_cannot_be_read_is_a_failure_and_the_others_are_done(tmp_path, capsys):
    good = cohort(tmp_path, 2, bad=False)
    (tmp_path / "bad.toml").write_text("this is [ no TOML")
    (tmp_path / "gone.toml").write_text(
        'file = "gone.csv"\nsample = "late"\nrecording = "pull"\nexperiment = "uniaxial"\n[columns]\n'
        'stretch = { column = "stretch" }\nnominal_stress = { column = "stress", unit = "kPa" }\n'
    )
    c, gone = str(tmp_path / "c"), str(tmp_path / "gone.toml")
    files = [gone, str(tmp_path / "bad.toml"), str(tmp_path / "none.h5"), *good]
    asked = ["--energy", "neo-hookean", "--multistart", "1"]
    assert main(["campaign", "run", c, *files, *asked]) == 0
    assert "3 of 5 files can't be read" in capsys.readouterr().err
    told = status(tmp_path / "c")
    assert (told["cases"], told["done"], told["failed"]) == (5, 2, 3)
    assert set(told["failures"]) == {"gone.toml", "bad.toml", "none.h5"}
    with pytest.raises(InputError) as refused:
        tj.read(gone)
    assert told["failures"]["gone.toml"] == str(refused.value)
    rows = [f"{l},{2 * (l - l**-2)}\n" for l in (1, 1.1, 1.2, 1.3, 1.4)]
    (tmp_path / "gone.csv").write_text("stretch,stress\n" + "".join(rows))
    assert main(["campaign", "resume", c, "--failed"]) == 0
    told = status(tmp_path / "c")
    assert (told["cases"], told["done"], told["failed"]) == (5, 3, 2)
    found = {r["sample"]: r for r in table(tmp_path / "c")}
    assert found["late"]["energy.mu"] == pytest.approx(2000, rel=1e-5)


def test_one_bad_sample_of_a_file_leaves_its_others_alone(tmp_path):
    rows = [f"{s},{l},{mu * (l - l**-2)}\n" for s, mu in (("a", 3), ("b", 5)) for l in (1, 1.1, 1.2, 1.3, 1.4)]
    (tmp_path / "lab.csv").write_text("specimen,stretch,stress\n" + "".join(rows) + "c,-1,0\nc,-2,0\n")
    (tmp_path / "lab.toml").write_text(
        'file = "lab.csv"\nsample = "{specimen}"\nrecording = "pull"\nexperiment = "uniaxial"\n[columns]\n'
        'stretch = { column = "stretch" }\nnominal_stress = { column = "stress", unit = "kPa" }\n'
    )
    begin(tmp_path / "c", [str(tmp_path / "lab.toml")], SETTINGS)
    told = go_on(tmp_path / "c")
    assert (told["done"], list(told["failures"])) == (2, ["c"])
    assert go_on(tmp_path / "c", failed=True)["cases"] == 3


def test_a_selection_that_picks_nothing_is_refused(tmp_path, capsys):
    (good,), c = cohort(tmp_path, 1, bad=False), str(tmp_path / "c")
    for wrong in (f"{tmp_path}/day*.toml", f"{good}#s7"):
        assert main(["campaign", "run", c, good, wrong, "--energy", "neo-hookean"]) == 2
    assert "unknown sample 's7'" in capsys.readouterr().err
    lost = [str(tmp_path / name) for name in ("x.h5", "y.h5")]
    assert main(["campaign", "run", c, *lost, "--energy", "neo-hookean"]) == 2
    assert "none of the 2 files can be read; the first: " in capsys.readouterr().err
    assert not (tmp_path / "c").exists()


def test_progress_has_one_count(tmp_path):
    begin(tmp_path / "c", cohort(tmp_path, 3, bad=False), SETTINGS)
    store = Store(tmp_path / "c")
    store.work(store.planned()[0][0])
    said = io.StringIO()
    go_on(tmp_path / "c", progress=Lines(every=0.0, file=said))
    lines = [line.split("] ")[1] for line in said.getvalue().splitlines()]
    assert lines == ["cases (1 done before) 1 of 2: s1", "cases (1 done before) 2 of 2: s2"]

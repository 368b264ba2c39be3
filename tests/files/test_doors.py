"""Bad input at the command line: one sentence, exit code 2, nothing lost; and what must be read is read."""

import builtins
import json
from pathlib import Path

import h5py
import pytest

from tissuejax import storage
from tissuejax.cli import main
from tissuejax.errors import InputError
from tissuejax.recordings.files import read
from tissuejax.units import quantity

ELASTIC = str(Path(__file__).parents[2] / "data" / "demo" / "elastic.h5")


@pytest.mark.parametrize(
    ("text", "si", "value"),
    [
        ("1kPa", "Pa", 1e3),
        ("25mm", "m", 0.025),
        ("1e3Pa", "Pa", 1e3),
        ("-1.5 kPa", "Pa", -1500),
        ("12mm2", "m^2", 12e-6),
    ]
    + [("5%", "1", 0.05), ("3 µN·m", "N*m", 3e-6), ("10 1/s", "1/s", 10), ("1 N/mm²", "Pa", 1e6)],
)
def test_a_blank_before_the_unit_is_not_needed(text, si, value):
    assert quantity(text, si) == pytest.approx(value)


@pytest.mark.parametrize("text", ["12,5 mm", "nan mm", "mm", "3", "1..2 mm", True, None])
def test_no_quantity(text):
    with pytest.raises(InputError, match="wanted|unit"):
        quantity(text, "m", "--height")


REFUSED = {
    "no number": (["fit", ELASTIC, "--energy", "neo-hookean", "--seed", "abc"], ["--seed", "'abc'", "whole number"]),
    "no file": (["fit", "--energy", "neo-hookean"], ["FILE"]),
    "no energy": (["fit", ELASTIC], ["--energy"]),
    "option": (["inspect", ELASTIC, "--ouput", "x"], ["--ouput", "--out"]),
    "command": (["inspct", ELASTIC], ["inspect"]),
    "choice": (["import", "x.csv", "--positive", "up"], ["--positive", "tension"]),
    "order": (["fit", ELASTIC, "--energy", "ogden-99", "--ogden-form", "mu/alpha"], ["99", "1 to 9"]),
    "negative modulus": (["energies", "--plot", "neo-hookean", "--set", "energy.mu=-5"], ["energy.mu", "allowed is 0"]),
    "negative noise": (["sensitivity", "--published", "in-vivo-1", "--noise", "-1"], ["--noise", "above zero"]),
    "no jobs": (["challenge", "grade", "x", "--jobs", "0"], ["--jobs", "1 or more"]),
    "nan": (["fit", ELASTIC, "--energy", "neo-hookean", "--start", "energy.mu=nan"], ["--start", "number"]),
    "a file for a folder": (["energies", "--plot", "neo-hookean", "--out", "e.png"], ["--out", "e.png", "folder"]),
    "cards into a file": (["export", "--published", "in-vivo-1", "--out", "a.inp"], ["--out", "a.inp", "--to"]),
    "only": (["diagnose", ELASTIC, "--energy", "neo-hookean", "--only", "tensoin"], ["'tension'"]),
}


@pytest.mark.parametrize("case", REFUSED)
def test_each_is_one_sentence_and_exit_code_2(case, capsys):
    argv, words = REFUSED[case]
    assert main([*argv, "--json"]) == 2
    out, err = capsys.readouterr()
    said = json.loads(out)["error"]
    assert all(word in said for word in words), said
    assert "usage" not in err
    assert "Traceback" not in err
    assert err.strip().count("\n") == 0


def test_examples_of_the_help_run(tmp_path):
    argv = ["energies", "--plot", "ogden-2", "--ogden-form", "2mu/alpha^2", "--set", "energy.mu1=1kPa"]
    assert main([*argv, "--out", str(tmp_path)]) == 0


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(28, "No space left on device"), "disk is full"),
        (OSError(36, "File name too long"), "too long"),
        (PermissionError(13, "Permission denied"), "Permission denied"),
    ],
)
def test_what_the_system_refuses_when_writing(error, words, tmp_path, monkeypatch, capsys):
    def refuse(*_):
        raise error

    monkeypatch.setattr(storage.os, "fsync", refuse)
    assert main(["inspect", ELASTIC, "--out", str(tmp_path / "o")]) == 2
    assert words in capsys.readouterr().err
    assert not list((tmp_path / "o").glob("*")), "half a file was left"


def refuse_to_open(file, error, monkeypatch):
    """Make the system answer the opening of one file with an error."""
    real = builtins.open

    def refuse(path, *rest, **named):
        if str(path) == str(file):
            raise error
        return real(path, *rest, **named)

    monkeypatch.setattr(builtins, "open", refuse)


def test_what_the_system_refuses_when_reading(tmp_path, monkeypatch, capsys):
    file = tmp_path / "a.h5"
    file.write_bytes(b"x")
    refuse_to_open(file, PermissionError(13, "Permission denied", str(file)), monkeypatch)
    assert main(["inspect", str(file)]) == 2
    assert "Permission denied" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["a\nb", "..", "x" * 300, " "])
def test_names_that_can_not_be_file_names(name, tmp_path):
    (tmp_path / "t.csv").write_text("t,l,P\n" + "".join(f"{k},{1 + k / 10},{k}\n" for k in range(5)))
    (tmp_path / "t.toml").write_text(
        f'file = "t.csv"\nexperiment = "uniaxial"\nsample = {json.dumps(name)}\n[columns]\n'
        'stretch = { column = "l" }\nnominal_stress = { column = "P", unit = "kPa" }\n'
    )
    with pytest.raises(InputError, match="name of a sample"):
        read(tmp_path / "t.toml")


@pytest.mark.parametrize("verb", ["inspect", "fit", "diagnose"])
@pytest.mark.parametrize("where", [["tension"], ["compression", "holdout", "planar", "tension"]])
def test_a_noise_of_nothing_is_refused_beside_others_and_alone(where, verb, tmp_path, capsys):
    path = tmp_path / "no-noise.h5"
    path.write_bytes(Path(ELASTIC).read_bytes())
    with h5py.File(path, "r+") as file:
        for name in where:
            file[f"recordings/{name}/nominal_stress"].attrs["noise_std"] = 0.0
    energy = [] if verb == "inspect" else ["--energy", "neo-hookean"]
    assert main([verb, str(path), *energy, "--out", str(tmp_path / "o")]) == 2
    said = capsys.readouterr().err
    assert "/recordings/tension/nominal_stress" in said
    assert "Leave it out where the noise was not recorded" in said
    assert not (tmp_path / "o").exists()


def test_a_noise_left_out_is_not_recorded(tmp_path, capsys):
    path = tmp_path / "untold.h5"
    path.write_bytes(Path(ELASTIC).read_bytes())
    with h5py.File(path, "r+") as file:
        for group in file["recordings"].values():
            del group["nominal_stress"].attrs["noise_std"]
    assert main(["inspect", str(path)]) == 0
    assert "tension: no noise level for nominal_stress: a fit has to estimate it." in capsys.readouterr().out
    found = ["fit", str(path), "-e", "reduced-polynomial-2", "--multistart", "1", "-o", str(tmp_path / "o"), "--json"]
    assert main(found) == 0
    (level,) = {round(n["std"], 6) for n in json.loads(capsys.readouterr().out)["noise"].values()}
    assert level == pytest.approx(8.0, rel=0.1)  # what data/make_demo.py added


def test_one_card_goes_into_the_file_named(tmp_path, capsys):
    assert main(["export", "--published", "in-vivo-1", "--to", "abaqus", "--out", str(tmp_path / "liver.inp")]) == 0
    assert "*MATERIAL" in (tmp_path / "liver.inp").read_text().upper()


def test_a_file_that_points_at_other_files_is_refused(tmp_path):
    secret = tmp_path / "secret.h5"
    with h5py.File(secret, "w") as file:
        file["numbers"] = [1.0, 2.0]
    for kind in ("external", "soft"):
        mailed = tmp_path / f"{kind}.h5"
        mailed.write_bytes(Path(ELASTIC).read_bytes())
        with h5py.File(mailed, "a") as file:
            group = file["recordings/tension"]
            del group["stretch"]
            link = h5py.ExternalLink(str(secret), "numbers") if kind == "external" else h5py.SoftLink("/elsewhere")
            group["stretch"] = link
        with pytest.raises(InputError, match="link"):
            read(mailed)


def lab(folder, name="lab", cap=""):
    """A table of two samples, neo-Hookean with mu 3 and 5 kPa, with a side file."""
    rows = [f"{s},{l},{mu * (l - l**-2)}\n" for s, mu in (("a", 3), ("b", 5)) for l in (1, 1.1, 1.2, 1.3, 1.4)]
    (folder / f"{name}.csv").write_text("specimen,stretch,stress\n" + "".join(rows))
    (folder / f"{name}.toml").write_text(
        f'file = "{name}.csv"\nsample = "{{specimen}}"\nrecording = "pull"\nexperiment = "uniaxial"\n[columns]\n'
        'stretch = { column = "stretch" }\nnominal_stress = { column = "stress", unit = "kPa" }\n'
    )
    return str(folder / f"{name}.toml")


def test_a_fit_that_should_not_be_used_is_exit_code_4(tmp_path, capsys):
    held = ["--energy", "neo-hookean", "--bounds", "energy.mu=0:4 kPa", "--multistart", "1"]
    file = lab(tmp_path)
    assert main(["fit", f"{file}#a", *held, "--out", str(tmp_path / "a")]) == 0
    assert main(["fit", f"{file}#b", *held, "--out", str(tmp_path / "b")]) == 4
    assert "DON'T USE THESE NUMBERS AS THEY ARE: energy.mu ended at its upper bound" in capsys.readouterr().out
    assert main(["fit", file, "--each", *held, "--out", str(tmp_path / "each"), "--json"]) == 4
    told = json.loads(capsys.readouterr().out)["fits"]
    assert told["a"]["suspect"] == ""
    assert "upper bound" in told["b"]["suspect"]


def test_gross_misfit_is_exit_code_4(tmp_path, capsys):
    side = Path(lab(tmp_path))
    side.write_text(side.read_text() + '[noise]\nnominal_stress = "1 Pa"\n')
    table = tmp_path / "lab.csv"
    table.write_text(table.read_text().replace("a,1.2,", "a,1.2,1"))  # 1.5 kPa has become 11.5
    assert main(["fit", f"{side}#a", "--energy", "neo-hookean", "--multistart", "1", "--out", str(tmp_path / "f")]) == 4
    assert "times the noise" in capsys.readouterr().out.splitlines()[2]


def test_every_verb_has_a_folder_of_its_own(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    file = lab(tmp_path)
    fit = ["fit", file, "--each", "--multistart", "1", "--energy"]
    assert main([*fit, "neo-hookean"]) == 0
    assert main([*fit, "mooney-rivlin", "--fix", "energy.C01=0"]) == 0
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"lab-fits-neo-hookean", "lab-fits-mooney-rivlin"}
    there = str(tmp_path / "out" / "lab-fits-neo-hookean")
    assert main([*fit, "mooney-rivlin", "--fix", "energy.C01=0", "--out", there]) == 2
    assert main(["fit", f"{file}#a", "-e", "neo-hookean", "--out", f"{there}/b"]) == 2, "another sample's result"
    compare = ["compare", f"{file}#a", "-e", "neo-hookean", "-e", "gent", "--multistart", "1", "--out"]
    assert main([*compare, f"{there}/a"]) == 2, "its page would be overwritten"
    assert main([*compare, "c"]) == 0
    assert main(["compare", f"{file}#a", "-e", "neo-hookean", "-e", "yeoh", "--out", "c"]) == 2
    profile = ["profile", f"{file}#a", "--points", "2", "--multistart", "1", "--energy"]
    assert main([*profile, "neo-hookean", "--out", "p"]) == 0
    capsys.readouterr()
    assert main([*profile, "gent", "--out", "p"]) == 2
    assert "profile of a with neo-hookean" in capsys.readouterr().err
    made = ["simulate", "-e", "neo-hookean", "--path", "0:1 1:1.1", "--out", "s", "--set"]
    assert main([*made, "energy.mu=1 kPa"]) == 0
    assert main([*made, "energy.mu=2 kPa"]) == 2
    assert main([*made, "energy.mu=2 kPa", "--force"]) == 0
    campaign = ["campaign", "run", "k", file, "--energy"]
    assert main([*campaign, "neo-hookean"]) == 0
    assert main([*campaign, "neo-hookean"]) == 0
    assert main([*campaign, "gent"]) == 2


def test_a_study_runs_in_a_copy(tmp_path):
    study = tmp_path / "fits" / "mine"
    study.mkdir(parents=True)
    (study / "study.py").write_text(
        "def main(folder):\n    (folder / 'result.json').write_text('new')\n    return 'done'\n"
    )
    (study / "result.json").write_text("old")
    assert main(["study", str(study), "--out", str(tmp_path / "copy")]) == 0
    assert (study / "result.json").read_text() == "old"
    assert (tmp_path / "copy" / "mine" / "result.json").read_text() == "new"


def test_results_do_not_overwrite_each_other(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    argv = ["fit", ELASTIC, "--only", "tension", "--multistart", "1", "--energy"]
    assert main([*argv, "reduced-polynomial-2"]) == 0
    assert main([*argv, "reduced-polynomial-3"]) == 0
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "demo-elastic-fit-reduced-polynomial-2",
        "demo-elastic-fit-reduced-polynomial-3",
    }
    assert main([*argv, "reduced-polynomial-2"]) == 0, "the same command may be given again"
    there = str(tmp_path / "out" / "demo-elastic-fit-reduced-polynomial-2")
    capsys.readouterr()
    assert main([*argv, "reduced-polynomial-3", "--out", there]) == 2
    assert "--force" in capsys.readouterr().err
    assert main(["diagnose", ELASTIC, "--energy", "neo-hookean", "--out", there]) == 2
    assert main([*argv, "reduced-polynomial-3", "--out", there, "--force"]) == 0


@pytest.mark.parametrize("verb", ["import", "inspect"])
def test_a_link_without_its_target_is_called_that(verb, tmp_path, capsys):
    (tmp_path / "dang.csv").symlink_to("nowhere.csv")
    assert main([verb, str(tmp_path / "dang.csv")]) == 2
    assert "dang.csv: is a link to nowhere.csv, where there is no file" in capsys.readouterr().err
    assert main([verb, str(tmp_path / "other.csv")]) == 2
    assert "there are" not in capsys.readouterr().err


@pytest.mark.parametrize("verb", ["import", "inspect"])
def test_a_name_too_long_is_said_shortly(verb, capsys):
    assert main([verb, "a" * 300 + ".csv"]) == 2
    said = capsys.readouterr().err
    assert "the name is too long for a file" in said
    assert len(said) < 300


def test_a_file_that_can_not_be_read_is_not_called_empty(tmp_path, monkeypatch, capsys):
    file = tmp_path / "mem.csv"
    file.touch()
    refuse_to_open(file, OSError(5, "Input/output error", str(file)), monkeypatch)
    assert main(["import", str(file)]) == 2
    assert "can't be read (Input/output error)" in capsys.readouterr().err


def test_a_line_break_in_a_name_is_shown(tmp_path, capsys):
    rows = "".join(f"{k},{1 + 0.01 * k},{k}\n" for k in range(20))
    (tmp_path / "li\nne.csv").write_text("time (s),stretch,stress (kPa)\n" + rows)
    assert main(["import", str(tmp_path / "li\nne.csv")]) == 0
    out = capsys.readouterr().out
    assert "li\\nne.csv: a table" in out
    assert "li\\nne.toml --out look" in out.replace("' --out", " --out")
    assert "li\n" not in out
    assert main(["inspect", str(tmp_path / "li\nne.toml")]) == 0
    capsys.readouterr()
    assert main(["inspect", str(tmp_path / "no\npe.toml")]) == 2
    assert "no\\npe.toml: no such file" in capsys.readouterr().err


def test_a_fit_to_other_recordings_does_not_replace_the_one_before(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    fit = ["fit", ELASTIC, "--energy", "neo-hookean", "--multistart", "1"]
    assert main([*fit, "--holdout", "holdout"]) in (0, 4)
    before = next((tmp_path / "out").glob("*/result.json")).read_bytes()
    capsys.readouterr()
    assert main([*fit, "--only", "tension"]) == 2
    assert "holds the fit to compression, planar, tension, holdout held out" in capsys.readouterr().err
    assert next((tmp_path / "out").glob("*/result.json")).read_bytes() == before
    assert main([*fit, "--only", "tension", "--force"]) in (0, 4)
    assert next((tmp_path / "out").glob("*/result.json")).read_bytes() != before


def test_a_diagnosis_is_no_result_and_says_how_to_get_one(tmp_path, capsys):
    record = {"verdict": "found", "fit": "tissuejax fit a.h5 --energy neo-hookean --effect slack"}
    (tmp_path / "result.json").write_text(json.dumps(record))
    assert main(["export", str(tmp_path / "result.json")]) == 2
    assert "tissuejax fit a.h5 --energy neo-hookean --effect slack" in capsys.readouterr().err

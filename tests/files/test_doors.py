"""Bad input at the command line: one sentence, exit code 2, nothing lost; and what must be read is read."""

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


def test_what_the_system_refuses_when_reading(tmp_path, monkeypatch, capsys):
    import builtins

    file = tmp_path / "a.h5"
    file.write_bytes(b"x")
    real = builtins.open

    def refuse(path, *rest, **named):
        if str(path) == str(file):
            raise PermissionError(13, "Permission denied", str(file))
        return real(path, *rest, **named)

    monkeypatch.setattr(builtins, "open", refuse)
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


def test_results_do_not_overwrite_each_other(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    argv = ["fit", ELASTIC, "--only", "tension", "--multistart", "1", "--energy"]
    assert main([*argv, "neo-hookean"]) == 0
    assert main([*argv, "reduced-polynomial-2"]) == 0
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "demo-elastic-fit-neo-hookean",
        "demo-elastic-fit-reduced-polynomial-2",
    }
    assert main([*argv, "neo-hookean"]) == 0, "the same command may be given again"
    there = str(tmp_path / "out" / "demo-elastic-fit-neo-hookean")
    capsys.readouterr()
    assert main([*argv, "reduced-polynomial-2", "--out", there]) == 2
    assert "--force" in capsys.readouterr().err
    assert main(["diagnose", ELASTIC, "--energy", "neo-hookean", "--out", there]) == 2
    assert main([*argv, "reduced-polynomial-2", "--out", there, "--force"]) == 0

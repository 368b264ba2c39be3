"""`tissuejax cut` as it is typed: what it says, what it writes, what it refuses."""

import csv
import json
from pathlib import Path

import pytest

from tissuejax.cli import main

ROOT = Path(__file__).parents[2]
CUT, TISSUE = str(ROOT / "data" / "cut.h5"), ["--fix", "energy.mu=3 kPa", "--fix", "volumetric.K=32 kPa"]
RESOLVE = [
    "--strength",
    "210 kPa",
    "--toughness",
    "20",
    "--mu",
    "3000",
    "--bulk",
    "32 kPa",
    "--thickness",
    "0.5 mm",
    "--h",
    "0.25 mm",
]


def test_a_fit_answers_with_a_page_curves_and_a_table(capsys, tmp_path):
    """20 J/m^2 and friction 0.1 were put in (data/make_cut.py); the strength can't be told on such elements."""
    code = main(["cut", "fit", CUT, "--only", "shallow", *TISSUE, "--out", str(tmp_path), "--json"])
    record = json.loads(capsys.readouterr().out)
    assert code == 0
    assert record["by"] == "balance"
    assert record["values"]["cohesion.energy"] == pytest.approx(20.0, rel=0.02)
    page = (tmp_path / "report.html").read_text()
    assert "The tissue parts at" in page
    assert "J/m²" in page
    assert "Strength of the faces: not identified" in page
    assert page.index("figure") < page.index("<table")
    rows = list(csv.DictReader((tmp_path / "curves.csv").open()))
    assert len(rows) == 161
    steady = [r for r in rows if float(r["place (m)"]) > 5e-3]
    left = [(float(r["recorded (N)"]) - float(r["predicted (N)"])) / float(r["noise (N)"]) for r in steady]
    assert sum(x * x for x in left) / len(left) < 1.5
    table = (tmp_path / "parameters.tex").read_text()
    assert "cohesion.energy & " in table
    assert "not identified" in table
    assert {p.name for p in (tmp_path / "print").iterdir()} == {"record.svg", "record.pdf"}


def test_an_identification_answers_with_teeth(capsys, tmp_path):
    assert main(["cut", "identify", CUT, "--only", "fast", "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "normal / tangential strength" in said
    assert "The mean force holds no strength" in said
    assert (tmp_path / "teeth.png").stat().st_size > 5000


def test_resolve_says_what_this_mesh_can_not_tell(capsys):
    assert main(["cut", "resolve", *RESOLVE]) == 0
    said = capsys.readouterr().out
    assert "faces are not resolved" in said
    assert "not identified on this mesh" in said


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        (["resolve", *RESOLVE[:2], "--toughness", "1.25e-4 J", *RESOLVE[4:]], "J/m"),
        (["resolve", *RESOLVE[2:]], "--strength is needed"),
        (["fit"], "needs a recording file"),
        (["fit", str(ROOT / "data" / "demo" / "elastic.h5")], "no cutting recording"),
        (["fit", CUT, "--only", "deep"], "deep"),
        (["fit", CUT], "toughness and wedging in one sum"),
        (["fit", CUT, *TISSUE, "--fix", "cohesion.energy=2e-3 J"], "J/m^2 is meant"),
        (["identify", CUT, "--only", "deep"], "deep"),
    ],
)
def test_refused_in_one_sentence(typed, words, capsys, tmp_path):
    assert main(["cut", *typed, "--out", str(tmp_path / "out")]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()

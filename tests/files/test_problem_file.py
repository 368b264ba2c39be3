"""A problem file says what would have been typed; each breach of the schema is refused with its place."""

import json
import re
from pathlib import Path

import pytest
import yaml

from tissuejax.cli import main
from tissuejax.commands.problem_file import arguments, expanded, read_problem
from tissuejax.errors import InputError

ROOT = Path(__file__).parents[2]
PROBLEM = {
    "format": "tissuejax-problem-1",
    "specimen": "data/elastic.h5",
    "recordings": {"fit": ["tension"], "holdout": ["holdout"]},
    "model": {"energy": "reduced-polynomial-2"},
    "parameters": {"energy.C10": {"start": "0.5 kPa", "bounds": [0, "2kPa"]}},
    "candidates": {"energies": ["neo-hookean"], "effects": ["slack"]},
    "options": {"multistart": 1},
}


def test_each_verb_takes_what_concerns_it(tmp_path):
    common = [str(tmp_path / "data/elastic.h5"), "--energy", "reduced-polynomial-2"]
    held = ["--only", "tension", "--holdout", "holdout"]
    told = ["--start", "energy.C10=0.5 kPa", "--bounds", "energy.C10=0:2kPa"]
    side = tmp_path / "p.yaml"
    assert arguments("fit", PROBLEM, side) == [*common, *held, *told, "--multistart", "1"]
    assert arguments("diagnose", PROBLEM, side) == [*common, "--effect", "slack", *held]
    sets = PROBLEM | {"candidates": {"effects": ["viscoelasticity-1+slack", "slack"]}}
    assert arguments("diagnose", sets, side)[3:7] == ["--effect", "viscoelasticity", "--effect", "slack"]
    assert arguments("compare", PROBLEM, side)[:5] == [*common, "--energy", "neo-hookean"]


def test_the_page_shows_a_problem_that_reads(tmp_path):
    text = re.search(r"```yaml\n(.*?)```", (ROOT / "docs/problem-file.md").read_text(), re.S)[1]
    (tmp_path / "p.yaml").write_text(text)
    made = arguments("fit", read_problem(tmp_path / "p.yaml"), tmp_path / "p.yaml")
    assert made[made.index("--prior") + 1] == "effects.viscoelasticity.tau1=8 s:2 s"


def test_what_is_typed_beside_it_is_added(tmp_path):
    (tmp_path / "p.yaml").write_text(yaml.safe_dump(PROBLEM))
    assert expanded(["fit", str(tmp_path / "p.yaml"), "--seed", "3"])[-2:] == ["--seed", "3"]
    assert expanded(["inspect", "x.yaml"]) == ["inspect", "x.yaml"]


def test_a_fit_from_a_problem_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    told = PROBLEM | {"specimen": str(ROOT / "data/demo/elastic.h5"), "out": "out/p"}
    (tmp_path / "p.yaml").write_text(yaml.safe_dump(told))
    assert main(["fit", "p.yaml", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["parameters"]["energy.C10"]["value"] == pytest.approx(620, rel=0.02)
    assert (tmp_path / "out/p/fit/report.html").is_file()


@pytest.mark.slow
def test_one_file_serves_four_verbs_on_a_lab_s_table(tmp_path, monkeypatch, capsys):
    """A semicolon table as a machine writes it; data/lab/README.md says what is in it: 35 % relaxing with 2.5 s."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my.csv").write_bytes((ROOT / "data/lab/tension.csv").read_bytes())
    assert main(["import", "my.csv"]) == 0
    told = {
        "format": "tissuejax-problem-1",
        "specimen": "my.toml",
        "model": {"energy": "reduced-polynomial-2", "effects": ["viscoelasticity-1"]},
        "candidates": {"effects": ["viscoelasticity-1", "slack"]},
        "out": "out",
    }
    (tmp_path / "p.yaml").write_text(yaml.safe_dump(told))
    capsys.readouterr()

    def answer(*argv: str) -> dict:
        assert main([*argv, "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    fit = answer("fit", "p.yaml")["parameters"]["effects.viscoelasticity.tau1"]
    assert abs(fit["value"] - 2.5) < 3.5 * fit["std"]
    assert [e["name"] for e in answer("diagnose", "p.yaml")["effects"]] == ["viscoelasticity"]
    best = max(answer("compare", "p.yaml")["rows"], key=lambda row: row["weight"])
    assert "viscoelasticity-1" in best["name"]
    assert answer("campaign", "run", "p.yaml", "--engine", "serial")["done"] == 1
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"fit", "diagnose", "compare", "campaign"}


BREACHES = {
    "no yaml": ("a: [", "not YAML"),
    "no format": ("specimen: a.h5\nmodel: {energy: gent}\n", "'format' is a required property"),
    "unknown key": ("format: tissuejax-problem-1\nspecimen: a\nmodel: {energy: gent}\nmodle: 1\n", "'modle'"),
    "wrong type": ("format: tissuejax-problem-1\nspecimen: a\nmodel: {energy: [gent]}\n", "model.energy"),
    "a list": ("- a\n", "object"),
}


@pytest.mark.parametrize("breach", BREACHES)
def test_each_breach_is_refused_with_its_place(breach, tmp_path):
    text, words = BREACHES[breach]
    (tmp_path / "p.yaml").write_text(text)
    with pytest.raises(InputError, match=re.escape(words)):
        read_problem(tmp_path / "p.yaml")

"""The command line: every command teaches, answers in JSON, and refuses with one sentence and exit code 2."""

import functools
import json
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

import pytest
import trimesh

from tissuejax import verbs
from tissuejax.cache import source
from tissuejax.cli import _warned, commands, listed, main
from tissuejax.commands import diagnose as diagnose_command
from tissuejax.errors import InputError

ROOT = Path(__file__).parents[1]
ELASTIC = str(ROOT / "data" / "demo" / "elastic.h5")
YEOH = ["--energy", "reduced-polynomial-2"]


def answer(capsys, *argv) -> tuple[int, dict]:
    """Exit code and the JSON on standard output."""
    code = main([*argv, "--json"])
    return code, json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("name", sorted(commands()))
def test_help_teaches(name, capsys):
    with pytest.raises(SystemExit) as end:
        main([name, "--help"])
    text = capsys.readouterr().out
    assert end.value.code == 0
    assert f"tissuejax {name}" in text.split("positional")[0].split("options")[0], "no example"
    assert "--json" in text


def test_the_list_of_commands(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--help"])
    assert end.value.code == 0
    text = capsys.readouterr().out
    assert all(f"    {entry.name}" in text and entry.summary.split(", ")[0][:25] in text for entry in listed())
    assert main([]) == 2
    assert main(["sensitivity", "--nois", "1", "--nonsense", "2"]) == 2
    assert "`tissuejax sensitivity --help`" in capsys.readouterr().err


def test_the_catalogue(capsys):
    code, record = answer(capsys, "energies")
    assert code == 0
    assert {"neo-hookean", "ogden-N", "gent", "+fibre"} <= set(record["energies"])
    assert all(e["formula"] and e["source"] and e["valid"] for e in record["energies"].values())
    assert "in-vivo-3" in record["published"]


def test_the_catalogue_of_effects(capsys):
    code, record = answer(capsys, "effects")
    assert code == 0
    found = record["effects"]
    assert {"friction", "drift", "hysteresis", "specimen-scatter", "force-hum", "dulling"} <= set(found)
    assert all(e["what"] and e["reveals"] and e["blind"] and e["source"] and e["kinds"] for e in found.values())
    assert all(e["parameters"] or e["remedy"] for e in found.values()), "neither a fit nor a word on what to do"
    _, record = answer(capsys, "effects", "--of", "cutting")
    assert "dulling" in record["effects"]
    assert "friction" not in record["effects"]


def test_a_picture_of_an_energy(capsys, tmp_path):
    code, record = answer(capsys, "energies", "--plot", "in-vivo-1", "--out", str(tmp_path))
    assert code == 0
    assert Path(record["files"]["energy"]).stat().st_size > 5000


def test_inspect(capsys, tmp_path):
    code, record = answer(capsys, "inspect", ELASTIC, "--out", str(tmp_path))
    assert code == 0
    tension = record["recordings"]["tension"]
    assert tension["experiment"] == "uniaxial"
    assert tension["channels"]["nominal_stress"]["noise_std"] == 8.0
    assert tension["inputs"]["stretch"]["max"] == pytest.approx(1.35, abs=1e-3)
    assert (tmp_path / "overview.png").exists()


def test_fit_writes_everything(capsys, tmp_path):
    argv = ["fit", ELASTIC, *YEOH, "--holdout", "holdout", "--out", str(tmp_path), "--multistart", "1"]
    code, record = answer(capsys, *argv, "--start", "energy.C10=0.5 kPa", "--bounds", "energy.C20=0:2 kPa")
    assert code == 0
    assert record["parameters"]["energy.C10"]["value"] == pytest.approx(620, rel=0.01)
    assert json.loads((tmp_path / "result.json").read_text())["status"] == "converged"
    assert (tmp_path / "report.html").exists()
    assert not list(tmp_path.glob(".*")), "a temporary file was left"


def test_every_sample_of_a_file_in_one_table(capsys, tmp_path):
    table = "specimen,stretch,stress\n" + "".join(
        f"{name},{l},{mu * (l - l**-2)}\n" for name, mu in (("a", 3.0), ("b", 5.0)) for l in (1.0, 1.1, 1.2, 1.3)
    )
    (tmp_path / "lab.csv").write_text(table)
    (tmp_path / "lab.toml").write_text(
        """file = "lab.csv"
sample = "{specimen}"
recording = "pull"
experiment = "uniaxial"
[columns]
stretch = { column = "stretch" }
nominal_stress = { column = "stress", unit = "kPa" }
"""
    )
    argv = ["fit", str(tmp_path / "lab.toml"), "--each", "--energy", "neo-hookean", "--out", str(tmp_path / "out")]
    code, record = answer(capsys, *argv)
    assert code == 0
    assert record["fits"]["a"]["energy.mu"] == pytest.approx(3000.0, rel=1e-6)
    assert record["fits"]["b"]["energy.mu"] == pytest.approx(5000.0, rel=1e-6)
    assert (tmp_path / "out" / "fits.csv").read_text().count("\n") == 3
    assert json.loads((tmp_path / "out" / "b" / "result.json").read_text())["status"] == "converged"


def test_sensitivity_of_a_result_and_of_a_published_material(capsys, tmp_path):
    out = str(tmp_path)
    main(["fit", ELASTIC, *YEOH, "--only", "tension", "--out", out, "--multistart", "1"])
    capsys.readouterr()
    code, record = answer(
        capsys, "sensitivity", ELASTIC, "--result", f"{out}/result.json", "--samples", "16", "--out", out
    )
    assert code == 0
    assert set(record["local"]["values"]) == {"energy.C10", "energy.C20"}
    code, record = answer(capsys, "sensitivity", "--published", "in-vivo-1", "--samples", "16", "--out", out)
    assert code == 2
    assert "--force" in record["error"]
    code, record = answer(capsys, "sensitivity", "--published", "in-vivo-1", "--samples", "16", "--out", out, "--force")
    assert code == 0
    assert len(record["local"]["directions"]) == 4
    assert (tmp_path / "fisher.png").exists()


def test_not_converged_is_exit_code_3_and_still_writes(capsys, tmp_path):
    argv = ["fit", ELASTIC, "--energy", "gent", "--max-steps", "2", "--multistart", "1", "--out", str(tmp_path)]
    code, record = answer(capsys, *argv)
    assert code == 3
    assert record["status"].startswith("no convergence")
    assert record["warnings"][0].startswith("Not converged")


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["fit", ELASTIC, "--energy", "neohookean"], "Did you mean 'neo-hookean'"),
        (["fit", ELASTIC, "--energy", "ogden-2"], "need their form"),
        (["fit", ELASTIC, "--energy", "reduced-polynomial"], "needs its order"),
        (["fit", ELASTIC, *YEOH, "--fix", "energy.C11=3"], "Did you mean 'energy.C10'"),
        (["fit", ELASTIC, *YEOH, "--fix", "energy.C10"], "PATH=VALUE"),
        (["fit", ELASTIC, *YEOH, "--start", "energy.C10=3 mm"], "dimension"),
        (["fit", ELASTIC, *YEOH, "--start", "energy.C10=-3"], "allowed is 0"),
        (["fit", ELASTIC, *YEOH, "--bounds", "energy.C20=5:1"], "lower must be below upper"),
        (["fit", ELASTIC, *YEOH, "--bounds", "energy.C20=5"], "PATH=A:B"),
        (["fit", ELASTIC, *YEOH, "--holdout", "holdut"], "Did you mean 'holdout'"),
        (["fit", ELASTIC, *YEOH, "--holdout", "holdout", "--holdout", "holdout"], "listed twice"),
        (["fit", ELASTIC, *YEOH, "--only", "tension", "--holdout", "tension"], "at once"),
        (["fit", ELASTIC, *YEOH, "--weights", "noise"], "choice of weights"),
        (["fit", ELASTIC, *YEOH, "--loss", "l1"], "unknown loss"),
        (["fit", ELASTIC, *YEOH, "--method", "newton"], "method"),
        (["fit", ELASTIC, *YEOH, "--multistart", "0"], "1 or more"),
        (["fit", "nowhere.h5", *YEOH], "no such file"),
        (["inspect", str(ROOT / "LICENSE")], "another format"),
        (["fit", ELASTIC, *YEOH, "--effect", "hysteresis"], "hysteresis has no parameters: there is nothing"),
        (["energies", "--plot", "gentle"], "Did you mean 'gent'"),
        (["effects", "hysteresys"], "Did you mean 'hysteresis'"),
        (["sensitivity"], "--published NAME"),
        (["sensitivity", "--published", "in-vivo-9"], "Did you mean"),
        (["sensitivity", ELASTIC, "--result", ELASTIC], "not a result.json"),
        (["study", "nowhere"], "study.py"),
    ],
)
def test_refusals_are_one_sentence_and_exit_code_2(argv, words, capsys):
    code = main([*argv, "--json"])
    out, err = capsys.readouterr()
    assert code == 2
    assert words in json.loads(out)["error"]
    assert "Traceback" not in err


@pytest.mark.parametrize("verb", [["inspect"], ["fit", "--energy", "neo-hookean"]])
def test_a_body_leads_to_the_side_file_of_a_probing(verb, tmp_path, capsys):
    ball = tmp_path / "ball.stl"
    trimesh.creation.icosphere(1).export(ball)
    assert main([*verb, str(ball)]) == 2
    assert "side file of a probing" in capsys.readouterr().err


def test_an_empty_file_is_refused(tmp_path, capsys):
    empty = tmp_path / "empty.h5"
    empty.touch()
    assert main(["fit", str(empty), *YEOH]) == 2
    assert "empty file" in capsys.readouterr().err


@pytest.mark.parametrize("tried", [("viscoelasticity", "slack", "drift"), pytest.param(None, marks=pytest.mark.slow)])
def test_the_demo_fits_fails_to_fit_and_finds_out_why(capsys, tmp_path, monkeypatch, tried):
    """Among three effects, and among all of the catalogue, as a user has it."""
    monkeypatch.setattr(verbs, "diagnose", functools.partial(verbs.diagnose, effects=tried))
    code, record = answer(capsys, "demo", "--out", str(tmp_path))
    assert code == 0
    assert record["elastic"]["holdout"]["holdout/nominal_stress"]["chi2_per_sample"] < 1.2
    assert record["relaxing"]["holdout"]["holdout/nominal_stress"]["chi2_per_sample"] > 100
    found = record["diagnosis"]
    assert found["verdict"] == "found"
    assert [e["name"] for e in found["effects"]] == ["viscoelasticity"]
    assert found["after"]["holdout"]["nominal_stress"]["chi2_per_sample"] < 1.2
    for name in ("elastic", "relaxing", "diagnosis"):
        assert (tmp_path / name / "report.html").stat().st_size > 50_000


@pytest.mark.parametrize(("typed", "odds"), [((), 0.1), (("--rig", "unchecked"), 1.0), (("--rig", "verified"), 0.01)])
def test_what_is_typed_of_a_machine_is_how_it_is_judged(capsys, monkeypatch, typed, odds):
    asked = {}

    def stopped(*given, **options):
        asked.update(options)
        raise InputError("seen enough")

    monkeypatch.setattr(diagnose_command, "diagnose", stopped)
    assert main(["diagnose", ELASTIC, *YEOH, *typed]) == 2
    assert asked["criteria"].fault == odds


def test_help_and_the_bare_package_bring_no_jax_along():
    said = "import sys, tissuejax.cli as c; c.parser('x'); print('jax' in sys.modules, 'numpy' in sys.modules)"
    told = subprocess.run([sys.executable, "-c", said], capture_output=True, text=True, check=True)
    assert told.stdout.split() == ["False", "False"]


def test_commands_listed_without_importing_are_those_there_are():
    assert [(c.name, c.summary, c.order, c.stopped) for c in listed()] == [
        (c.name, c.summary, c.order, c.stopped) for c in commands().values()
    ]


def test_inspecting_brings_no_plots_along():
    said = (
        "import sys, tissuejax.commands.inspecting; print('matplotlib' in sys.modules, 'scipy.signal' in sys.modules)"
    )
    told = subprocess.run([sys.executable, "-c", said], capture_output=True, text=True, check=True)
    assert told.stdout.split() == ["False", "False"]


def test_a_study_notes_when_and_by_which_code_it_ran(tmp_path, capsys):
    (tmp_path / "study.py").write_text("def main(folder):\n    return '1 of 1 right'\n")
    (tmp_path / "run.json").write_text('{"diagnosis.py": {"answer": "kept"}}')
    assert main(["study", str(tmp_path)]) == 0
    noted = json.loads((tmp_path / "run.json").read_text())
    assert noted["diagnosis.py"] == {"answer": "kept"}
    assert noted["study.py"]["answer"] == "1 of 1 right"
    assert noted["study.py"]["source"] == source.LOADED
    assert abs(datetime.now(UTC) - datetime.fromisoformat(noted["study.py"]["date"])).total_seconds() < 600


def test_a_warning_is_one_line_and_that_of_a_library_none(capsys):
    _warned(UserWarning("the cache may be written by others"), UserWarning, "programs.py", 3)
    _warned(FutureWarning("this library moves"), FutureWarning, "library.py", 3)
    assert capsys.readouterr().err == "tissuejax: the cache may be written by others\n"


def test_a_result_that_is_not_there_is_called_that(tmp_path, capsys):
    assert main(["export", str(tmp_path / "no.json"), "--to", "abaqus"]) == 2
    assert "no such file" in capsys.readouterr().err
    assert main(["export", str(tmp_path), "--to", "abaqus"]) == 2
    assert "found a folder" in capsys.readouterr().err
    (tmp_path / "other.json").write_text("{}")
    assert main(["export", str(tmp_path / "other.json"), "--to", "abaqus"]) == 2
    assert "it has no 'energy'" in capsys.readouterr().err


def test_one_energy_of_the_catalogue_is_shown_by_any_of_its_names(capsys):
    for typed, shown in {"Yeoh": "reduced-polynomial-N", "hgo": "hgo", "ogden-3+fibre": "ogden-N"}.items():
        assert main(["energies", typed]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines[0] == shown
        assert [line for line in lines if not line.startswith(" ")] == [shown] + ["+fibre"] * ("+fibre" in typed)
    assert main(["energies", "nope"]) == 2
    assert "unknown energy" in capsys.readouterr().err


@pytest.mark.slow
def test_sensitivities_of_a_fit_with_one_relaxation_term(tmp_path, capsys):
    """The record names the effect; its number of terms is told by its constants."""
    recordings = str(Path(__file__).parents[1] / "data/demo/relaxing.h5")
    asked = ["--energy", "reduced-polynomial-2", "--effect", "viscoelasticity-1", "--out", str(tmp_path / "fit")]
    assert main(["fit", recordings, *asked, "--multistart", "1", "--start", "energy.C10=400 Pa"]) == 0
    capsys.readouterr()
    result = str(tmp_path / "fit/result.json")
    assert main(["sensitivity", recordings, "--result", result, "--out", str(tmp_path / "s"), "--json"]) == 0
    told = capsys.readouterr().out
    assert "effects.viscoelasticity.tau1" in told
    assert "effects.viscoelasticity.tau2" not in told


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        (["--noise", "-1 Pa"], "0 or more"),
        (["--noise", "20 Pa", "--seed", "-1"], "whole number from 0 on"),
        (["--rate", "1e9"], "lower --rate"),
        (["--set", "energy.mu=-3 kPa"], "energy.mu"),
    ],
)
def test_a_simulation_that_can_not_be_is_refused(typed, words, capsys, tmp_path):
    base = ["simulate", "--energy", "neo-hookean", "--mode", "uniaxial", "--path", "0:1 1:1.2"]
    given = [] if "--set" in typed else ["--set", "energy.mu=3 kPa"]
    assert main([*base, *given, *typed, "--out", str(tmp_path / "o")]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert len(said.strip().splitlines()) == 1


@pytest.mark.parametrize(
    "constants", [["energy.C10=-1 kPa", "energy.C01=-2 kPa"], ["energy.C10=1 kPa", "energy.C01=-1.5 kPa"]]
)
def test_a_material_without_stiffness_at_rest_is_refused(constants, capsys, tmp_path):
    """mu = 2 (C10 + C01) of Mooney-Rivlin."""
    told = [x for c in constants for x in ("--set", c)]
    base = ["simulate", "--energy", "mooney-rivlin", "--mode", "uniaxial", "--path", "0:1 1:1.2"]
    assert main([*base, *told, "--out", str(tmp_path / "o")]) == 2
    assert "shear modulus at rest would be -" in capsys.readouterr().err


def test_standard_output_on_a_full_disk_ends_in_a_sentence():
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "tissuejax", "energies"], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 2
    assert "the disk is full" in done.stderr
    assert "Traceback" not in done.stderr

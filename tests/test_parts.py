"""Parts of a study: taken up only where the same code made them."""

import json
import runpy
import shutil
import sys
from pathlib import Path
from types import ModuleType

import pytest

from tissuejax.cache import source
from tissuejax.cache.parts import MADE_BY, ONLY, Parts

FITS = source.ROOT.parent / "fits"


@pytest.fixture
def study(tmp_path, monkeypatch):
    """Two files of a study, and what a fresh process that knows them finds in its result.json."""
    monkeypatch.delenv(ONLY, raising=False)
    files = [tmp_path / name for name in ("cases.py", "more.py")]
    for file in files:
        file.write_text("x = 1\n")
    return files, lambda: Parts(tmp_path / "result.json", files)


def test_a_part_is_taken_up_as_long_as_its_code_is_the_same(study):
    (cases, more), fresh = study
    assert fresh().get("a", lambda: {"n": 1}, [cases]) == {"n": 1}
    kept = fresh()
    assert kept.get("a", lambda: pytest.fail("worked out again"), [cases]) == {"n": 1}
    assert kept.said() == ""
    more.write_text("x = 2\n")
    assert fresh().get("a", lambda: pytest.fail("it does not need that file"), [cases]) == {"n": 1}
    cases.write_text("x = 2\n")
    kept = fresh()
    assert kept.get("a", lambda: {"n": 2}, [cases]) == {"n": 2}
    assert kept.said() == "worked out (its code had changed): a"
    assert fresh().get("a", lambda: pytest.fail("worked out again"), [cases]) == {"n": 2}


def test_a_changed_package_is_other_code(study, monkeypatch):
    _, fresh = study
    fresh().get("a", lambda: 1)
    with monkeypatch.context() as patched:
        patched.setattr(source, "LOADED", "another version")
        assert fresh().get("a", lambda: 2) == 2
    assert fresh().get("a", lambda: 3) == 3


def test_a_part_made_of_another_follows_it(study):
    _, fresh = study
    fresh().get("a", lambda: 1, of=[1.0, 2.0])
    assert fresh().get("a", lambda: 2, of=(1.0, 2.0)) == 1
    assert fresh().get("a", lambda: 2, of=[1.0, 3.0]) == 2


def test_what_was_made_while_its_code_moved_is_never_taken_up(study, monkeypatch):
    (cases, _), fresh = study

    def edited():
        cases.write_text("x = 3\n")
        return 1

    fresh().get("a", edited)
    cases.write_text("x = 1\n")
    assert fresh().get("a", lambda: 2) == 2
    monkeypatch.setattr(source, "_AT_IMPORT", {**source.marks(), "energies/new.py": (1, 1, 1)})
    monkeypatch.setitem(sys.modules, "tissuejax.energies.new", ModuleType("tissuejax.energies.new"))
    kept = fresh()
    assert kept.get("a", lambda: 3) == 3
    assert kept.made_by["a"] == {"code": None}


def test_parts_of_earlier_code_are_known_as_such(study, tmp_path, monkeypatch):
    _, fresh = study
    stored = {"a": 1, "b": 2, MADE_BY: {"a": {"earlier": "b66d183"}, "b": {"earlier": "b66d183"}}}
    (tmp_path / "result.json").write_text(json.dumps(stored))
    monkeypatch.setenv(ONLY, "b; c")
    kept = fresh()
    assert (kept.get("a", lambda: 3), kept.get("b", lambda: 4), kept.get("new", lambda: 5)) == (1, 4, 5)
    assert kept.said() == (
        "worked out (stored at b66d183, by earlier code): b. worked out (not there before): new. "
        "left as other code made them: a"
    )
    found = json.loads((tmp_path / "result.json").read_text())[MADE_BY]
    assert found["a"] == {"earlier": "b66d183"}
    assert set(found["b"]) == {"code"}


@pytest.mark.parametrize("name", ["source", "cutting"])
def test_a_study_names_the_code_of_every_part(name, tmp_path):
    stored = json.loads((FITS / name / "result.json").read_text())
    made_by = stored.pop(MADE_BY)
    assert stored.keys() == made_by.keys()
    assert all(set(m) <= {"earlier", "code"} and any(m.values()) for m in made_by.values())
    needed = runpy.run_path(str(FITS / name / "study.py"))["needed"](FITS / name)
    assert all(file.is_file() for files in needed.values() for file in files)


@pytest.mark.parametrize("name", ["source", "cutting"])
def test_a_copy_of_a_study_reads_its_neighbours_in_the_checkout(name, tmp_path):
    """`tissuejax study --out`: numbers of other studies and benchmarks are not beside the copy."""
    folder = Path(shutil.copytree(FITS / name, tmp_path / "studies" / name))
    needed = runpy.run_path(str(folder / "study.py"))["needed"](folder)
    assert all(file.is_file() for files in needed.values() for file in files)
    beyond = {file for files in needed.values() for file in files if folder not in file.parents}
    assert beyond
    assert all(source.ROOT.parent in file.parents for file in beyond)


def test_the_table_of_the_source_is_drawn_in_a_copy(tmp_path):
    """From the numbers that are stored, all 58 rows, with what it takes from the checkout's other studies."""
    folder = Path(shutil.copytree(FITS / "source", tmp_path / "studies" / "source"))
    parts = json.loads((folder / "result.json").read_text())
    assert len(runpy.run_path(str(folder / "table.py"))["rows"](parts)) == 58


CASES = """
WORTH = {worth}
def part():
    return {{"worth": WORTH, "runs": [dict(what="entry included", energy_percent=WORTH, strength_percent=0.0,
                                           friction_percent=0.0)]}}
"""
NAMES = runpy.run_path(str(FITS / "cutting" / "study.py"))["PARTS"]


def test_the_study_of_cutting_runs_again_what_an_edit_changed(tmp_path, monkeypatch):
    monkeypatch.delenv(ONLY, raising=False)

    def run(worth: float) -> str:
        text = CASES.format(worth=worth) + "".join(f"{name} = part\n" for name in NAMES)
        (tmp_path / "cases.py").write_text(text)
        return runpy.run_path(str(tmp_path / "study.py"))["main"](tmp_path)

    for name in ("separation", "source_run"):
        (tmp_path / f"{name}.py").write_text("")
    (tmp_path / "page.py").write_text("def write(folder, found):\n    assert 'made by' not in found\n")
    (tmp_path / "study.py").write_text((FITS / "cutting" / "study.py").read_text())
    assert "worked out (not there before): bonded; peel" in run(1.0)
    assert run(1.0).endswith("energy 1.0 %, strength 0.0 %, friction 0.0 %; see report.html")
    (tmp_path / "source_run.py").write_text("x = 1\n")
    assert run(1.0).endswith("worked out (its code had changed): source")
    said = run(2.0)
    assert "energy 2.0 %" in said
    assert said.endswith(f"worked out (its code had changed): {'; '.join(NAMES)}")
    assert {p["worth"] for n, p in json.loads(Path(tmp_path / "result.json").read_text()).items() if n in NAMES} == {
        2.0
    }

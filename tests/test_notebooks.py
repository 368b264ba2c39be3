"""Every notebook runs from top to bottom, ends in numbers that it asserts, and is stored with what it printed."""

import os
import re
import runpy
from pathlib import Path

import nbformat
import pytest

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
# run by `make slow`
LONG = ("which-ogden-form", "probing-stl", "probing-fit", "diagnose", "real-time", "probing-simulate", "cut")
LARGEST = 200_000  # bytes of a stored notebook
NEAR, SMALL = 0.1, 1e-2  # numbers printed again: this near, or both this small (errors, differences)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
executed = runpy.run_path(str(ROOT / "notebooks" / "execute.py"))["executed"]


def printed(notebook) -> str:
    """All that was printed; a temporary folder has another name each time."""
    streams = [o.text for c in notebook.cells for o in c.get("outputs", ()) if o.output_type == "stream"]
    return re.sub(r"/tmp/\w+", "/tmp/x", "".join(streams))


@pytest.mark.parametrize(
    "path",
    [pytest.param(p, id=p.stem, marks=[pytest.mark.slow] if p.stem in LONG else []) for p in NOTEBOOKS],
)
def test_it_runs_and_prints_what_is_stored(path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    notebook = nbformat.read(path, as_version=4)
    assert "assert" in notebook.cells[-1].source, "a notebook ends in numbers that are asserted"
    now, stored = printed(executed(path)), printed(notebook)
    again = f"the stored output is not this code's: python notebooks/execute.py {path.stem}"
    assert NUMBER.sub("#", now) == NUMBER.sub("#", stored), again
    for a, b in zip(map(float, NUMBER.findall(now)), map(float, NUMBER.findall(stored)), strict=True):
        assert abs(a - b) <= NEAR * max(abs(a), abs(b)) or max(abs(a), abs(b)) < SMALL, f"{a} for {b}: {again}"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_it_is_stored_with_outputs_and_a_picture(path):
    cells = nbformat.read(path, as_version=4).cells
    outputs = [o for c in cells for o in c.get("outputs", ())]
    assert not any(o.output_type == "error" for o in outputs)
    assert any("image/png" in o.get("data", {}) for o in outputs), "a notebook draws"
    assert all(c.execution_count for c in cells if c.cell_type == "code"), "a cell was not run"
    assert path.stat().st_size < LARGEST


def test_there_are_some():
    assert len(NOTEBOOKS) >= 2

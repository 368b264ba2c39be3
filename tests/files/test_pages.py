"""The pages on files: what they show reads, and the example of a probing is what the page says."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tissuejax.mesh.probing_files import probing_sample
from tissuejax.recordings.files import read
from tissuejax.recordings.side_file import parse

ROOT = Path(__file__).parents[2]


def shown(page, kind):
    return re.findall(rf"```{kind}\n(.*?)```", (ROOT / "docs" / page).read_text(), re.S)


def test_the_side_file_of_the_page(tmp_path):
    (tmp_path / "s.toml").write_text(shown("own-csv.md", "toml")[0])
    (part,) = parse(tmp_path / "s.toml").parts
    assert set(part.columns) == {"time", "displacement", "force"}
    assert part.specimen["height"] == pytest.approx(0.025)
    assert part.selection.preload == "0.02N"


def test_the_file_written_by_hand(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile(shown("recording-format.md", "python")[0], "recording-format.md", "exec"), {})
    assert read("mine.h5").recordings["pull"].inputs["stretch"][-1] == pytest.approx(1.3)


def test_the_probing_example():
    page, file = (
        tomllib.loads(t) for t in (shown("own-probing.md", "toml")[0], (ROOT / "data/probing/probe.toml").read_text())
    )
    assert page["probing"] == file["probing"]
    assert page["registration"] == file["registration"]
    sample = probing_sample(ROOT / "data/probing/probe.toml")
    press = sample.recordings["press"]
    # The robot's frame is turned and shifted; in the body's the ball goes 5 mm into the top at 30 mm.
    lowest = np.asarray(press.inputs["probe/position"])[:, 2].min()
    assert lowest == pytest.approx(0.030 + 0.008 - 0.005, abs=1e-6)
    np.testing.assert_allclose(np.asarray(press.inputs["probe/position"])[:, :2], 0, atol=1e-6)
    assert np.asarray(press.channels["force"].values)[:, 2].max() == pytest.approx(0.41, abs=0.02)
    np.testing.assert_allclose(np.ptp(sample.geometry.points, axis=0), [0.08, 0.06, 0.03], rtol=0.02)

"""A diagnosis of a material test that was stopped goes on: what was weighed is on disk, and the answer is the same."""

import json
import shutil
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from tests.diagnosis.test_budget import sample
from tissuejax.cache import source
from tissuejax.diagnosis.diagnose import diagnose
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.progress import Progress, Stage
from tissuejax.recordings.recording import Sample


class Notes(Progress, Stage):
    """Collects what is reported; stops the diagnosis, as Ctrl-C does, at the n-th report."""

    def __init__(self, n: int | None = None):
        self.n, self.said = n, []

    @contextmanager
    def stage(self, description: str, total: int | None = None):
        yield self

    def advance(self, steps: int = 1, note: str = "") -> None:
        self.said.append(note)
        if self.n is not None and len(self.said) >= self.n:
            raise KeyboardInterrupt


def asked(out, n=None):
    notes = Notes(n)
    return diagnose(sample(), "neo-hookean", effects=("drift", "aging"), out=out, progress=notes), notes.said


def test_a_stopped_diagnosis_goes_on(tmp_path):
    whole, said = asked(tmp_path / "whole")
    assert not (tmp_path / "whole" / "runs").exists()
    half = len(said) // 2
    with pytest.raises(KeyboardInterrupt):
        asked(tmp_path / "stopped", half)
    kept = json.loads((tmp_path / "stopped" / "runs" / "weighed.json").read_text())
    assert len(kept["sets"]) >= 2
    again, told = asked(tmp_path / "stopped")
    assert any("going on" in s for s in told)
    assert not (tmp_path / "stopped" / "runs").exists()
    a, b = whole.as_dict(), again.as_dict()
    assert a["verdict"] == b["verdict"]
    assert json.dumps(a["effects"]) == json.dumps(b["effects"])
    assert again.answered.exploration.kept.taken_up == len(kept["sets"])
    assert again.answered.exploration.bench.spent < 0.9 * whole.answered.exploration.bench.spent
    first = {s.keys: s.log_evidence for s in whole.answered.evidence.sets}
    other = {s.keys: s.log_evidence for s in again.answered.evidence.sets}
    assert first.keys() == other.keys()
    for keys, total in first.items():
        # a round of fit and amplitudes that gains less than 0.1 is the last one (`weigh.SETTLED`)
        assert other[keys] == pytest.approx(total, abs=0.1)


def gone_on(folder, changed=None, criteria=None, energy="neo-hookean") -> bool:
    """Whether a diagnosis that is begun in `folder` takes anything up; it is stopped soon."""
    notes = Notes(2)
    with pytest.raises(KeyboardInterrupt):
        diagnose(changed or sample(), energy, effects=("drift", "aging"), out=folder, progress=notes, criteria=criteria)
    return any("going on" in s for s in notes.said)


def test_only_what_was_kept_of_the_same_question_is_taken_up(tmp_path, monkeypatch):
    """Another model, one reading, the noise, a height, a number of the judgement, a line of the code."""
    with pytest.raises(KeyboardInterrupt):
        asked(tmp_path / "stopped", 4)

    def anew() -> Path:
        return shutil.copytree(tmp_path / "stopped", tmp_path / f"copy {len(list(tmp_path.iterdir()))}")

    def with_last(**changed) -> Sample:
        made = sample()
        return replace(made, recordings=made.recordings | {"r3": replace(made.recordings["r3"], **changed)})

    channel = sample().recordings["r3"].channels["nominal_stress"]
    values = channel.values.copy()
    values[7] += 1e-3
    assert gone_on(anew())
    assert not gone_on(anew(), energy="mooney-rivlin")
    assert not gone_on(anew(), with_last(channels={"nominal_stress": replace(channel, values=values)}))
    assert not gone_on(anew(), with_last(channels={"nominal_stress": replace(channel, noise_std=2.1)}))
    assert not gone_on(anew(), with_last(attributes={"start": 201.0}))
    assert not gone_on(anew(), criteria=Criteria(rig=0.11))
    with monkeypatch.context() as edited:
        edited.setattr(source, "LOADED", "another line")
        assert not gone_on(anew())

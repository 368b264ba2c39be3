"""A diagnosis of a material test that was stopped goes on: what was weighed is on disk, and the answer is the same."""

import json
from contextlib import contextmanager

import pytest

from tests.diagnosis.test_budget import sample
from tissuejax.diagnosis.diagnose import diagnose
from tissuejax.progress import Progress, Stage


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


def asked(out, n=None, energy="neo-hookean"):
    notes = Notes(n)
    return diagnose(sample(), energy, effects=("drift", "aging"), out=out, progress=notes), notes.said


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


def test_what_was_kept_of_another_model_is_not_taken_up(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        asked(tmp_path, 4)
    _, told = asked(tmp_path, energy="mooney-rivlin")
    assert not any("going on" in s for s in told)

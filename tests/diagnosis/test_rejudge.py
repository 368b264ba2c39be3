"""A stored set of cases judged again, from outside: evidence on disk, the command, and odds worked out by hand.

Two effects are offered in one form each. A set of one effect has the prior sizes[1] / 2, the base sizes[0]; with log
evidences L and 0 and a power p the odds of the effect are sizes[1] / (2 sizes[0]) e^(p L), and nothing else is weighed.
"""

import json
import math
from dataclasses import replace

import pytest

from tissuejax.cli import main
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.evidence import Evidence, SetEvidence, read_evidence, write_evidence
from tissuejax.diagnosis.judgement.judge import Kind, judge
from tissuejax.diagnosis.judgement.numbers import Numbers
from tissuejax.diagnosis.judgement.rejudge import JUDGED, rejudge, verdict_of
from tissuejax.errors import InputError

USUAL = Criteria()
N = 200  # block means
HALF = USUAL.sizes[1] / (2 * USUAL.sizes[0])  # prior odds of one effect of two


def a_set(names, log_evidence, chi2=N, rest=0.0):
    return SetEvidence(
        keys=names, names=names, log_evidence=log_evidence, fit=log_evidence, parameters=0.0, discrepancy=0.0,
        amplitudes={}, k=2, at_bound=(), void=False, chi2=chi2, n=N, kurtosis=0.0, explained=0.0,
        rest=(rest**2, 1e-12), numerical=0.0,
    )  # fmt: skip


@pytest.fixture
def stored(tmp_path):
    """Three cases: "shown" (odds 3 to 2), "left" (half of what is left is a rest: evidence to a power), "bare"."""
    cases = {
        "shown": [a_set((), 0.0), a_set(("slack",), math.log(3.0))],
        "left": [a_set((), 0.0, chi2=2 * N), a_set(("slack",), math.log(8.0), chi2=2 * N, rest=0.1)],
        "bare": [a_set((), 0.0, rest=0.1), a_set(("slack",), -5.0)],
    }
    for name, sets in cases.items():
        folder = tmp_path / "results" / name
        folder.mkdir(parents=True)
        write_evidence(Evidence(tuple(sets), {"slack": 1, "drift": 1}, ("r1",), ()), folder / "evidence.json")
        (folder / "result.json").write_text(json.dumps({"verdict": "?", "parameters": {"mu": 1.0}}))
    return tmp_path


def results(folder):
    return {p.parent.name: json.loads(p.read_text()) for p in folder.glob("results/*/result.json")}


def test_the_same_criteria_say_what_the_odds_are(stored, capsys):
    assert main(["challenge", "judge", str(stored), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)["verdicts"]
    assert said == {"bare": "unexplained", "left": "found-in-part", "shown": "found"}
    kept = results(stored)
    odds = 3.0 * HALF
    assert kept["shown"]["confidence"] == pytest.approx(odds / (1 + odds))
    assert kept["shown"]["inclusion"] == pytest.approx({"slack": odds / (1 + odds), "drift": 0.0})
    power = USUAL.coarse / (USUAL.coarse + 0.5 * N)  # half of what is left is a rest
    odds = 8.0**power * HALF
    assert kept["left"]["inclusion"]["slack"] == pytest.approx(odds / (1 + odds))
    assert all(r["parameters"] == {"mu": 1.0} for r in kept.values()), "what a fit says stays"
    assert main(["challenge", "judge", str(stored), "--json"]) == 0
    assert results(stored) == kept, "judged twice, the same"


def test_other_criteria_change_what_the_algebra_says_and_rewrite_nothing(stored, capsys):
    rejudge(stored)
    before = results(stored)
    # 8^p / 2 against 1: named from p = 1/3 on; p = 1 / (1 + 100 / coarse), so from coarse = 50 on
    for coarse, verdict in ((51, "found-in-part"), (49, "nothing-missing")):
        assert main(["challenge", "judge", str(stored), "--number", f"criteria.coarse={coarse}", "--json"]) == 0
        said = json.loads(capsys.readouterr().out)["verdicts"]
        assert said == {"bare": "unexplained", "left": verdict, "shown": "found"}, "no rest, no power"
    # a rest of a tenth of the peak is negligible below twice that, and nothing else changes its name
    said = rejudge(stored, Criteria(negligible=0.2))
    assert said == {"bare": "nothing-missing", "left": "found", "shown": "found"}
    # 3 x 0.1 / (2 x 0.8) is less than even
    assert rejudge(stored, Criteria(sizes=(0.8, 0.1, 0.1)))["shown"] == "nothing-missing"
    assert results(stored) == before


def test_what_can_not_be_judged_is_refused(stored, tmp_path, capsys):
    assert main(["challenge", "judge", str(tmp_path / "elsewhere")]) == 2
    assert "challenge run" in capsys.readouterr().err
    for given in ("criteria.coarse", "effort.most=2", "criteria.corse=1"):
        assert main(["challenge", "judge", str(stored), "--number", given]) == 2
        assert "criteria.coarse" in capsys.readouterr().err
    (stored / "results" / "shown" / "evidence.json").write_text("{}")
    with pytest.raises(InputError, match="no evidence of a diagnosis"):
        rejudge(stored)


class Read(Criteria):
    """Notes which numbers are asked for."""

    def __getattribute__(self, name):
        if name in USUAL.__dataclass_fields__:
            ASKED.add(name)
        return super().__getattribute__(name)


ASKED: set[str] = set()


def test_a_number_that_no_judge_reads_is_refused_and_every_other_is_read(stored, capsys):
    """Asked of evidence it would change nothing, whatever it were: an answer that says nothing."""
    ASKED.clear()
    three = read_evidence(stored / "results" / "shown" / "evidence.json")
    sets = [a_set((), 0.0)] + [a_set((name,), 4.0) for name in three.forms]
    both = replace(three, sets=tuple(sets), simulated=True, faults=(*three.forms,))
    criteria = Read()
    judged = judge(both, criteria)
    assert judged.kind is Kind.AMBIGUOUS
    verdict_of(judged, criteria)
    assert {*JUDGED} == ASKED
    others = {p.split(".")[1]: p for p in Numbers().all() if p.startswith("criteria.")}
    for path in (others[name] for name in others.keys() - {*JUDGED}):
        assert main(["challenge", "judge", str(stored), "--number", f"{path}=1"]) == 2
        assert "run again" in capsys.readouterr().err


def test_evidence_of_before_is_still_read(stored):
    """A number that was never filled stood in it once."""
    path = stored / "results" / "shown" / "evidence.json"
    now = read_evidence(path)
    old = json.loads(path.read_text())
    for s in old["sets"]:
        s["held"] = None
    path.write_text(json.dumps(old))
    assert read_evidence(path) == now

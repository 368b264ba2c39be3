"""Stored evidence judged again, in milliseconds a case: what other criteria would have said."""

import json
from pathlib import Path

from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.evidence import read_evidence
from tissuejax.diagnosis.judgement.judge import Judgement, Kind, covering, judge
from tissuejax.errors import InputError
from tissuejax.storage import write_json

# The criteria that a judge reads; by the others sets are searched and weighed, and what they did is in the evidence.
JUDGED = ("sizes", "fault", "coarse", "lapse", "negligible", "named", "covered", "strong")


def verdict_of(j: Judgement, criteria: Criteria | None = None) -> dict:
    """The part of `result.json` that the judgement alone decides; effects by name."""
    named = j.names if j.kind is not Kind.AMBIGUOUS else j.chosen.names
    rivals = covering(j, criteria) if j.kind is Kind.AMBIGUOUS else ()
    return {
        "verdict": j.kind.value,
        "confidence": j.confidence,
        "probabilities": {k.value: p for k, p in j.probabilities.items()},
        "inclusion": dict(j.inclusion),
        "effects": [{"name": n} for n in named],
        "best_attempt": [] if named else [{"name": n} for n in j.chosen.names],
        "alternatives": [{"effects": list(s.names), "probability": p} for s, p in rivals],
    }


def rejudge(folder: Path, criteria: Criteria | None = None) -> dict[str, str]:
    """Judge the evidence of every case in FOLDER/results again; returns the verdicts by case.

    By the usual criteria the verdict in each `result.json` is rewritten; what a fit says (errors, parameters) stays as
    it was. By others nothing is written: a stored verdict is one by the usual criteria.

    Raises:
        InputError: no evidence there, or some that can't be read.
    """
    paths = sorted(Path(folder).glob("results/*/evidence.json"))
    if not paths:
        raise InputError(f"{folder}: no case with evidence; `tissuejax challenge run {folder}` writes it")
    out = {}
    for path in paths:
        verdict = verdict_of(judge(read_evidence(path), criteria), criteria)
        out[path.parent.name] = verdict["verdict"]
        if criteria is not None and criteria != Criteria():
            continue
        result = path.with_name("result.json")
        known = json.loads(result.read_text()) if result.exists() else {}
        write_json(result, known | verdict)
    return out

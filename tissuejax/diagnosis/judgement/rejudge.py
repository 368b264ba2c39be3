"""Stored evidence judged again, in milliseconds a case: what other criteria would have said."""

import json
from pathlib import Path

from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.evidence import Evidence, read_evidence
from tissuejax.diagnosis.judgement.judge import Judgement, Kind, covering, judge
from tissuejax.storage import write_json


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
    """Judge the evidence of every case in FOLDER/results again and rewrite the verdict in its `result.json`.

    What a fit says (errors, parameters) stays as it was. Returns the verdicts by case.

    Raises:
        InputError: evidence that can't be read.
    """
    out = {}
    for path in sorted(Path(folder).glob("results/*/evidence.json")):
        evidence: Evidence = read_evidence(path)
        verdict = verdict_of(judge(evidence, criteria), criteria)
        result = path.with_name("result.json")
        known = json.loads(result.read_text()) if result.exists() else {}
        write_json(result, known | verdict)
        out[path.parent.name] = verdict["verdict"]
    return out

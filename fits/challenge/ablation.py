"""Does a number of the judgement matter? Opened cases judged again with others, from their evidence, in seconds.

python fits/challenge/ablation.py out/rest-second     a folder that `tissuejax challenge run` has filled, keys and all

Prints, per setting: effects named with nothing wrong beside them, wrong answers where no effect of the catalogue acts,
all answers right, and the expected calibration error, as the grading of that kind of set counts them. Only folders
whose cases are opened should be looked at so. What sets are weighed by is in their evidence already
(`ablation_settings.WEIGHED`).
"""

import json
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from ablation_settings import settings

from tissuejax.challenge.rest_marks import mark_rest
from tissuejax.challenge.verdicts import mark
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.evidence import Evidence, read_evidence
from tissuejax.diagnosis.judgement.judge import judge
from tissuejax.diagnosis.judgement.rejudge import verdict_of

EDGES = (0.5, 0.7, 0.8, 0.9, 0.95)  # of stated probability


def stored(folder: Path) -> dict[str, tuple[Evidence, dict]]:
    """Evidence and result by case."""
    found = sorted(folder.glob("results/*/evidence.json"))
    return {p.parent.name: (read_evidence(p), json.loads(p.with_name("result.json").read_text())) for p in found}


@dataclass(frozen=True)
class Answer:
    """One case judged: whether an effect acts that could be named, whether the answer is right, and true as such."""

    acts: bool
    right: bool
    apt: bool
    stated: float


def answered(name: str, key: dict, said: dict, rest: bool) -> Answer:
    """An answer as the grading of its kind of set counts it."""
    if rest:
        m = mark_rest(name, key, said)
        return Answer(bool(m.truth), m.right if m.truth else not m.wrong, m.apt, said["confidence"])
    plain = mark(name, key, said)
    return Answer(plain.category in ("one", "two", "three"), plain.right, plain.apt, said["confidence"])


def row(cases: dict[str, tuple[Evidence, dict]], keys: dict, criteria: Criteria, rest: bool) -> str:
    """Four figures of these cases, judged by these criteria."""
    marks = [
        answered(name, keys[name], result | verdict_of(judge(evidence, criteria), criteria), rest)
        for name, (evidence, result) in cases.items()
    ]
    apt, stated = np.array([m.apt for m in marks]), np.array([m.stated for m in marks])
    bins = np.digitize(stated, EDGES)
    error = sum(abs(stated[bins == b].mean() - apt[bins == b].mean()) * np.mean(bins == b) for b in set(bins))
    effects = np.mean([m.right for m in marks if m.acts])
    wrong = np.mean([not m.right for m in marks if not m.acts])
    every = np.mean([m.right for m in marks])
    return f"effects {effects:.0%}, wrong without one {wrong:.0%}, all right {every:.0%}, calibration {error:.2f}"


def main(folder: Path) -> None:
    """Print a row a setting."""
    keys = json.loads((folder / "sealed" / "keys.json").read_text())
    keys, cases = keys.get("cases", keys), stored(folder)
    made = json.loads((folder / "manifest.json").read_text())
    rest = made["kind"] == "rest" or bool(made.get("rest"))
    for label, criteria in settings(any(evidence.simulated for evidence, _ in cases.values())):
        print(f"{label:34s} {row(cases, keys, criteria, rest)}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))

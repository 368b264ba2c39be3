"""Does a number of the judgement matter? Opened cases judged again with others, from their evidence, in seconds.

python fits/challenge/ablation.py out/rest-second     a folder that `tissuejax challenge run` has filled, keys and all

Prints, per setting: effects named with nothing wrong beside them, wrong answers where no effect of the catalogue acts,
all answers right, and the expected calibration error, as the grading of that kind of set counts them. Only folders
whose cases are opened should be looked at so. What sets are weighed by is in their evidence already (`WEIGHED`).
"""

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tissuejax.challenge.rest_marks import mark_rest
from tissuejax.challenge.verdicts import mark
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.evidence import Evidence, read_evidence
from tissuejax.diagnosis.judgement.judge import judge
from tissuejax.diagnosis.judgement.rejudge import verdict_of

EDGES = (0.5, 0.7, 0.8, 0.9, 0.95)  # of stated probability
# What sets are fitted and weighed by is in their evidence already: these want the diagnoses run again.
WEIGHED = ("unknown", "shares", "strange", "sudden", "change", "rig", "shape", "misstated")


def settings() -> Iterator[tuple[str, Criteria]]:
    """The criteria as they are, and with one number changed, of all that a judge reads (all but `WEIGHED`)."""
    usual = Criteria()
    yield "as they are", usual
    for coarse in (25.0, 50.0, 100.0, 150.0, 300.0, 1000.0, 1e9):
        yield f"coarse {coarse:g}", replace(usual, coarse=coarse)
    for named in (0.3, 0.4, 0.7, 0.9):
        yield f"named from {named}", replace(usual, named=named)
    for negligible in (0.0025, 0.01, 0.02):
        yield f"negligible below {negligible}", replace(usual, negligible=negligible)
    for sizes in ((0.25, 0.25, 0.25, 0.25), (0.6, 0.3, 0.08, 0.02), (0.8, 0.18, 0.018, 0.002)):
        yield f"sizes {sizes}", replace(usual, sizes=sizes)
    for name in ("unseen", "covered"):
        value = getattr(usual, name)
        for factor in (0.5, 2.0):
            other = min(factor * value, 0.99) if isinstance(value, float) and value < 1 else type(value)(factor * value)
            yield f"{name} {other:g}", replace(usual, **{name: other})


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
    rest = json.loads((folder / "manifest.json").read_text())["kind"] == "rest"
    for label, criteria in settings():
        print(f"{label:34s} {row(cases, keys, criteria, rest)}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))

"""Does a number of the judgement matter? Opened cases judged again with others, from their evidence, in seconds.

python fits/challenge/ablation.py out/rest-second     a folder that `tissuejax challenge run` has filled, keys and all

Prints, per setting: effects named with nothing wrong beside them, wrong names where nothing but a rest acts, all
answers right, and the expected calibration error. Only folders whose cases are opened should be looked at so.
"""

import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from tissuejax.challenge.rest_marks import mark_rest
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
    for name in ("counted", "unseen", "covered"):
        value = getattr(usual, name)
        for factor in (0.5, 2.0):
            other = min(factor * value, 0.99) if isinstance(value, float) and value < 1 else type(value)(factor * value)
            yield f"{name} {other:g}", replace(usual, **{name: other})


def stored(folder: Path) -> dict[str, tuple[Evidence, dict]]:
    """Evidence and result by case."""
    found = sorted(folder.glob("results/*/evidence.json"))
    return {p.parent.name: (read_evidence(p), json.loads(p.with_name("result.json").read_text())) for p in found}


def row(cases: dict[str, tuple[Evidence, dict]], keys: dict, criteria: Criteria) -> str:
    """Four figures of these cases, judged by these criteria."""
    marks, stated = [], []
    for name, (evidence, result) in cases.items():
        said = result | verdict_of(judge(evidence, criteria), criteria)
        marks.append(mark_rest(name, keys[name], said))
        stated.append(said["confidence"])
    right, sure = np.array([m.right for m in marks]), np.array(stated)
    bins = np.digitize(sure, EDGES)
    error = sum(abs(sure[bins == b].mean() - right[bins == b].mean()) * np.mean(bins == b) for b in set(bins))
    effects = np.mean([m.right for m in marks if m.truth])
    wrong = np.mean([bool(m.wrong) for m in marks if not m.truth])
    return f"effects {effects:.0%}, wrong on a rest {wrong:.0%}, all right {right.mean():.0%}, calibration {error:.2f}"


def main(folder: Path) -> None:
    """Print a row a setting."""
    keys = json.loads((folder / "sealed" / "keys.json").read_text())
    keys, cases = keys.get("cases", keys), stored(folder)
    for label, criteria in settings():
        print(f"{label:34s} {row(cases, keys, criteria)}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))

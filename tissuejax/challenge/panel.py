"""Real recordings whose cause is known from their protocol: answers held against a file of causes written beforehand.

A protocol names groups of effects that it can't tell apart; the first group is the cause that counts. Names that the
protocol allows beside it are no mistake, any other is wrong. A null has no cause: a name of a physical effect is wrong.
"""

import math
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tissuejax.challenge.calibration import calibration
from tissuejax.challenge.rates import rate, spread
from tissuejax.challenge.verdicts import SETTLED, names_in
from tissuejax.errors import InputError

NO_PROCESS = ("energy-form", "specimen-scatter")  # names that claim no process in tissue or rig


@dataclass(frozen=True)
class Cause:
    """What the protocol of one sample says.

    Attributes:
        id, key: the sample and its protocol.
        null: nothing is missing.
        expected: groups of names; a group is met by any of its names.
        beside: names that are no mistake.
    """

    id: str
    key: str
    null: bool
    expected: tuple[frozenset[str], ...]
    beside: frozenset[str]


@dataclass(frozen=True)
class Answer:
    """One diagnosis held against its cause.

    Attributes:
        cause: what was to be named.
        verdict, named: what was said; names in the causes' own words.
        best: names of the best attempt, given as an answer or not.
        met: the first group was named.
        whole: all groups were.
        wrong: names that the protocol does not allow.
        right: for a cause: met and nothing wrong; for a null: no wrong physical name.
        apt: whether the answer as such is true ("ambiguous": the cause is among those offered); confidence is about it.
        confidence: as stated, or nan.
        seconds: of the diagnosis.
    """

    cause: Cause
    verdict: str
    named: tuple[str, ...]
    best: tuple[str, ...]
    met: bool
    whole: bool
    wrong: tuple[str, ...]
    right: bool
    apt: bool
    confidence: float
    seconds: float

    @property
    def truth(self) -> str:
        """The cause in a word: the first group's names, or "nothing"."""
        return "nothing" if self.cause.null else " or ".join(sorted(self.cause.expected[0]))

    @property
    def said(self) -> str:
        """The answer in a word: the cause if it was named, else the first name given, else the verdict."""
        if self.met:
            return self.truth
        if self.verdict not in SETTLED or not self.named:
            return self.verdict
        return (self.wrong or self.named)[0]


def read_causes(path: Path) -> tuple[list[Cause], dict[str, str]]:
    """The causes of a TOML file, and the word of the file for each name of the catalogue that goes by another.

    Raises:
        InputError: a sample twice, a cause without a group, or a null with one.
    """
    file = tomllib.loads(Path(path).read_text())
    causes = []
    for p in file["protocol"]:
        null, groups = bool(p.get("null")), tuple(frozenset(g) for g in p["expected"])
        if null == bool(groups):
            raise InputError(
                f"{path}, protocol {p['key']!r}: a null expects nothing, a cause at least one group of names"
            )
        causes += [Cause(s["id"], p["key"], null, groups, frozenset(p["beside"])) for s in p["specimens"]]
    if twice := [n for n, k in Counter(c.id for c in causes).items() if k > 1]:
        raise InputError(f"{path}: {', '.join(twice)} stands there more than once; give every sample a name of its own")
    return causes, {other: word for word, others in file.get("names", {}).items() for other in others}


def answered(cause: Cause, result: Mapping, words: Mapping[str, str] | None = None) -> Answer:
    """Hold the content of a `result.json` against the cause.

    Args:
        words: the causes' word for a name of the catalogue that goes by another.
    """
    words = words or {}

    def own(found: object) -> tuple[str, ...]:
        return tuple(dict.fromkeys(words.get(n, n) for n in names_in(found)))

    verdict = str(result.get("verdict"))
    named = own(result.get("effects")) if verdict in SETTLED else ()
    allowed = cause.beside.union(*cause.expected, NO_PROCESS if cause.null else ())
    wrong = tuple(n for n in named if n not in allowed)
    groups = [bool(g & set(named)) for g in cause.expected]
    stated = result.get("confidence")
    right = verdict != "failed" and not wrong and (cause.null or groups[0])
    offered = set(named) | set(own(result.get("alternatives"))) | set(own(result.get("best_attempt")))
    apt = right or (verdict == "ambiguous" and not cause.null and bool(cause.expected[0] & offered))
    return Answer(
        cause=cause,
        verdict=verdict,
        named=named,
        best=named or own(result.get("best_attempt")),
        met=bool(groups) and groups[0],
        whole=bool(groups) and all(groups),
        wrong=wrong,
        right=right,
        apt=apt and not (cause.null and verdict == "ambiguous"),
        confidence=float(stated) if isinstance(stated, int | float) else math.nan,
        seconds=float(result.get("seconds", math.nan)),
    )


def summary(answers: Sequence[Answer]) -> dict:
    """Rates with Wilson's 95 % intervals, confusion matrix, macro-F1, calibration and times."""
    causes, nulls = [a for a in answers if not a.cause.null], [a for a in answers if a.cause.null]
    rates = {
        "cause named and no wrong name": rate(causes, lambda a: a.right),
        "cause named, whatever else": rate(causes, lambda a: a.met),
        "all that the protocol knows named, no wrong name": rate(causes, lambda a: a.whole and a.right),
        "cause in the best attempt, named or not": rate(causes, lambda a: bool(a.cause.expected[0] & set(a.best))),
        "a wrong name": rate(causes, lambda a: bool(a.wrong)),
        "unexplained": rate(causes, lambda a: a.verdict == "unexplained"),
        "nothing said to be missing": rate(causes, lambda a: a.verdict == "nothing-missing"),
        "nulls: a wrong physical name": rate(nulls, lambda a: bool(a.wrong)),
        "nulls: any name": rate(nulls, lambda a: bool(a.named)),
        "nulls: nothing missing": rate(nulls, lambda a: a.verdict == "nothing-missing"),
        "diagnosis failed": rate(list(answers), lambda a: a.verdict == "failed"),
    }
    matrix = confusion(answers)
    return {
        "samples": len(causes),
        "nulls": len(nulls),
        "rates": rates,
        "confusion": matrix,
        "f1": scores(matrix),
        "macro_f1": macro_f1(matrix),
        "macro_f1_of_all_names": names_f1(answers),
        "calibration": calibration(answers),
        "seconds": spread([a.seconds for a in answers if math.isfinite(a.seconds)]),
    }


def confusion(answers: Sequence[Answer]) -> dict[str, dict[str, int]]:
    """Counts by cause and by what was said first."""
    found: dict[str, dict[str, int]] = {}
    for a in answers:
        row = found.setdefault(a.truth, {})
        said = "nothing" if a.cause.null and not a.wrong else a.said
        row[said] = row.get(said, 0) + 1
    return found


def scores(matrix: Mapping[str, Mapping[str, int]]) -> dict[str, float]:
    """F1 = 2 TP / (2 TP + FP + FN) of every cause in the matrix (van Rijsbergen 1979)."""
    out = {}
    for truth in matrix:
        right = matrix[truth].get(truth, 0)
        missed = sum(matrix[truth].values()) - right
        false = sum(row.get(truth, 0) for other, row in matrix.items() if other != truth)
        out[truth] = 2 * right / (2 * right + false + missed)
    return out


def names_f1(answers: Sequence[Answer]) -> float:
    """Macro-F1 where every name that is given counts: a second name that the protocol does not allow is a false
    positive of that name, whatever stands before it. Causes alone have an F1: a wrong name that is no sample's cause
    counts with the cause that it was given in place of or beside."""
    causes = sorted({a.truth for a in answers if not a.cause.null})
    scored = []
    for cause in causes:
        own = [a for a in answers if a.truth == cause]
        words = set(cause.split(" or "))
        right = sum(a.met for a in own)
        strays = sum(bool(set(a.wrong) - {w for c in causes for w in c.split(" or ")}) for a in own)
        false = strays + sum(bool(words & set(a.wrong)) for a in answers if a.truth != cause)
        scored.append(2 * right / (2 * right + false + len(own) - right))
    return float(np.mean(scored)) if scored else math.nan


def macro_f1(matrix: Mapping[str, Mapping[str, int]]) -> float:
    """Mean of the causes' F1, nothing among them, each counting alike however many samples it has."""
    return float(np.mean(list(scores(matrix).values()))) if matrix else math.nan

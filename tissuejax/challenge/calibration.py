"""Stated confidence against how often answers as such were true: in bins, and by the kind of answer."""

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from tissuejax.challenge.rates import STATED, rate


class Stated(Protocol):
    """A graded answer: what was said, with which confidence, and whether it is true as such."""

    @property
    def verdict(self) -> str: ...

    @property
    def confidence(self) -> float: ...

    @property
    def apt(self) -> bool: ...


def calibration(answers: Sequence[Stated]) -> dict:
    """Bins of stated confidence, expected calibration error (Naeini et al. 2015), Brier score, and the same by verdict.

    `by_verdict`: mean confidence, share of true answers with Wilson's interval, and the calibration error over the
    bins of these answers alone. A few answers a bin miss their share by chance: `error_by_chance` is what answers of
    the same confidence would err by on average if each were true with the probability that it states.
    """
    stated = [a for a in answers if math.isfinite(a.confidence)]
    verdicts = sorted({a.verdict for a in stated})
    kinds = {v: [a for a in stated if a.verdict == v] for v in verdicts}
    return _of(stated) | {
        "by_verdict": {
            v: {"stated": float(np.mean([a.confidence for a in some]))} | rate(some, lambda a: a.apt) | _errors(some)
            for v, some in kinds.items()
        }
    }


def _binned(stated: Sequence[Stated]) -> list[tuple[float, float, list[Stated]]]:
    bins = []
    for low, high in zip(STATED, STATED[1:]):
        here = [a for a in stated if low <= a.confidence < high or (high == 1 and a.confidence == 1)]
        if here:
            bins.append((low, high, here))
    return bins


def _of(stated: Sequence[Stated]) -> dict:
    rows = [
        {"from": low, "to": high, "stated": float(np.mean([a.confidence for a in here]))} | rate(here, lambda a: a.apt)
        for low, high, here in _binned(stated)
    ]
    brier = float(np.mean([(a.confidence - a.apt) ** 2 for a in stated])) if stated else None
    return {"bins": rows} | _errors(stated) | {"brier": brier, "of": len(stated)}


def _errors(stated: Sequence[Stated], draws: int = 2000) -> dict:
    if not stated:
        return {"expected_calibration_error": None, "error_by_chance": None}
    groups = [np.array([a.confidence for a in here]) for _, _, here in _binned(stated)]
    seen = [np.mean([a.apt for a in here]) for _, _, here in _binned(stated)]
    error = sum(len(c) * abs(np.mean(c) - s) for c, s in zip(groups, seen, strict=True)) / len(stated)
    rng = np.random.default_rng(0)
    luck = sum(len(c) * np.abs(np.mean(c) - np.mean(rng.random((draws, len(c))) < c, axis=1)) for c in groups)
    return {"expected_calibration_error": float(error), "error_by_chance": float(np.mean(luck) / len(stated))}

"""Grade a challenge of effects beside a rest: named by ratio, names on a rest alone, its size, where, calibration."""

import json
import math
from dataclasses import asdict
from pathlib import Path

import numpy as np

from tissuejax.challenge import files
from tissuejax.challenge.calibration import calibration
from tissuejax.challenge.places import channel_f1, f1
from tissuejax.challenge.rates import rate, spread
from tissuejax.challenge.rest_marks import FACTOR, NO_PROCESS, RestMark, mark_rest
from tissuejax.challenge.verdicts import SETTLED
from tissuejax.errors import InputError

BINS = ((0.0, 0.125), (0.125, 0.25), (0.25, 0.5001))


def marks_in(folder: Path, keys: dict) -> list[RestMark]:
    """Every answered case of a folder, marked.

    Raises:
        InputError: no results there.
    """
    found = []
    for name, key in keys.items():
        path = folder / "results" / name / "result.json"
        if not path.exists():
            continue
        cost, kept = path.with_name("cost.json"), math.nan
        seconds = json.loads(cost.read_text())["seconds"] if cost.exists() else math.nan
        predicted = path.with_name("kept.json")
        if predicted.exists():
            said = np.array(json.loads(predicted.read_text())["nominal_stress"], float)
            true = np.load(folder / "sealed" / "kept" / f"{name}.npy")
            kept = float(np.sqrt(np.mean((said - true) ** 2))) if said.shape == true.shape else math.nan
        weighed = path.with_name("evidence.json")
        evidence = json.loads(weighed.read_text()) if weighed.exists() else None
        found.append(mark_rest(name, key, json.loads(path.read_text()), seconds, kept, evidence))
    if not found:
        raise InputError(f"{folder} holds no results; run it first with `tissuejax challenge run {folder}`")
    return found


def summary(marks: list[RestMark]) -> dict:
    """Rates by category and ratio, size of the rest, F1 of where, calibration, all with Wilson intervals."""
    effects, rests = [m for m in marks if m.truth], [m for m in marks if not m.truth]
    small, large = [m for m in effects if m.ratio <= 0.25], [m for m in effects if m.ratio > 0.25]
    rates = {
        "rest at most a quarter of the effect: named, no wrong name": rate(small, lambda m: m.right),
        "rest a quarter to a half of the effect: named, no wrong name": rate(large, lambda m: m.right),
        "one effect: named, no wrong name": rate([m for m in effects if m.category == "one"], lambda m: m.right),
        "two effects: both named, no wrong name": rate([m for m in effects if m.category == "two"], lambda m: m.right),
        "two effects, not alike": rate(
            [m for m in effects if m.category == "two" and not m.alike], lambda m: m.right
        ),
        "effects: all in the best attempt, given or not": rate(effects, lambda m: set(m.truth) <= set(m.best)),
        "effects: a wrong name": rate(effects, lambda m: bool(m.wrong)),
        "effects: that very set was tried": rate([m for m in effects if m.tried is not None], lambda m: m.tried),
        "rest alone: a wrong physical name": rate(rests, lambda m: bool(m.wrong)),
        "rest alone: form of the energy or scatter named": rate(rests, lambda m: bool(set(m.named) & set(NO_PROCESS))),
        "rest alone: nothing named": rate(rests, lambda m: m.verdict not in SETTLED or not m.named),
        f"size of the rest within a factor {FACTOR:g}": rate(
            [m for m in marks if math.isfinite(m.rest_over_true)],
            lambda m: 1 / FACTOR <= m.rest_over_true <= FACTOR,
        ),
        f"size of the rest beside exactly the true effects within a factor {FACTOR:g}": rate(
            [m for m in marks if math.isfinite(m.beside_true)], lambda m: 1 / FACTOR <= m.beside_true <= FACTOR
        ),
        "diagnosis failed": rate(marks, lambda m: m.verdict == "failed"),
    }  # fmt: skip
    by_ratio = [
        {"category": c, "from": low, "to": min(high, 0.5)} | rate(some, lambda m: m.right)
        for c in ("one", "two", "rest")
        for low, high in BINS
        if (some := [m for m in marks if m.category == c and low <= m.ratio < high])
    ]
    by_law = {
        law: rate([m for m in marks if law in m.laws], lambda m: bool(m.wrong))
        for law in sorted({x for m in marks for x in m.laws})
    }
    return {
        "rates": rates,
        "by_ratio": by_ratio,
        "a wrong name, by law of the rest": by_law,
        "where_f1": f1(m.where for m in marks),
        "channel_f1": channel_f1([m.channels for m in marks]),
        "rest_over_true": spread([m.rest_over_true for m in marks if math.isfinite(m.rest_over_true)]),
        "rest_beside_true_effects_over_true": spread([m.beside_true for m in marks if math.isfinite(m.beside_true)]),
        "kept_error_over_rest": spread([m.kept_ratio for m in marks if math.isfinite(m.kept_ratio)]),
        "calibration": calibration(marks),
        "seconds": spread([m.seconds for m in marks if math.isfinite(m.seconds)]),
    }


def rows(marks: list[RestMark]) -> list[dict]:
    """Marks as rows of a table."""
    out = []
    for m in marks:
        row = asdict(m)
        for name in ("truth", "laws", "named", "best", "wrong"):
            row[name] = " + ".join(row[name])
        row["where"] = "/".join(map(str, m.where))
        row["channels"] = "/".join(map(str, m.channels or ()))
        out.append({k: (f"{v:.4g}" if isinstance(v, float) else v) for k, v in row.items()})
    return out


def grade_rest(folder: Path, manifest: dict) -> tuple[dict, list[dict]]:
    """(content of graded.json, rows of graded.csv) of a challenge of the kind "rest"."""
    keys = files.read_keys(folder, manifest)
    marks = marks_in(folder, keys)
    return summary(marks) | {"cases": len(keys), "answered": len(marks)}, rows(marks)

"""The diagnosis beside simpler ways of answering, on the same cases and the same fits: what each names, and its error.

Every rival is given its best: what it names is refitted in full, and its held-out error is that of the refit.
"""

import json
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from tissuejax.challenge import files, rivals
from tissuejax.challenge.grade import VISIBLE, table
from tissuejax.challenge.rates import rate, spread
from tissuejax.challenge.verdicts import mark
from tissuejax.errors import InputError
from tissuejax.progress import Progress, Silent
from tissuejax.storage import write_json, write_text

WAYS: Mapping[str, Callable[[dict], tuple[tuple[str, ...], float]]] = {
    "score ranking alone": rivals.by_score,
    "refit alone": rivals.by_refit,
    "hold-out alone": rivals.by_hold_out,
    "information criterion over all sets refitted": rivals.by_all_subsets,
}


def compare(
    folder: str | os.PathLike,
    out: str | os.PathLike | None = None,
    every: int = 8,
    progress: Progress | None = None,
) -> dict:
    """Rates of every rival beside those of the diagnosis; writes rivals.json and rivals.csv.

    Args:
        folder: a challenge, run at least in part. Of probings the rates of names alone are compared: the Gaussian
            process is one of stretch and rate, and the table of candidates pools the channels.
        out: where to write; the challenge's own folder by default.
        every: a Gaussian process is fitted to each case whose place in the list this divides (seconds a case).

    Raises:
        InputError: no results there, or keys that don't bear the sealed hash.
    """
    folder = Path(folder)
    keys = files.read_keys(folder, manifest := files.read_manifest(folder))
    energies = {e["name"]: e["energy"] for e in manifest["cases"]}
    answers, costs = {}, []
    for name in keys:
        path = folder / "results" / name / "result.json"
        if path.exists() and (found := json.loads(path.read_text())).get("verdict") != "failed":
            answers[name] = found
            costs.append(json.loads(path.with_name("cost.json").read_text())["seconds"])
    if not answers:
        raise InputError(f"{folder} holds no results; run it first with `tissuejax challenge run {folder}`")
    rows = {"diagnosis": _rates(keys, answers) | {"seconds": spread(costs)}}
    for way, ask in WAYS.items():
        said = {}
        for name, result in answers.items():
            effects, held = ask(result)
            said[name] = _as_result(keys[name], effects, held)
        rows[way] = _rates(keys, said)
    picked = [] if manifest["kind"] == "probing" else list(answers)[::every]
    if picked:
        with (progress or Silent()).stage("Gaussian processes", total=len(picked)) as stage:
            rows["Gaussian-process discrepancy"] = _processes(folder, keys, energies, picked, stage)
    found = {"answered": len(answers), "processes": picked, "rivals": rows}
    out = Path(out) if out else folder
    write_json(out / "rivals.json", found)
    write_text(out / "rivals.csv", table([_flat(way, row) for way, row in rows.items()]))
    return found


def _as_result(key: dict, effects: tuple[str, ...], held: float) -> dict:
    """A rival's answer in the form that `mark` reads: it has no other verdicts than these two."""
    probing = isinstance(key["truth_error_over_noise"][key["held_out"]], dict)
    return {
        "verdict": "found" if effects else "unexplained" if key["category"] == "unknown" else "nothing-missing",
        "effects": [{"name": e} for e in effects],
        "after": {} if probing else {key["held_out"]: {"nominal_stress": {"chi2_per_sample": held}}},
    }


def _rates(keys: dict, answers: dict[str, dict]) -> dict:
    marks = [mark(name, keys[name], result) for name, result in answers.items()]
    one = [m for m in marks if m.category == "one" and m.size >= VISIBLE]
    two = [m for m in marks if m.category == "two" and m.size >= VISIBLE]
    known = [m.held_out_ratio for m in marks if m.category != "unknown" and math.isfinite(m.held_out_ratio)]
    return {
        "single above 3 noise: right and no other": rate(one, lambda m: m.exact),
        "pair, both above 3 noise: both named": rate(two, lambda m: m.all_named),
        "nulls: false alarm": rate([m for m in marks if m.category == "none"], lambda m: not m.right),
        "unknown: names nothing": rate([m for m in marks if m.category == "unknown"], lambda m: m.right),
        "held_out_error_over_truth": spread(known),
    }


def _processes(folder: Path, keys: dict, energies: dict[str, str], names: list[str], stage) -> dict:
    ratios, before, seconds = [], [], []
    for name in names:
        found = rivals.discrepancy(folder / "cases" / f"{name}.h5", energies[name])
        seconds.append(found.seconds)
        truth = keys[name]["truth_error_over_noise"][keys[name]["held_out"]]
        if keys[name]["category"] != "unknown":
            ratios.append(math.sqrt(found.held_out) / truth)
            before.append(math.sqrt(found.base_held_out) / truth)
        stage.advance(note=name)
    return {
        "held_out_error_over_truth": spread(ratios),
        "base_held_out_error_over_truth": spread(before),
        "seconds": spread(seconds),
    }


def _flat(way: str, row: dict) -> dict:
    flat: dict[str, object] = {"way": way}
    for name, value in row.items():
        if "share" in value:
            flat |= {name: _number(value["share"]), f"{name} (of)": value["of"]}
        else:
            flat |= {f"{name} {k}": _number(value.get(k)) for k in ("median", "q90", "at_most_1.1") if k in value}
    return flat


def _number(value: float | None) -> str:
    return "" if value is None or not np.isfinite(value) else f"{value:.3g}"

"""Open the sealed keys, grade all answers, and write tables: cases, confusion, rates, rates by size, calibration."""

import csv
import io
import json
import math
import os
from dataclasses import asdict
from pathlib import Path

from tissuejax.challenge import files
from tissuejax.challenge.calibration import calibration
from tissuejax.challenge.places import channel_f1
from tissuejax.challenge.rates import rate, spread
from tissuejax.challenge.rest_grade import grade_rest
from tissuejax.challenge.verdicts import SETTLED, Mark, mark
from tissuejax.errors import InputError
from tissuejax.storage import write_json, write_text

EDGES = (0.0, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, math.inf)
VISIBLE = 3.0  # times the noise: from here on the aims apply


def grade(folder: str | os.PathLike, out: str | os.PathLike | None = None) -> dict:
    """Grade the results of a challenge and write graded.csv, confusion.csv, by_size.csv and graded.json.

    Args:
        folder: a challenge, run at least in part.
        out: where to write; the challenge's own folder by default.

    Returns:
        The content of graded.json: rates with 95 % intervals, confusion, rates by size, calibration.

    Raises:
        InputError: keys that don't bear the sealed hash, or no results at all.
    """
    folder = Path(folder)
    manifest = files.read_manifest(folder)
    out = Path(out) if out else folder
    made = {k: manifest.get(k) for k in ("kind", "seed", "commit", "keys_sha256")}
    if manifest["kind"] == "rest" or manifest.get("rest"):
        found, lines = grade_rest(folder, manifest)
        write_text(out / "graded.csv", table(lines))
        write_json(out / "graded.json", found | made)
        return found | made
    keys = files.read_keys(folder, manifest)
    marks = []
    for name, key in keys.items():
        path = folder / "results" / name / "result.json"
        if path.exists():
            cost = path.with_name("cost.json")
            seconds = json.loads(cost.read_text())["seconds"] if cost.exists() else math.nan
            marks.append(mark(name, key, json.loads(path.read_text()), seconds))
    if not marks:
        raise InputError(f"{folder} holds no results; run it first with `tissuejax challenge run {folder}`")
    found = summary(marks) | made
    found["cases"], found["answered"] = len(keys), len(marks)
    write_text(out / "graded.csv", table([_row(m) for m in marks]))
    write_text(out / "confusion.csv", table(confusion_rows(found["confusion"])))
    write_text(out / "by_size.csv", table(found["by_size"]))
    write_json(out / "graded.json", found)
    return found


def summary(marks: list[Mark]) -> dict:
    """Rates, confusion, dependence on size and calibration of graded cases."""
    one = [m for m in marks if m.category == "one"]
    two = [m for m in marks if m.category == "two"]
    seen = [m for m in one if m.size >= VISIBLE]
    pairs = [m for m in two if m.size >= VISIBLE]
    three = [m for m in marks if m.category == "three"]
    nulls = [m for m in marks if m.category == "none"]
    strange = [m for m in marks if m.category == "unknown"]
    rates = {
        "single above 3 noise: right first": rate(seen, lambda m: m.first),
        "single above 3 noise: right and no other": rate(seen, lambda m: m.exact),
        "single above 3 noise: right, or among the alternatives": rate(seen, lambda m: m.open_right),
        "same, laws like the catalogue's": rate([m for m in seen if m.plain], lambda m: m.exact),
        "same, laws meant to be other": rate([m for m in seen if not m.plain], lambda m: m.exact),
        "same, of these exact members of the catalogue's forms": rate(
            [m for m in seen if not m.plain and m.member], lambda m: m.exact
        ),
        "same, of these truly other laws": rate([m for m in seen if m.member is False], lambda m: m.exact),
        "all singles: right and no other": rate(one, lambda m: m.exact),
        "pair, both above 3 noise: both named": rate(pairs, lambda m: m.all_named),
        "pair, both above 3 noise: both and no other": rate(pairs, lambda m: m.exact),
        "three: all named": rate(three, lambda m: m.all_named),
        **untold("pair, both above 3 noise", pairs),
        **untold("three", three),
        "nulls: false alarm": rate(nulls, lambda m: not m.right),
        "nulls, white noise: false alarm": rate([m for m in nulls if not m.correlated], lambda m: not m.right),
        "nulls, correlated noise: false alarm": rate([m for m in nulls if m.correlated], lambda m: not m.right),
        "unknown: unexplained": rate(strange, lambda m: m.right),
        "unknown above 3 noise: unexplained": rate([m for m in strange if m.size >= VISIBLE], lambda m: m.right),
        "diagnosis failed": rate(marks, lambda m: m.verdict == "failed"),
    }
    known = [m.held_out_ratio for m in marks if m.category != "unknown" and math.isfinite(m.held_out_ratio)]
    right = [m.held_out_ratio for m in marks if m.exact and math.isfinite(m.held_out_ratio)]
    return {
        "rates": rates,
        "held_out_error_over_truth": {"known physics": spread(known), "exactly right": spread(right)},
        "channel_f1": channel_f1([m.channels for m in marks]),
        "seconds": spread([m.seconds for m in marks if math.isfinite(m.seconds)]),
        "confusion": confusion(marks),
        "by_size": by_size(marks),
        "calibration": calibration(marks),
    }


def untold(what: str, marks: list[Mark]) -> dict[str, dict]:
    """Why effects were not all named: the very set was never tried, or was tried and not chosen."""
    known = [m for m in marks if m.tried is not None]
    return {
        f"{what}: the truth was never tried": rate(known, lambda m: not m.tried),
        f"{what}: the truth was tried and not chosen": rate(known, lambda m: m.tried and not m.exact),
    }


def confusion(marks: list[Mark]) -> dict[str, dict[str, int]]:
    """Counts by truth (one effect, "nothing", or "outside the catalogue") and what was named first, or the verdict."""
    found: dict[str, dict[str, int]] = {}
    for m in marks:
        if m.category in ("two", "three"):
            continue
        truth = {"none": "nothing", "unknown": "outside the catalogue"}.get(m.category) or m.truth[0]
        said = m.named[0] if m.verdict in SETTLED and m.named else m.verdict
        row = found.setdefault(truth, {})
        row[said] = row.get(said, 0) + 1
    return found


def confusion_rows(found: dict[str, dict[str, int]]) -> list[dict]:
    """The confusion matrix as rows of a table."""
    said = sorted({s for row in found.values() for s in row})
    return [{"truth": truth} | {s: row.get(s, 0) for s in said} for truth, row in sorted(found.items())]


def by_size(marks: list[Mark]) -> list[dict]:
    """Rates of singles, pairs and unknown ones against the size of their weakest effect."""
    rows = []
    for low, high in zip(EDGES, EDGES[1:]):
        here = [m for m in marks if low <= m.size < high]
        for category, name, test in (
            ("one", "right and no other", lambda m: m.exact),
            ("one", "right first", lambda m: m.first),
            ("two", "both named", lambda m: m.all_named),
            ("unknown", "unexplained", lambda m: m.right),
        ):
            some = [m for m in here if m.category == category]
            if some:
                end = None if math.isinf(high) else high
                rows.append({"category": category, "measure": name, "from": low, "to": end} | rate(some, test))
    return rows


def table(rows: list[dict]) -> str:
    """Rows as CSV, with the keys of all of them as columns."""
    if not rows:
        return ""
    names = list(dict.fromkeys(k for row in rows for k in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _row(m: Mark) -> dict:
    row = asdict(m)
    for name in ("truth", "named", "alternatives"):
        row[name] = " + ".join(row[name])
    row["channels"] = "/".join(map(str, m.channels or ()))
    return {k: (f"{v:.4g}" if isinstance(v, float) else v) for k, v in row.items()}

"""All sealed sets together, none left out: rates, stated confidence, and what the laws were, from the graded tables.

`earlier/` holds the graded tables of sets that later ones replaced in the folders beside it.

tissuejax study fits/challenge
"""

import csv
import json
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from tissuejax.challenge.calibration import calibration
from tissuejax.challenge.rates import rate
from tissuejax.storage import write_between, write_json

VISIBLE = 3.0
BEGIN, END = "<!-- pooled: written by the study -->", "<!-- end of pooled -->"
CURRENT = {
    "material": ("material", "material-second", "material-third", "material-fourth", "material-fifth",
                 "material-sixth", "material-seventh", "material-eighth", "material-ninth",
                 "material-tenth", "material-eleventh", "material-twelfth", "material-thirteenth",
                 "material-fourteenth", "material-fifteenth", "material-sixteenth", "material-seventeenth",
                 "material-eighteenth", "material-nineteenth", "material-twentieth",
                 "material-twenty-first", "material-twenty-second", "material-twenty-third",
                 "material-twenty-fourth", "material-twenty-fifth"),
    "probing": ("probing", "probing-strong", "probing-strong-second", "probing-pairs", "probing-second",
                "probing-strong-third", "probing-third", "probing-fourth", "probing-fifth", "probing-sixth",
                "probing-seventh", "probing-eighth"),
}  # fmt: skip


NEWEST = {
    "material tests": (
        "material-thirteenth",
        "material-fourteenth",
        "material-fifteenth",
        "material-sixteenth",
        "material-seventeenth",
        "material-eighteenth",
        "material-nineteenth",
        "material-twentieth",
        "material-twenty-first",
        "material-twenty-second",
        "material-twenty-third",
        "material-twenty-fourth",
        "material-twenty-fifth",
    ),
    "beside a rest": (
        "rest-seventh",
        "rest-eighth",
        "rest-ninth",
        "rest-tenth",
        "rest-eleventh",
        "rest-twelfth",
        "rest-thirteenth",
        "rest-fourteenth",
    ),
    "probings": ("probing-seventh", "probing-eighth"),
    "probings beside a rest": ("probing-rest",),
}  # the newest of each kind, of the judgements of their day


def sets(folder: Path, kind: str) -> dict[str, list[dict]]:
    """Rows of every sealed set of a kind, by a name that holds its seed."""
    found = {p.stem.replace("-", " ", 1): p for p in sorted((folder / "earlier").glob(f"{kind}-*.csv"))}
    for name in CURRENT[kind]:
        seed = json.loads((folder / name / "graded.json").read_text())["seed"]
        found[f"{kind} {seed}"] = folder / name / "graded.csv"
    out = {}
    for name, path in found.items():
        with path.open() as file:
            out[name] = list(csv.DictReader(file))
    return out


def true(row: dict, column: str) -> bool:
    """Whether a cell says so."""
    return row.get(column) == "True"


def counted(rows: list[dict]) -> dict:
    """The rates of the tables, over any rows."""

    def seen(category: str) -> list[dict]:
        return [r for r in rows if r["category"] == category and float(r["size"]) >= VISIBLE]

    def of(category: str) -> list[dict]:
        return [r for r in rows if r["category"] == category]

    return {
        "visible singles: right and no other": rate(seen("one"), lambda r: true(r, "exact")),
        "visible pairs: both named": rate(seen("two"), lambda r: true(r, "all_named")),
        "triples: all named": rate(of("three"), lambda r: true(r, "all_named")),
        "nulls: false alarm": rate(of("none"), lambda r: not true(r, "right")),
        "outside the catalogue: unexplained": rate(of("unknown"), lambda r: true(r, "right")),
    }


def apt(row: dict) -> bool:
    """Whether the answer as such is true (`challenge.verdicts.Mark.apt`), for rows from before that was graded too."""
    if "apt" in row:
        return true(row, "apt")
    truth, named = (set(filter(None, row[c].split(" + "))) for c in ("truth", "named"))
    if row["verdict"] == "found-in-part":
        in_part = bool(named) and (named < truth or (true(row, "exact") and not true(row, "plain")))
        return in_part and row["category"] != "unknown"
    return true(row, "open_right" if row["verdict"] == "ambiguous" else "right")


@dataclass(frozen=True)
class Said:
    """What was said of a case, and whether it is true."""

    verdict: str
    confidence: float
    apt: bool


def said(rows: list[dict]) -> list[Said]:
    """Those of graded rows."""
    return [Said(r["verdict"], float(r["confidence"] or "nan"), apt(r)) for r in rows]


def confidence(rows: list[dict]) -> dict:
    """Stated against true."""
    return calibration(said(rows))


def by_answer(folder: Path) -> tuple[dict, list[str]]:
    """Stated against true by the kind of answer, of the sets that the judgement as it is has been asked."""
    found, lines = {}, []
    for kind, names in NEWEST.items():
        rows = []
        for name in names:
            with (folder / name / "graded.csv").open() as file:
                rows += list(csv.DictReader(file))
        found[kind] = confidence(rows)
        lines.append(
            f"| {kind}: all | {found[kind]['of']} | | | {found[kind]['expected_calibration_error']:.2f} "
            f"({found[kind]['error_by_chance']:.2f}) |"
        )
        for verdict, r in found[kind]["by_verdict"].items():
            lines.append(
                f"| {kind}: {verdict} | {r['of']} | {r['stated']:.2f} | {r['share']:.2f} ({r['low']:.2f} to "
                f"{r['high']:.2f}) | {r['expected_calibration_error']:.2f} ({r['error_by_chance']:.2f}) |"
            )
    return found, lines


def seconds(rows: list[dict]) -> str:
    """Median and longest time of a case, s, where known."""
    known = [float(r["seconds"]) for r in rows if r.get("seconds") not in (None, "", "nan")]
    return f"{median(known):.0f}, {max(known):.0f}" if known else "-"


def share(r: dict) -> str:
    """42 of 44 (95 %)."""
    return f"{round(r['share'] * r['of'])} of {r['of']} ({r['share']:.0%})" if r["of"] else "-"


def main(folder: Path) -> str:
    """Count, write pooled.json and the tables in README.md."""
    found, lines = {}, []
    for kind in CURRENT:
        each = sets(folder, kind)
        rows = [r for some in each.values() for r in some]
        by_set = {name: counted(some) for name, some in each.items()}
        found[kind] = {"sets": by_set, "all": counted(rows), "confidence": confidence(rows), "cases": len(rows)}
        names = list(found[kind]["all"])
        head = ["sealed set (seed)", "cases", *names, "s a case: median, longest"]
        lines += ["", "| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
        for name, r in by_set.items():
            lines.append(
                f"| {name} | {len(each[name])} | "
                + " | ".join([*(share(r[n]) for n in names), seconds(each[name])])
                + " |"
            )
        total = found[kind]["all"]
        lines.append(
            f"| **all {len(each)}** | {len(rows)} | "
            + " | ".join([*(f"**{share(total[n])}**" for n in names), seconds(rows)])
            + " |"
        )
        told = found[kind]["confidence"]
        lines += ["", f"Stated confidence of all {told['of']} answers that state one (expected calibration error "
                  f"{told['expected_calibration_error']:.2f}):", "", "| stated | mean | true | 95 % interval |",
                  "|---|---|---|---|"]  # fmt: skip
        for b in told["bins"]:
            lines.append(
                f"| {b['from']:g} to {b['to']:g} | {b['stated']:.2f} | {share(b)} | {b['low']:.0%} to {b['high']:.0%} |"
            )
    told, rows = by_answer(folder)
    found["by_answer"] = told
    lines += [
        "",
        "By the kind of answer, newest sets alone; in brackets what as many answers of the same confidence would err "
        "by if each were true as often as it says:",
        "",
        "| answers | of | stated | true (95 % interval) | calibration error (by chance) |",
        "|---|---|---|---|---|",
        *rows,
    ]
    write_json(folder / "pooled.json", found)
    write_between(folder / "README.md", BEGIN, END, "\n".join(lines))
    return "; ".join(
        f"{k}: singles {share(f['all']['visible singles: right and no other'])}"
        for k, f in found.items()
        if k in CURRENT
    )


if __name__ == "__main__":
    print(main(Path(__file__).parent))

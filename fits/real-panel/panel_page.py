"""The panel's tables, written between two marks of README.md, and its confusion matrix as a picture."""

import csv
import io
from pathlib import Path

from tissuejax.challenge.panel import Answer
from tissuejax.report.challenge_table import confusion_figure
from tissuejax.storage import write_between, write_figure, write_text

BEGIN, END = "<!-- tables: written by the study -->", "<!-- end of tables -->"


def write(folder: Path, answers: list[Answer], found: dict) -> None:
    """`answers.csv`, `confusion.png`, and the tables in README.md."""
    rows = io.StringIO()
    out = csv.writer(rows, lineterminator="\n")
    out.writerow(
        [
            "sample",
            "protocol",
            "null",
            "cause",
            "verdict",
            "named",
            "wrong",
            "right",
            "stated",
            "best attempt",
            "seconds",
        ]
    )
    for a in answers:
        best = " + ".join(a.best)
        said = [a.verdict, " + ".join(a.named), " + ".join(a.wrong), a.right, f"{a.confidence:.3g}", best]
        out.writerow([a.cause.id, a.cause.key, a.cause.null, a.truth, *said, f"{a.seconds:.0f}"])
    write_text(folder / "answers.csv", rows.getvalue())
    write_figure(folder / "confusion.png", confusion_figure(found["confusion"]), dpi=100)
    write_between(folder / "README.md", BEGIN, END, tables(answers, found))


def tables(answers: list[Answer], found: dict) -> str:
    """Rates, protocols, calibration."""
    lines = [
        f"{found['answered']} of {found['listed']} samples diagnosed ({found['samples']} with a cause, "
        f"{found['nulls']} nulls).",
        "",
    ]
    lines += ["| | share | 95 % interval | of |", "|---|---|---|---|"]
    for name, r in found["rates"].items():
        if r["of"]:
            lines.append(f"| {name} | {r['share']:.0%} | {r['low']:.0%} to {r['high']:.0%} | {r['of']} |")
    error = found["calibration"]["expected_calibration_error"]
    chance = found["calibration"]["error_by_chance"]
    lines += ["", f"Macro-F1 over causes, nothing among them: **{found['macro_f1']:.2f}**, and "
              f"**{found['macro_f1_of_all_names']:.2f}** where every second name that the protocol does not allow "
              f"counts as a false one. Expected calibration error {error:.2f}, of which so few answers would have "
              f"{chance:.2f} by chance." if error is not None else ""]  # fmt: skip
    lines += ["", "| answer | of | stated | right | calibration error (by chance) |", "|---|---|---|---|---|"]
    for verdict, r in found["calibration"]["by_verdict"].items():
        lines.append(
            f"| {verdict} | {r['of']} | {r['stated']:.2f} | {r['share']:.2f} ({r['low']:.2f} to {r['high']:.2f}) | "
            f"{r['expected_calibration_error']:.2f} ({r['error_by_chance']:.2f}) |"
        )
    lines.append("")
    s = found["seconds"]
    if s.get("of"):
        lines += [
            f"Median {s['median']:.0f} s a sample, nine of ten within {s['q90']:.0f} s, "
            f"the longest {s['largest']:.0f} s."
        ]
    lines += ["", "| protocol | cause | samples | right | verdicts | names given |", "|---|---|---|---|---|---|"]
    groups: dict[tuple, list[Answer]] = {}
    for a in answers:
        groups.setdefault((a.cause.key, a.truth), []).append(a)
    for (key, truth), some in groups.items():
        verdicts = counted([a.verdict for a in some])
        names = counted([" + ".join(a.named) or "-" for a in some])
        lines.append(f"| {key} | {truth} | {len(some)} | {sum(a.right for a in some)} | {verdicts} | {names} |")
    lines += ["", "| stated | mean stated | right | of |", "|---|---|---|---|"]
    for b in found["calibration"]["bins"]:
        lines.append(
            f"| {b['from']:g} to {b['to']:g} | {b['stated']:.2f} "
            f"| {b['share']:.0%} ({b['low']:.0%} to {b['high']:.0%}) | {b['of']} |"
        )
    return "\n".join(lines)


def counted(words: list[str]) -> str:
    """How often each occurs, most frequent first."""
    return ", ".join(f"{w} {words.count(w)}" for w in sorted(set(words), key=lambda w: (-words.count(w), w)))

"""Pictures of a graded challenge: confusion, how often it is right by size of the effect and by stated confidence."""

import os
from pathlib import Path

import numpy as np
from jaxtyping import Int
from matplotlib.figure import Figure

from tissuejax.report.plot import INK, PAPER, SERIES, tidy
from tissuejax.storage import write_figure

VERDICTS = ("nothing-missing", "unexplained", "failed")
TRUTHS = ("nothing", "outside the catalogue")


def figures(graded: dict, out: str | os.PathLike) -> dict[str, Path]:
    """Draw the pictures of the content of graded.json into a folder; returns their paths.

    A challenge of pairs alone has no single effect that could be taken for another: no "confusion".
    """
    out = Path(out)
    drawn = {}
    if "by_ratio" in graded:
        drawn["by_ratio"] = write_figure(out / "by_ratio.png", ratio_figure(graded["by_ratio"]), dpi=100)
        bins = graded["calibration"]["bins"]
        return drawn | {"calibration": write_figure(out / "calibration.png", calibration_figure(bins), dpi=100)}
    if graded["confusion"]:
        drawn["confusion"] = write_figure(out / "confusion.png", confusion_figure(graded["confusion"]), dpi=100)
    return drawn | {
        "by_size": write_figure(out / "by_size.png", size_figure(graded["by_size"]), dpi=100),
        "calibration": write_figure(
            out / "calibration.png", calibration_figure(graded["calibration"]["bins"]), dpi=100
        ),
    }


def matrix(confusion: dict[str, dict[str, int]]) -> tuple[list[str], list[str], Int[np.ndarray, "t s"]]:
    """(truths, answers, counts): effects first and in the same order on both axes, so that right is the diagonal."""
    effects = sorted(set(confusion) - set(TRUTHS))
    truths = effects + [t for t in TRUTHS if t in confusion]
    said = {s for row in confusion.values() for s in row}
    answers = effects + sorted(said - set(effects) - set(VERDICTS)) + [v for v in VERDICTS if v in said]
    return truths, answers, np.array([[confusion[t].get(a, 0) for a in answers] for t in truths])


def confusion_figure(confusion: dict[str, dict[str, int]]) -> Figure:
    """Truth down, first named effect or verdict across; shade is the share of the row."""
    truths, answers, counts = matrix(confusion)
    share = counts / np.maximum(counts.sum(1, keepdims=True), 1)
    figure = Figure(
        figsize=(1.8 + 0.45 * len(answers), 1.6 + 0.36 * len(truths)), layout="constrained", facecolor=PAPER
    )
    ax = figure.subplots()
    ax.imshow(share, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    ax.set_xticks(range(len(answers)), answers, rotation=50, ha="right", fontsize=8, color=INK)
    ax.set_yticks(range(len(truths)), truths, fontsize=8, color=INK)
    for i, j in zip(*np.nonzero(counts)):
        ax.text(j, i, counts[i, j], ha="center", va="center", fontsize=8, color="white" if share[i, j] > 0.6 else INK)
    ax.set_xlabel("named first, or the verdict")
    ax.set_ylabel("truth (one effect)")
    ax.spines[:].set_visible(False)
    return figure


def size_figure(by_size: list[dict]) -> Figure:
    """Rates with 95 % intervals against the size of the weakest effect."""
    figure = Figure(figsize=(7, 3.6), layout="constrained", facecolor=PAPER)
    ax = figure.subplots()
    tidy(ax)
    curves = list(dict.fromkeys((r["category"], r["measure"]) for r in by_size))
    for k, (category, measure) in enumerate(curves):
        rows = [r for r in by_size if (r["category"], r["measure"]) == (category, measure)]
        x = [np.sqrt(max(r["from"], 0.5) * (r["to"] or 2 * r["from"])) * 1.03**k for r in rows]
        y = np.array([r["share"] for r in rows])
        reach = [y - np.array([r["low"] for r in rows]), np.array([r["high"] for r in rows]) - y]
        label = f"{category}: {measure}"
        ax.errorbar(
            x, y, np.maximum(reach, 0), marker="o", ms=4, lw=1.2, elinewidth=0.8, color=SERIES[k % 8], label=label
        )
    ax.axvline(3, color=INK, lw=0.8, ls=":")
    ax.set_xscale("log")
    ax.set_xticks([0.7, 1, 2, 3, 5, 10, 20], ["0.7", "1", "2", "3", "5", "10", "20"])
    ax.set_ylim(-0.03, 1.03)
    ax.set_xlabel("rms of the effect beyond a refitted base, over the noise")
    ax.set_ylabel("share of cases")
    if ax.get_legend_handles_labels()[0]:  # a challenge may hold no case of any of these
        ax.legend(fontsize=8, frameon=False)
    return figure


def ratio_figure(by_ratio: list[dict]) -> Figure:
    """Rates with 95 % intervals against the rest's share of the effect, a curve for each category."""
    words = {"one": "one effect named", "two": "both of two named", "rest": "rest alone: no physical name"}
    figure = Figure(figsize=(6, 3.4), layout="constrained", facecolor=PAPER)
    ax = figure.subplots()
    tidy(ax)
    for k, category in enumerate(dict.fromkeys(r["category"] for r in by_ratio)):
        rows = [r for r in by_ratio if r["category"] == category]
        x = np.array([(r["from"] + r["to"]) / 2 + 0.006 * (k - 1) for r in rows])
        y, low, high = (np.array([r[name] for r in rows]) for name in ("share", "low", "high"))
        label = f"{words.get(category, category)} ({sum(r['of'] for r in rows)} cases)"
        reach = np.maximum([y - low, high - y], 0)
        ax.errorbar(x, y, reach, marker="o", ms=5, lw=1.2, elinewidth=0.8, color=SERIES[k % 8], label=label)
    ax.set_xlim(0, 0.5)
    ax.set_ylim(-0.03, 1.03)
    ax.set_xlabel("rest over the weakest effect (middle of the bin)")
    ax.set_ylabel("share of cases, no wrong name")
    ax.legend(fontsize=8, frameon=False, loc="lower left")
    return figure


def calibration_figure(bins: list[dict]) -> Figure:
    """How often answers were right against the confidence they stated, with 95 % intervals and the number of cases."""
    figure = Figure(figsize=(4.2, 3.8), layout="constrained", facecolor=PAPER)
    ax = figure.subplots()
    tidy(ax)
    ax.plot([0, 1], [0, 1], color=INK, lw=0.8, ls=":")
    x, y = (np.array([b[k] for b in bins]) for k in ("stated", "share"))
    reach = [y - np.array([b["low"] for b in bins]), np.array([b["high"] for b in bins]) - y]
    ax.errorbar(x, y, np.maximum(reach, 0), marker="o", ms=5, lw=0, elinewidth=1, color=SERIES[0])
    for b in bins:
        ax.annotate(
            f"{b['of']}", (b["stated"], b["share"]), (4, -11), textcoords="offset points", fontsize=8, color=INK
        )
    ax.set_xlim(0, 1.03)
    ax.set_ylim(0, 1.03)
    ax.set_xlabel("stated confidence (mean of the bin)")
    ax.set_ylabel("share of answers that were right")
    return figure

"""Every effect tried: what one linear step promised at the base fit, and what weighing or refitting made of it."""

from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from tissuejax.diagnosis.result import Diagnosis
from tissuejax.report.plot import FAINT, INK, MODEL, Plot, grid

MOST_CANDIDATES = 14


class DiagnosisCandidates(Plot):
    """The best form of every effect, alone beside the base, by its evidence."""

    name: ClassVar[str] = "candidates"
    subject: ClassVar[type] = Diagnosis
    order: ClassVar[int] = 40

    def prepare(self, subject: Diagnosis) -> list[dict] | None:
        """One row an effect, the best first."""
        rows: dict[str, dict] = {}
        for c in subject.candidates():
            if c["refit_chi2_per_sample"] is None and (c["score_share"] or 0.0) < 1e-3:
                continue
            row = rows.setdefault(c["name"], {"name": c["name"], "score": 0.0, "rank": np.inf, "chosen": False})
            row["score"] = max(row["score"], c["score_share"] or 0.0)
            row["chosen"] |= c["chosen"]
            row["present"] = c["inclusion"]
            row["rank"] = min(row["rank"], np.inf if c["criterion"] is None else c["criterion"])
        found = sorted(rows.values(), key=lambda r: r["rank"])[:MOST_CANDIDATES]
        return found or None

    def caption(self, data: list[dict]) -> str:
        """How to read it."""
        left = "Left: share of the misfit that one linear step beside the base removes (it only nominates). "
        return left + (
            "Right: how much more probable the recordings are with that effect alone beside the base than without "
            "(natural logarithm; left of zero it is worse than nothing), and the probability that it is there at "
            "all. Effects of the verdict in blue."
        )

    def draw(self, data: list[dict]) -> Figure:
        """Two panels side by side, one row an effect."""
        figure, (left, right) = grid(2, columns=2, height=0.9 + 0.28 * len(data))
        y = np.arange(len(data))[::-1]
        colours = [MODEL if r["chosen"] else FAINT for r in data]
        left.barh(y, [r["score"] for r in data], 0.6, color=colours)
        left.set_xlabel("share of the misfit, linear step")
        left.set_xlim(0, 1)
        for ax in (left, right):
            ax.set_yticks(y, [r["name"].replace("-", " ") for r in data])
            ax.set_ylim(-0.6, len(data) - 0.4)
        _evidence(right, data, y, colours)
        legend = {"effect of the verdict": Patch(color=MODEL), "other effect": Patch(color=FAINT)}
        legend |= {t: h for h, t in zip(*right.get_legend_handles_labels(), strict=True)}
        figure.legend(
            legend.values(), legend, loc="outside lower center", ncols=min(4, len(legend)), frameon=False, fontsize=8
        )
        return figure


def _evidence(ax, data: list[dict], y, colours) -> None:
    gain = np.array([-0.5 * r["rank"] for r in data])
    known = np.isfinite(gain)
    ax.barh(y[known], gain[known], 0.6, color=[c for c, k in zip(colours, known, strict=True) if k])
    ax.axvline(0, color=INK, linewidth=0.6)
    for i, row, g in zip(y, data, gain, strict=True):
        p = row["present"]
        text = "99 in 100 and more" if p > 0.99 else f"{100 * p:.0f} in 100" if p >= 0.01 else ""
        if text:
            inside = g > 0.6 * np.nanmax(np.where(known, gain, np.nan))
            ax.annotate(
                text, (g if np.isfinite(g) else 0.0, i), (-4 if inside else 4, 0), textcoords="offset points",
                va="center", ha="right" if inside else "left", fontsize=8, color="white" if inside else INK,
            )  # fmt: skip
    ax.set_xscale("symlog", linthresh=10)
    ax.set_xlabel("gain in ln evidence over the base alone")

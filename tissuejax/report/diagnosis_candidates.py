"""Every effect tried: what one linear step promised at the base fit, and what a full refit made of it."""

from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from tissuejax.diagnosis.result import Diagnosis
from tissuejax.report.plot import FAINT, HELD, INK, MODEL, Plot, grid


class DiagnosisCandidates(Plot):
    """Score share and refit of the best form of every effect, alone beside the base."""

    name: ClassVar[str] = "candidates"
    subject: ClassVar[type] = Diagnosis
    order: ClassVar[int] = 40

    def prepare(self, subject: Diagnosis) -> list[dict] | None:
        """One row an effect, the best first."""
        s, rows = subject.search, {}
        base = s.empty
        for c in subject.candidates():
            if c["refit_chi2_per_sample"] is None and (c["score_share"] or 0.0) < 1e-3:
                continue
            empty = {"name": c["name"], "score": 0.0, "fitted": None, "held": None, "chosen": False}
            row = rows.setdefault(c["name"], empty)
            row["score"] = max(row["score"], c["score_share"] or 0.0)
            row["chosen"] |= c["chosen"]
            refitted = c["refit_chi2_per_sample"]
            if refitted is not None and (row["fitted"] is None or refitted < row["fitted"]):
                row["fitted"], row["held"] = refitted, c["held_out_chi2_per_sample"]
        found = sorted(rows.values(), key=lambda r: r["fitted"] if r["fitted"] is not None else np.inf)[:14]
        for row in found:
            row["base"], row["base_held"] = base.chi2 / base.n, base.held / base.n_held if base.n_held else None
        return found or None

    def caption(self, data: list[dict]) -> str:
        """How to read it."""
        return (
            "Left: share of the misfit that one linear step beside the base removes (it nominates, it does not "
            "decide). Right: chi² per sample after a full refit with that effect alone, fitted (dots) and held out "
            "(rings); the vertical lines are the base model, 1 is noise. Effects of the verdict in blue."
        )

    def draw(self, data: list[dict]) -> Figure:
        """Two panels side by side."""
        figure, (left, right) = grid(2, columns=2, height=0.6 + 0.26 * len(data))
        y = np.arange(len(data))[::-1]
        left.barh(y, [r["score"] for r in data], 0.6, color=[MODEL if r["chosen"] else FAINT for r in data])
        left.set_yticks(y, [r["name"] for r in data])
        left.set_xlabel("share of the misfit, linear step")
        left.set_xlim(0, 1)
        for i, row in zip(y, data, strict=True):
            color = MODEL if row["chosen"] else FAINT
            if row["fitted"] is not None:
                right.plot(row["fitted"], i, "o", color=color, markersize=5)
            if row["held"] is not None:
                right.plot(row["held"], i, "o", markerfacecolor="none", color=color, markersize=7)
        right.axvline(data[0]["base"], color=INK, linewidth=0.8)
        if data[0]["base_held"] is not None:
            right.axvline(data[0]["base_held"], color=HELD, linewidth=0.8, linestyle="--")
        right.axvline(1, color=INK, linewidth=0.6, linestyle=":")
        right.set_yticks(y, [])
        right.set_xscale("log")
        right.set_xlabel("chi² per sample after refit")
        return figure

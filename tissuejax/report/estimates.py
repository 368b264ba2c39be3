"""Estimates with their relative standard errors, and the correlation between them."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from tissuejax.fitting.result import Fit
from tissuejax.report.plot import FAINT, INK, MODEL, PAPER, Plot, tidy

CAP = 100.0  # per cent; beyond, the bar is cut and marked


@dataclass(frozen=True)
class Spread:
    """Labels, relative standard errors in per cent (infinite where not identified), correlation matrix."""

    labels: tuple[str, ...]
    relative: Float[np.ndarray, " p"]
    correlation: Float[np.ndarray, "p p"]


class Estimates(Plot):
    """Which parameters are known, and which trade off against each other."""

    name: ClassVar[str] = "parameters"
    subject: ClassVar[type] = Fit
    order: ClassVar[int] = 30

    def prepare(self, subject: Fit) -> Spread | None:
        """Of the free parameters."""
        labels = tuple(path.removeprefix("energy.").removeprefix("effects.") for path in subject.free)
        value = np.array([abs(subject.values[path]) for path in subject.free])
        std = np.array([subject.std[path] for path in subject.free])
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = np.where(np.isfinite(std) & (value > 0), 100 * std / value, np.inf)
        return Spread(labels, relative, np.nan_to_num(subject.correlation))

    def caption(self, data: Spread) -> str:
        """The strongest pair in words."""
        text = "Standard error of each parameter relative to its value, and correlations between estimates."
        if len(data.labels) < 2:
            return text
        off = np.abs(data.correlation - np.diag(np.diag(data.correlation)))
        i, j = np.unravel_index(np.argmax(off), off.shape)
        return f"{text} Strongest: {data.labels[i]} and {data.labels[j]} ({data.correlation[i, j]:+.3f})."

    def draw(self, data: Spread) -> Figure:
        """Bars beside a matrix."""
        p = len(data.labels)
        wide = 0.085 * max(map(len, data.labels)) + 0.3
        figure = Figure(
            figsize=(9 + wide, max(2.8, 0.42 * p + 1.2 + 0.5 * wide)), layout="constrained", facecolor=PAPER
        )
        bars, matrix = figure.subplots(1, 2, gridspec_kw={"width_ratios": [1.0, 1.0]})
        tidy(bars)
        rows = np.arange(p)
        open_ended = ~np.isfinite(data.relative) | (data.relative > CAP)
        shown = np.where(open_ended, CAP, np.nan_to_num(data.relative))
        most = float(max(shown, default=CAP)) or 1.0
        bars.barh(rows, shown, color=[FAINT if o else MODEL for o in open_ended], height=0.55)
        for row, value, size in zip(rows, data.relative, shown, strict=True):
            text = (
                "not identified" if not np.isfinite(value) else f"{value:.2g} %" if value <= CAP else f"> {CAP:.0f} %"
            )
            bars.text(size + 0.01 * most, row, text, va="center", fontsize=8, color=INK)
        bars.set_yticks(rows, data.labels)
        bars.set_xlim(0, 1.45 * most)
        bars.set_ylim(p - 0.5, -0.5)
        bars.set_xlabel("relative standard error (%)")
        image = matrix.imshow(data.correlation, cmap="RdBu_r", vmin=-1, vmax=1)
        matrix.set_xticks(rows, data.labels, rotation=90, fontsize=8)
        matrix.set_yticks(rows, [""] * p)  # the rows of the bars
        for i in range(p):
            for j in range(p):
                value = data.correlation[i, j]
                colour = PAPER if abs(value) > 0.6 else INK
                matrix.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize=7, color=colour)
        figure.colorbar(image, ax=matrix, shrink=0.85, label="correlation")
        return figure

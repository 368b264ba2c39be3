"""Before and after, on the same axes: what the base model left, and what is left with the missing physics in."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from tissuejax.diagnosis.result import Diagnosis
from tissuejax.report.plot import FAINT, HELD, INK, MODEL, Plot, clock, grid

DENSE_RESIDUAL, MOST_RESIDUALS = 1500, 9
BAND = "#e0e6ea"
DONE = {"color": INK, "linewidth": 0.8, "linestyle": ":"}


@dataclass(frozen=True)
class Pair:
    """One series: residual over noise before and after, and the drive for orientation."""

    title: str
    time: np.ndarray
    before: np.ndarray
    after: np.ndarray
    drive: np.ndarray
    drive_name: str
    held: bool
    timed: bool


class DiagnosisResiduals(Plot):
    """Residual over noise against time, base model and chosen model, with the drive behind."""

    name: ClassVar[str] = "before-and-after"
    subject: ClassVar[type] = Diagnosis
    order: ClassVar[int] = 10

    def prepare(self, subject: Diagnosis) -> list[Pair] | None:
        """Force and stress series; of markers the one that misses most."""
        bench, base, chosen = subject.search.bench, subject.search.empty, subject.verdict.chosen
        z0, z1 = ((bench.y - r.prediction) / bench.sigma for r in (base, chosen))
        scalar = [s for s in bench.segments if "marker" not in s.component]
        marks = [s for s in bench.segments if "marker" in s.component]
        marks = sorted(marks, key=lambda s: -float(np.mean(z0[s.rows] ** 2)))[:2]
        names = (*bench.fitted, *bench.held_out)
        shown = sorted(scalar, key=lambda s: -float(np.mean(z0[s.rows] ** 2)))[: MOST_RESIDUALS - len(marks)] + marks
        shown = sorted(shown, key=lambda s: (names.index(s.recording), s.label))
        return [
            Pair(
                f"{s.recording} {s.label.replace('_', ' ')}",
                s.time,
                z0[s.rows],
                z1[s.rows],
                s.drive,
                s.drive_name,
                s.recording in bench.held_out,
                s.timed,
            )
            for s in shown
        ]

    def caption(self, data: list[Pair]) -> str:
        """How to read it."""
        return (
            "Measured minus predicted, in units of the noise. Grey: base model alone. Blue (fitted) and orange (held "
            "out, not fitted for the curves shown): with the effects of the verdict. Inside the pale band lies what "
            "noise alone gives. Dotted: what was done to the specimen, without a scale of its own."
        )

    def draw(self, data: list[Pair]) -> Figure:
        """One panel a series."""
        figure, axes = grid(len(data), columns=2 if len(data) in (2, 4) else min(3, len(data)), height=2.5)
        for ax, pair in zip(axes, data, strict=True):
            thin = slice(None, None, max(1, len(pair.time) // DENSE_RESIDUAL))
            ax.axhspan(-2, 2, color=BAND, zorder=0)
            ax.plot(pair.time[thin], pair.before[thin], color=FAINT, linewidth=0.9)
            ax.plot(pair.time[thin], pair.after[thin], color=HELD if pair.held else MODEL, linewidth=0.8)
            ax.set_title(pair.title + (" (held out)" if pair.held else ""), loc="left", fontsize=9.5, color=INK)
            ax.set_xlabel(clock(pair.timed))
            ax.set_ylabel("residual / noise")
            behind = ax.twinx()
            behind.plot(pair.time[thin], pair.drive[thin], **DONE)
            behind.set_yticks([])
            behind.spines[:].set_visible(False)
        lines = {"base model": {"color": FAINT}, "with effects, fitted": {"color": MODEL}}
        lines |= {"with effects, held out": {"color": HELD}} if any(p.held for p in data) else {}
        lines |= {"what was done (no scale)": DONE}
        handles = [Line2D([], [], **style) for style in lines.values()]
        handles.append(Patch(color=BAND))
        names = [*lines, "noise alone"]
        figure.legend(handles, names, loc="outside lower center", ncols=len(names), frameon=False, fontsize=8)
        return figure

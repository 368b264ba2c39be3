"""Measured curves and those of every model compared, over each other, one panel a recording and channel."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from tissuejax.fitting.comparison import Comparison
from tissuejax.report.plot import INK, MEASURED, SERIES, Plot, clock, grid
from tissuejax.report.scales import display, label
from tissuejax.report.series import Curve, curves

MOST_PANELS = 9
MOST_MODELS = 6  # best first; more lines can't be told apart


@dataclass(frozen=True)
class Overlay:
    """The measured curve of each panel, and every model's prediction of it by name."""

    measured: list[Curve]
    predicted: dict[str, list[Float[np.ndarray, " n"]]]


class ComparisonCurves(Plot):
    """All models on the measured points."""

    name: ClassVar[str] = "curves"
    subject: ClassVar[type] = Comparison
    order: ClassVar[int] = 10

    def prepare(self, subject: Comparison) -> Overlay | None:
        """The best models whose fits are at hand; fitted recordings first, held-out ones always among the panels."""
        fits = [(row.name, subject.fits[row.name]) for row in subject.rows if row.name in subject.fits][:MOST_MODELS]
        if not fits:
            return None
        found = {name: curves(fit) for name, fit in fits}
        first = next(iter(found.values()))
        held = [i for i, c in enumerate(first) if c.held][: MOST_PANELS // 2]
        shown = [i for i, c in enumerate(first) if not c.held][: MOST_PANELS - len(held)] + held
        return Overlay(
            [first[i] for i in shown], {name: [every[i].predicted for i in shown] for name, every in found.items()}
        )

    def caption(self, data: Overlay) -> str:
        """What the lines are."""
        return f"Measured (grey points) and {len(data.predicted)} models, the best supported first in the legend."

    def draw(self, data: Overlay) -> Figure:
        """Against stretch or shear; against time where the drive rests."""
        figure, axes = grid(len(data.measured), columns=min(3, len(data.measured)))
        for k, (ax, curve) in enumerate(zip(axes, data.measured, strict=True)):
            factor, unit = display(curve.unit, float(np.nanmax(np.abs(curve.measured), initial=0.0)))
            by_time = curve.drive is None or curve.held_still
            x = curve.time if by_time else curve.drive
            ax.plot(x, curve.measured / factor, ".", color=MEASURED, markersize=3, alpha=0.6, label="measured")
            for colour, (name, every) in zip(SERIES, data.predicted.items(), strict=False):
                ax.plot(x, every[k] / factor, color=colour, linewidth=1.3, label=name)
            ax.set_title(f"{curve.recording}{' (held out)' if curve.held else ''}", loc="left", fontsize=9.5, color=INK)
            ax.set_xlabel(clock(curve.timed) if by_time else curve.drive_name)
            ax.set_ylabel(f"{curve.channel.replace('_', ' ')}{label(unit)}")
        handles, names = axes[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=min(4, len(names)), frameon=False, fontsize=8)
        return figure

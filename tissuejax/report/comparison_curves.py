"""Measured curves and those of every model compared, over each other, one panel a recording and channel."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from tissuejax.fitting.comparison import Comparison
from tissuejax.report.plot import INK, MEASURED, SERIES, Plot, grid, legend_below
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
        """A row a series: left against stretch or shear where there is one, right against time."""
        both = any(c.drive is not None for c in data.measured)
        figure, axes = grid(len(data.measured) * (2 if both else 1), columns=2, height=2.5)
        panels = [(k, by_time) for k in range(len(data.measured)) for by_time in ((False, True) if both else (True,))]
        for ax, (k, by_time) in zip(axes, panels, strict=True):
            curve = data.measured[k]
            factor, unit = display(curve.unit, float(np.nanmax(np.abs(curve.measured), initial=0.0)))
            if curve.drive is None and not by_time:
                ax.set_visible(False)
                continue
            x, across = curve.axis(by_time)
            ax.plot(x, curve.measured / factor, ".", color=MEASURED, markersize=3, alpha=0.6, label="measured")
            for colour, (name, every) in zip(SERIES, data.predicted.items(), strict=False):
                ax.plot(x, every[k] / factor, color=colour, linewidth=1.3, label=name)
            ax.set_title(f"{curve.recording}{' (held out)' if curve.held else ''}", loc="left", fontsize=9.5, color=INK)
            ax.set_xlabel(across)
            ax.set_ylabel(f"{curve.channel.replace('_', ' ')}{label(unit)}")
        legend_below(figure, axes, columns=4)
        return figure

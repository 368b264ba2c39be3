"""Measured points and the fitted curve, one panel a recording and channel."""

from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from tissuejax.fitting.result import Fit
from tissuejax.report.plot import HELD, INK, MEASURED, MODEL, Plot, grid
from tissuejax.report.scales import display, label
from tissuejax.report.series import Curve, curves

MOST = 12  # panels; more recordings than this are better read in the table
DENSE = 400  # points drawn a panel


class FitOverlay(Plot):
    """Measurement and model on the same axes."""

    name: ClassVar[str] = "fit"
    subject: ClassVar[type] = Fit
    order: ClassVar[int] = 10

    def prepare(self, subject: Fit) -> list[Curve]:
        """The first panels, held-out recordings always among them."""
        found = curves(subject)
        held = [c for c in found if c.held]
        return [c for c in found if not c.held][: MOST - min(len(held), MOST // 2)] + held[: MOST // 2]

    def caption(self, data: list[Curve]) -> str:
        """What the colours mean."""
        held = " Orange: recordings that took no part in the fit." if any(c.held for c in data) else ""
        return f"Measured (grey) and fitted model (blue), {len(data)} series.{held}"

    def draw(self, data: list[Curve]) -> Figure:
        """Against stretch or shear; against time where the drive rests."""
        figure, axes = grid(len(data))
        for ax, curve in zip(axes, data, strict=True):
            draw_curve(ax, curve)
        return figure


def draw_curve(ax, curve: Curve) -> None:
    """One series on one axis."""
    factor, unit = display(curve.unit, float(np.nanmax(np.abs(curve.measured), initial=0.0)))
    by_time = curve.drive is None or curve.held_still
    x = curve.time if by_time else curve.drive
    thin = slice(None, None, max(1, len(x) // DENSE))
    ax.plot(x[thin], curve.measured[thin] / factor, ".", color=MEASURED, markersize=3.5, alpha=0.7, zorder=2)
    if curve.predicted is not None:
        ax.plot(x, curve.predicted / factor, color=HELD if curve.held else MODEL, linewidth=1.5, zorder=3)
    ax.set_title(f"{curve.recording}{' (held out)' if curve.held else ''}", loc="left", fontsize=9.5, color=INK)
    ax.set_xlabel("time (s)" if by_time else curve.drive_name)
    ax.set_ylabel(f"{curve.channel.replace('_', ' ')}{label(unit)}")

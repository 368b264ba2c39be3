"""What the model leaves over, in units of the noise: structure here is physics (or a rig) that is missing."""

from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from tissuejax.fitting.result import Fit
from tissuejax.report.fit_overlay import DENSE_OVERLAY, PANELS
from tissuejax.report.plot import HELD, INK, MODEL, Plot, grid, legend_below
from tissuejax.report.series import Curve, curves


class Residuals(Plot):
    """(predicted - measured) / noise over time, with the band that noise alone would fill."""

    name: ClassVar[str] = "residuals"
    subject: ClassVar[type] = Fit
    order: ClassVar[int] = 20

    def prepare(self, subject: Fit) -> list[tuple[Curve, np.ndarray]]:
        """Curve and normalised residual of each series that has a noise level."""
        usable = [c for c in curves(subject) if c.predicted is not None and c.std]
        inside, held = [c for c in usable if not c.held], [c for c in usable if c.held]
        shown = inside[: PANELS - min(len(held), PANELS // 2)] + held[: PANELS // 2]
        return [(c, (c.predicted - c.measured) / c.std) for c in shown] or None

    def caption(self, data: list[tuple[Curve, np.ndarray]]) -> str:
        """How to read it."""
        return (
            "Residuals in units of the noise. Noise alone scatters evenly, 95 % of it inside the grey band; "
            "waves, drifts "
            "and steps are systematic."
        )

    def draw(self, data: list[tuple[Curve, np.ndarray]]) -> Figure:
        """Against stretch or shear; of a probing and of a test that rests against time."""
        figure, axes = grid(len(data), height=2.2)
        for ax, (curve, r) in zip(axes, data, strict=True):
            x, across = curve.axis(curve.drive is None or curve.held_still or curve.drive_unit != "1")
            thin = slice(None, None, max(1, len(x) // DENSE_OVERLAY))
            ax.axhspan(-1.96, 1.96, color="#e9edf0", zorder=0, label="95 % of the noise")
            ax.axhline(0, color=INK, linewidth=0.6)
            ax.plot(x[thin], r[thin], ".", color=HELD if curve.held else MODEL, markersize=3,
                    label="held out" if curve.held else "fitted")  # fmt: skip
            ax.set_title(f"{curve.recording}{' (held out)' if curve.held else ''}", loc="left", fontsize=9.5, color=INK)
            ax.set_xlabel(across)
            ax.set_ylabel(f"{curve.channel.replace('_', ' ')}\nresidual / noise")
        legend_below(figure, axes)
        return figure

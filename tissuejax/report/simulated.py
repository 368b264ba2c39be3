"""What a model says of a test: its curves over what was done and over time, beside what was measured."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from matplotlib.figure import Figure

from tissuejax.recordings.recording import Recording
from tissuejax.report.fit_overlay import Shown, draw_shown
from tissuejax.report.plot import Plot, grid, legend_below
from tissuejax.report.series import Curve, curves_of

MOST_SIMULATED = 8  # series


@dataclass(frozen=True)
class Simulated:
    """Predicted recordings, what was measured of them (or None), and whether time was recorded."""

    predicted: Mapping[str, Recording]
    measured: Mapping[str, Recording] | None = None
    timed: bool = True


class SimulatedCurves(Plot):
    """A row a series: left over stretch, shear or the probe's travel, right over time."""

    name: ClassVar[str] = "simulated"
    subject: ClassVar[type] = Simulated
    order: ClassVar[int] = 10

    def prepare(self, subject: Simulated) -> list[tuple[Curve, bool]] | None:
        """The first series, and whether each was measured."""
        found = []
        for name, made in subject.predicted.items():
            seen = (subject.measured or {}).get(name)
            every = curves_of(made if seen is None else seen, made, timed=subject.timed)
            found += [(c, seen is not None) for c in every if c.predicted is not None]
        return found[:MOST_SIMULATED] or None

    def caption(self, data: list[tuple[Curve, bool]]) -> str:
        """What is seen."""
        beside = ", beside what was measured" if any(seen for _, seen in data) else ""
        return f"{len(data)} predicted series over what was done and over time{beside}."

    def draw(self, data: list[tuple[Curve, bool]]) -> Figure:
        """Two panels a series."""
        figure, axes = grid(2 * len(data), columns=2, height=2.5)
        for k, (curve, seen) in enumerate(data):
            shown = Shown(curve, None, None)
            if curve.drive is None:
                axes[2 * k].set_visible(False)
            else:
                draw_shown(axes[2 * k], shown, by_time=False, measured=seen)
            draw_shown(axes[2 * k + 1], shown, by_time=True, measured=seen)
        legend_below(figure, axes)
        return figure

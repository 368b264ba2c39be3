"""What is in a sample: every channel of every recording, over what was done."""

from typing import ClassVar

from matplotlib.figure import Figure

from tissuejax.recordings.recording import Sample
from tissuejax.report.fit_overlay import draw_curve
from tissuejax.report.plot import Plot, grid
from tissuejax.report.series import Curve, curves_of

MOST_SHOWN = 18


class Overview(Plot):
    """Measured channels of a sample."""

    name: ClassVar[str] = "overview"
    subject: ClassVar[type] = Sample
    order: ClassVar[int] = 10

    def prepare(self, subject: Sample) -> tuple[list[Curve], int]:
        """The first series, and how many there are in all."""
        found = [curve for recording in subject.recordings.values() for curve in curves_of(recording)]
        return found[:MOST_SHOWN], len(found)

    def caption(self, data: tuple[list[Curve], int]) -> str:
        """How many are shown."""
        shown, total = len(data[0]), data[1]
        return f"{shown} of {total} series." if shown < total else f"All {total} series."

    def draw(self, data: tuple[list[Curve], int]) -> Figure:
        """One panel a series."""
        figure, axes = grid(len(data[0]))
        for ax, curve in zip(axes, data[0], strict=True):
            draw_curve(ax, curve)
        return figure

"""Sobol indices as bars: alone (dark) and with interactions (light)."""

from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from tissuejax.fitting.sobol import Sobol
from tissuejax.report.plot import INK, SERIES, Plot, grid

MOST_BARS = 6


class SobolBars(Plot):
    """First-order and total indices, one panel a channel."""

    name: ClassVar[str] = "sobol"
    subject: ClassVar[type] = Sobol
    order: ClassVar[int] = 30

    def prepare(self, subject: Sobol) -> list[tuple[str, tuple[str, ...], np.ndarray, np.ndarray]]:
        """Channel, labels, first, total."""
        labels = tuple(path.removeprefix("energy.") for path in subject.paths)
        return [(key, labels, subject.first[key], subject.total[key]) for key in list(subject.first)[:MOST_BARS]]

    def caption(self, data) -> str:
        """How to read it."""
        return (
            "Share of each channel's variance that a parameter explains over its range: dark alone, light including "
            "interactions with the others."
        )

    def draw(self, data) -> Figure:
        """Horizontal bars."""
        figure, axes = grid(len(data), columns=min(3, len(data)), height=max(2.4, 0.35 * len(data[0][1]) + 1.2))
        for ax, (key, labels, first, total) in zip(axes, data, strict=True):
            rows = np.arange(len(labels))
            ax.barh(rows, np.clip(total, 0, None), color="#bcd6ea", height=0.7)
            ax.barh(rows, np.clip(first, 0, None), color=SERIES[0], height=0.35)
            ax.set_yticks(rows, labels)
            ax.invert_yaxis()
            ax.set_title(key, loc="left", fontsize=9.5, color=INK)
            ax.set_xlabel("Sobol index")
        return figure

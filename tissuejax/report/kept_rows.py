"""What was kept of each test: all rows in grey, those in the recording in colour, over time and over deformation."""

from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from tissuejax.recordings.specimens import Considered
from tissuejax.report.plot import FAINT, INK, MODEL, Plot, clock, grid
from tissuejax.report.scales import display, label

MOST_KEPT = 6


class Selections(tuple):
    """The tests of one sample, as `recordings.table.selections` gives them."""


class KeptRows(Plot):
    """Rows that a side file's selection keeps."""

    name: ClassVar[str] = "kept"
    subject: ClassVar[type] = Selections
    order: ClassVar[int] = 5

    def prepare(self, subject: Selections) -> list[Considered] | None:
        """The first tests; None where nothing is cut."""
        return list(subject)[:MOST_KEPT] or None

    def caption(self, data: list[Considered]) -> str:
        """How much is kept, and by what."""
        lines = [f"{c.name}: {int(c.kept.sum())} of {len(c.kept)} rows. {' '.join(c.notes)}" for c in data]
        return " ".join(lines)

    def draw(self, data: list[Considered]) -> Figure:
        """Two panels a test: load over time, load over deformation, in the columns' own reading."""
        figure, axes = grid(2 * len(data), columns=2, height=3.0)
        for k, one in enumerate(data):
            by_load, load_unit = display(one.load_unit, float(np.abs(one.load).max(initial=0.0)))
            by_motion, motion_unit = display(one.motion_unit, float(np.abs(one.motion).max(initial=0.0)))
            for ax, x, name in (
                (axes[2 * k], one.time, clock(one.timed)),
                (axes[2 * k + 1], one.motion / by_motion, f"{one.motion_name.replace('_', ' ')}{label(motion_unit)}"),
            ):
                ax.plot(x, one.load / by_load, color=FAINT, linewidth=0.8, label="in the table")
                kept = np.where(one.kept, one.load / by_load, np.nan)
                ax.plot(x, kept, color=MODEL, linewidth=1.6, label="kept")
                lonely = one.kept & ~np.roll(one.kept, 1) & ~np.roll(one.kept, -1)
                ax.plot(x[lonely], kept[lonely], ".", color=MODEL, markersize=3)
                ax.set_xlabel(name)
                ax.set_ylabel(f"{one.load_name.replace('_', ' ')}{label(load_unit)}")
            if one.zero is not None:
                axes[2 * k + 1].axvline(one.zero / by_motion, color=INK, linewidth=0.8, linestyle=":", label="new zero")
                axes[2 * k + 1].legend(frameon=False, fontsize=8, loc="best")
            axes[2 * k].set_title(one.name, loc="left", fontsize=9.5, color=INK)
            axes[2 * k].legend(frameon=False, fontsize=8, loc="best")
        return figure

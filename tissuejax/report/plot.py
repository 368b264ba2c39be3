"""What every plot is: data prepared without a picture (tested), and a drawing of nothing but that data."""

import abc
from typing import Any, ClassVar

import equinox as eqx
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.ticker import ScalarFormatter

INK, FAINT, PAPER = "#22313f", "#8795a1", "#ffffff"
MODEL, HELD, MEASURED = "#1f6fb2", "#d9730d", "#8a97a3"
BASE = "#22313f"  # the model before anything was added to it
SERIES = ("#1f6fb2", "#d9730d", "#3a9d5d", "#a64ca6", "#c0392b", "#7a6a2f", "#16838f", "#555555")


class Plot(eqx.Module):
    """One kind of picture of one kind of subject, a file each; found by walking the room.

    Class data:
        name: file name of the figure, and its key on a page.
        subject: the class it pictures.
        order: place on a page.
    """

    name: ClassVar[str]
    subject: ClassVar[type]
    order: ClassVar[int] = 100

    @abc.abstractmethod
    def prepare(self, subject: Any) -> Any | None:
        """The numbers to draw, or None where there is nothing to show."""

    @abc.abstractmethod
    def caption(self, data: Any) -> str:
        """One or two sentences under the figure: what is seen."""

    @abc.abstractmethod
    def draw(self, data: Any) -> Figure:
        """The figure of prepared numbers."""


def grid(n: int, columns: int = 3, width: float = 10.0, height: float = 2.7, **options) -> tuple[Figure, list]:
    """A figure with `n` axes in rows of `columns`; axes are flat."""
    columns = min(columns, n)
    rows = -(-n // columns)
    figure = Figure(figsize=(width, height * rows + 0.3), layout="constrained", facecolor=PAPER)
    axes = figure.subplots(rows, columns, squeeze=False, **options).ravel().tolist()
    for spare in axes[n:]:
        spare.set_visible(False)
    for ax in axes:
        tidy(ax)
    return figure, axes[:n]


def legend_below(figure: Figure, axes: list, columns: int = 6) -> None:
    """One legend for all axes under the figure, every label once."""
    known = {}
    for ax in axes:
        for handle, text in zip(*ax.get_legend_handles_labels(), strict=True):
            known.setdefault(text, handle)
    if known:
        columns = min(columns, len(known))
        figure.legend(known.values(), known, loc="outside lower center", ncols=columns, frameon=False, fontsize=8)


def scatter(ax, x, y) -> None:
    """Measured values: large pale points that a model's line can be seen on."""
    ax.plot(x, y, "o", color=MEASURED, alpha=0.6, markersize=4, markeredgewidth=0, zorder=2, label="measured")


def band(ax, x, low, high, colour: str, label: str) -> None:
    """The area between two curves over `x`, which may turn: one outline, so that what it covers twice is no darker.

    A quadrilateral between neighbours, all turned the same way round, is filled by the nonzero rule: their union.
    """
    x, low, high = (np.asarray(v, float) for v in (x, low, high))
    known = np.isfinite(x) & np.isfinite(low) & np.isfinite(high)
    i = np.flatnonzero(known[:-1] & known[1:])
    first, last = np.where(x[i + 1] >= x[i], (i, i + 1), (i + 1, i))
    ends = ((first, low), (last, low), (last, high), (first, high), (first, low))
    corners = np.stack([np.stack([x[k], y[k]], 1) for k, y in ends], 1)
    codes = [Outline.MOVETO, *[Outline.LINETO] * 3, Outline.CLOSEPOLY] * len(i)
    shape = Outline(corners.reshape(-1, 2), codes or None)
    ax.add_patch(PathPatch(shape, facecolor=colour, alpha=0.22, linewidth=0, zorder=1, label=label))
    ax.autoscale_view()


def clock(timed: bool) -> str:
    """The name of an axis of time; without a recorded time it counts samples."""
    return "time (s)" if timed else "sample"


def tidy(ax) -> None:
    """The house look of an axis: no box, thin grid, dark text."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set_color(FAINT)
    ax.tick_params(colors=INK, labelsize=8, length=3, color=FAINT)
    ax.grid(color="#e6ebef", linewidth=0.6)
    ax.set_axisbelow(True)
    for axis in (ax.xaxis, ax.yaxis):
        if isinstance(axis.get_major_formatter(), ScalarFormatter):
            axis.get_major_formatter().set_useOffset(False)  # no "1e-5+5e2" to be added by the reader
    for label in (ax.xaxis.label, ax.yaxis.label, ax.title):
        label.set_color(INK)
        label.set_fontsize(9)

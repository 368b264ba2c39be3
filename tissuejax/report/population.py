"""A population at a glance: separate fits, what they shrink to, the pooled fit, and where a new specimen should lie."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from tissuejax.campaign.population import Population, pooled
from tissuejax.report.plot import BASE, FAINT, HELD, INK, MODEL, Plot, grid, legend_below
from tissuejax.report.scales import display, label


@dataclass(frozen=True)
class Shrinkage:
    """One parameter, in `unit`, specimens sorted by group and value.

    Attributes:
        separate, shrunken: (value, low, high) of every specimen, 95 %.
        pooled: (value, low, high).
        new: 95 % of new specimens (of a new group, where there are groups).
        ends: where groups end.
    """

    path: str
    unit: str
    separate: Float[np.ndarray, "n 3"]
    shrunken: Float[np.ndarray, "n 3"]
    pooled: Float[np.ndarray, "3"]
    new: Float[np.ndarray, "2"]
    ends: Float[np.ndarray, " g"]


class PopulationSpread(Plot):
    """A panel a parameter."""

    name: ClassVar[str] = "population"
    subject: ClassVar[type] = Population
    order: ClassVar[int] = 10

    def prepare(self, subject: Population) -> list[Shrinkage]:
        """Intervals are 1.96 standard deviations in working coordinates, so that positive parameters stay positive."""
        of = subject.of
        x, S = of.working
        std = np.sqrt(np.einsum("nii->ni", S))
        mean, own = subject.specimens()
        steps = 1.96 * np.array([0.0, -1.0, 1.0])
        order = np.lexsort((x[:, 0], of.group))
        value, error = pooled(of)
        new = np.quantile(subject.new(), [0.025, 0.975], axis=0)
        ends = np.flatnonzero(np.diff(of.group[order])) + 0.5
        separate = of.natural((x[:, None] + steps[:, None] * std[:, None])[order])
        shrunken = of.natural((mean[:, None] + steps[:, None] * own[:, None])[order])
        return [
            Shrinkage(
                path,
                of.units[k] if of.units else "1",
                separate[:, :, k],
                shrunken[:, :, k],
                value[k] + steps * error[k],
                new[:, k],
                ends,
            )
            for k, path in enumerate(of.paths)
        ]

    def caption(self, data: list[Shrinkage]) -> str:
        """What is what."""
        return (
            "Every specimen by itself (grey, 95 %) and in the population (blue); the pooled fit, which takes all "
            "specimens for one (dashed), and where 95 % of new specimens should lie (orange). Dotted: ends of groups."
        )

    def draw(self, data: list[Shrinkage]) -> Figure:
        """Specimens side by side."""
        figure, axes = grid(len(data), columns=1, height=3.0)
        for ax, one in zip(axes, data, strict=True):
            shown = np.concatenate([one.separate[:, 0], one.new])
            factor, unit = display(one.unit, float(np.median(np.abs(shown))))
            at = np.arange(len(one.separate))
            ax.axhspan(*(one.new / factor), color=HELD, alpha=0.15, linewidth=0, label="95 % of new specimens")
            for values, colour, shift, text in (
                (one.separate, FAINT, -0.18, "separate fit"),
                (one.shrunken, MODEL, 0.18, "in the population"),
            ):
                v = values / factor
                ax.vlines(at + shift, v[:, 1], v[:, 2], color=colour, linewidth=1.0)
                ax.plot(at + shift, v[:, 0], "o", color=colour, markersize=2.6, label=text)
            ax.axhline(one.pooled[0] / factor, color=BASE, linestyle="--", linewidth=1.1, label="pooled fit")
            for end in one.ends:
                ax.axvline(end, color=INK, linewidth=0.5, linestyle=":")
            low, high = np.quantile(shown / factor, [0.0, 1.0])
            room = 0.15 * (high - low)
            ax.set_ylim(low - room, high + room)
            ax.set_xlim(-1, len(at))
            ax.set_ylabel(f"{one.path.split('.')[-1]}{label(unit)}")
            ax.set_xlabel("specimen")
        legend_below(figure, axes)
        return figure

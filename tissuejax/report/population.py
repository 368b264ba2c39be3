"""A population at a glance: separate fits, what they shrink to, the pooled fit, and where a new specimen should lie."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from tissuejax.campaign.population import Estimates, Population, pooled
from tissuejax.report.plot import BASE, FAINT, HELD, INK, MODEL, Plot, grid, legend_below
from tissuejax.report.scales import common, label

NAMED = 60  # names that an axis takes
STEPS = 1.96 * np.array([0.0, -1.0, 1.0])  # value, low and high end of 95 %, in standard deviations


def intervals(found: Population) -> tuple[Float[np.ndarray, "n 3 p"], Float[np.ndarray, "n 3 p"]]:
    """(value, low, high) of every specimen, 95 %, SI: by itself, and in the population."""
    of = found.of
    x, S = of.working
    std = np.sqrt(np.einsum("nii->ni", S))
    mean, own = found.specimens()
    separate, shrunken = (centre[:, None] + STEPS[:, None] * s[:, None] for centre, s in ((x, std), (mean, own)))
    return of.natural(separate), of.natural(shrunken)


def shown_in(of: Estimates) -> list[tuple[float, str]]:
    """Divisor and unit of every parameter, in the figure as in the tables: one for all that have the same SI unit."""
    return common(of.units or ("1",) * len(of.paths), np.median(np.abs(of.values), axis=0).tolist())


@dataclass(frozen=True)
class Shrinkage:
    """One parameter, SI, specimens sorted by group and value.

    Attributes:
        separate, shrunken: (value, low, high) of every specimen, 95 %.
        pooled: (value, low, high).
        new: 95 % of new specimens (of a new group, where there are groups).
        ends: where groups end.
        names: of the specimens, or of the groups where there are any, at `places`.
        factor, shown: of the unit in which it is drawn: parameters of one unit share it.
    """

    path: str
    separate: Float[np.ndarray, "n 3"]
    shrunken: Float[np.ndarray, "n 3"]
    pooled: Float[np.ndarray, "3"]
    new: Float[np.ndarray, "2"]
    ends: Float[np.ndarray, " g"]
    names: tuple[str, ...]
    places: Float[np.ndarray, " g"]
    factor: float
    shown: str


class PopulationSpread(Plot):
    """A panel a parameter."""

    name: ClassVar[str] = "population"
    subject: ClassVar[type] = Population
    order: ClassVar[int] = 10

    def prepare(self, subject: Population) -> list[Shrinkage]:
        """Intervals are 1.96 standard deviations in working coordinates, so that positive parameters stay positive."""
        of = subject.of
        order = np.lexsort((of.working[0][:, 0], of.group))
        value, error = pooled(of)
        new = np.quantile(subject.new(), [0.025, 0.975], axis=0)
        group = of.group[order]
        ends = np.flatnonzero(np.diff(group)) + 0.5
        names, places = tuple(of.samples[i] for i in order), np.arange(len(order), dtype=float)
        if of.groups:
            names, places = of.labels, np.array([np.mean(places[group == g]) for g in range(len(of.labels))])
        separate, shrunken = (values[order] for values in intervals(subject))
        return [
            Shrinkage(path, separate[:, :, k], shrunken[:, :, k], value[k] + STEPS * error[k], new[:, k], ends, names,
                      places, *unit)
            for k, (path, unit) in enumerate(zip(of.paths, shown_in(of), strict=True))
        ]  # fmt: skip

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
            shown, factor = np.concatenate([one.separate[:, 0], one.new]), one.factor
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
            ax.set_ylabel(f"{one.path.split('.')[-1]}{label(one.shown)}")
            ax.set_xlabel("specimen")
            if len(one.names) <= NAMED:
                ax.set_xticks(one.places, one.names, rotation=90, fontsize=7)
        legend_below(figure, axes)
        return figure

"""A cohort at a glance: how every parameter is spread over the samples, and how well they were fitted."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from matplotlib.figure import Figure

from tissuejax.report.plot import HELD, INK, MODEL, Plot, grid

TITLES = {"chi2_per_dof": "chi-square per degree of freedom"}


@dataclass(frozen=True)
class Cohort:
    """Rows of a campaign's table."""

    rows: tuple[dict[str, Any], ...]


class CohortSpread(Plot):
    """A histogram a parameter, with the median."""

    name: ClassVar[str] = "cohort"
    subject: ClassVar[type] = Cohort
    order: ClassVar[int] = 10

    def prepare(self, subject: Cohort) -> dict[str, np.ndarray] | None:
        """Values of each column that holds numbers, in file order."""
        names = [n for n in dict.fromkeys(n for r in subject.rows for n in r) if not n.startswith("std ")]
        found = {}
        for name in names:
            values = [r[name] for r in subject.rows if isinstance(r.get(name), int | float)]
            if values:
                found[name] = np.asarray(values, float)
        return found or None

    def caption(self, data: dict[str, np.ndarray]) -> str:
        """What the line is."""
        return "Spread over the samples; the line is the median. One value is one sample."

    def draw(self, data: dict[str, np.ndarray]) -> Figure:
        """One panel a column."""
        figure, axes = grid(len(data), height=2.4)
        for ax, (name, values) in zip(axes, data.items(), strict=True):
            ax.hist(values, min(40, max(8, len(values) // 5)), color=MODEL, alpha=0.8)
            ax.axvline(np.median(values), color=HELD, linewidth=1.5)
            ax.set_title(f"{name}, median {np.median(values):.4g}", loc="left", fontsize=9, color=INK)
            ax.set_xlabel(TITLES.get(name, name.split(".")[-1]))
            ax.set_ylabel("samples")
        return figure

"""How the misfit fell from step to step, and where each start ended."""

from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tissuejax.fitting.result import Fit
from tissuejax.report.plot import FAINT, MODEL, Plot, grid


class Trace(Plot):
    """Chi-square of accepted steps, and of the ends of all starts."""

    name: ClassVar[str] = "trace"
    subject: ClassVar[type] = Fit
    order: ClassVar[int] = 90

    def prepare(self, subject: Fit) -> dict[str, np.ndarray] | None:
        """Steps and ends; None where nothing was searched (constants solved for at once)."""
        if len(subject.trace) < 2:
            return None
        return {"steps": np.array([i.chi2 for i in subject.trace]), "ends": np.array(subject.starts, float)}

    def caption(self, data: dict[str, np.ndarray]) -> str:
        """Counts."""
        ends = data["ends"][np.isfinite(data["ends"])]
        same = int(np.sum(ends <= ends.min() * (1 + 1e-3) + 1e-9))
        if len(data["ends"]) < 2:
            return f"{len(data['steps'])} accepted steps."
        return (
            f"{len(data['steps'])} accepted steps of the best start; {same} of {len(data['ends'])} starts "
            f"ended at the best fit."
        )

    def draw(self, data: dict[str, np.ndarray]) -> Figure:
        """Logarithmic; the ends only where there was more than one start."""
        figure, (steps, *more) = grid(1 + (len(data["ends"]) > 1), columns=2, height=2.4)
        steps.semilogy(np.arange(1, len(data["steps"]) + 1), data["steps"], ".-", color=MODEL)
        steps.set_xlabel("accepted step")
        steps.set_ylabel("chi-square")
        order = np.sort(data["ends"])
        for ends in more:
            ends.semilogy(np.arange(1, len(order) + 1), order, "o", color=MODEL, markerfacecolor=FAINT)
            ends.xaxis.set_major_locator(MaxNLocator(integer=True))
            ends.set_xlabel("start, sorted")
            ends.set_ylabel("chi-square at its end")
        return figure

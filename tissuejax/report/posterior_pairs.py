"""Draws of a posterior: a histogram for each parameter, and every pair against each other."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from tissuejax.fitting.posterior import Posterior
from tissuejax.fitting.result import Fit
from tissuejax.report.fit_tables import PARAMETERS
from tissuejax.report.numbers import write_tabular
from tissuejax.report.plot import HELD, INK, MODEL, PAPER, Plot, legend_below, tidy
from tissuejax.report.scales import display, label, with_std

MOST_PAIRED = 6  # parameters; more panels can't be read
SHOWN = 800  # points


@dataclass(frozen=True)
class Drawn:
    """A fit and draws of its posterior."""

    fit: Fit
    posterior: Posterior


def write_latex(subject: Drawn, path: Path) -> Path:
    r"""A `tabular` of mean, standard deviation and 95 % interval of each parameter."""
    declared, rows = subject.fit.problem.predictor.model.parameters, []
    for name, row in subject.posterior.record()["parameters"].items():
        by, unit = display(declared[name].unit, abs(row["mean"]))
        low, high = row["95 %"]
        value = with_std(row["mean"] / by, row["std"] / by)
        rows.append((name, value, f"{low / by:.4g} to {high / by:.4g}", "" if unit == "1" else unit))
    return write_tabular(path, PARAMETERS, rows)


class PosteriorPairs(Plot):
    """The corner plot."""

    name: ClassVar[str] = "posterior"
    subject: ClassVar[type] = Drawn
    order: ClassVar[int] = 10

    def prepare(self, subject: Drawn) -> list[tuple[str, np.ndarray, float, float]]:
        """Label with unit, draws, estimate, standard error of each, in readable units."""
        declared, fit = subject.fit.problem.predictor.model.parameters, subject.fit
        found = []
        for path, draws in list(zip(subject.posterior.paths, subject.posterior.flat.T, strict=True))[:MOST_PAIRED]:
            factor, unit = display(declared[path].unit, abs(fit.values[path]))
            name = f"{path.removeprefix('energy.').removeprefix('effects.')}{label(unit)}"
            found.append((name, draws / factor, fit.values[path] / factor, fit.std[path] / factor))
        return found

    def caption(self, data: list) -> str:
        """How to read it."""
        return (
            "Draws of the posterior (blue), in the diagonal with the normal curve of estimate and standard error "
            "(orange): where they differ, the standard error misleads."
        )

    def draw(self, data: list) -> Figure:
        """Lower triangle."""
        p = len(data)
        figure = Figure(figsize=(2.3 * p + 1.2, 2.1 * p + 0.9), layout="constrained", facecolor=PAPER)
        axes = figure.subplots(p, p, squeeze=False)
        for i, (name, x, value, std) in enumerate(data):
            for j in range(p):
                ax = axes[i, j]
                if j > i:
                    ax.set_visible(False)
                    continue
                tidy(ax)
                if i == j:
                    ax.hist(x, 40, density=True, color=MODEL, alpha=0.75, label="draws")
                    if np.isfinite(std) and std > 0:
                        t = np.linspace(x.min(), x.max(), 120)
                        normal = np.exp(-0.5 * ((t - value) / std) ** 2) / std / np.sqrt(2 * np.pi)
                        ax.plot(t, normal, color=HELD, label="estimate and standard error")
                    ax.set_yticks([])
                    ax.set_title(name, fontsize=9, color=INK)
                else:
                    thin = slice(None, None, max(1, len(x) // SHOWN))
                    ax.plot(data[j][1][thin], x[thin], ".", color=MODEL, markersize=2, alpha=0.4)
                if i == p - 1:
                    ax.set_xlabel(data[j][0])
                if j == 0 and i > 0:
                    ax.set_ylabel(name)
        legend_below(figure, [axes[i, i] for i in range(p)], columns=2 if p > 1 else 1)
        return figure

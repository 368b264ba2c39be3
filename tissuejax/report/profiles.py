"""Profile likelihoods: how chi-square rises as each parameter is held away from its estimate."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from tissuejax.fitting.profile import Profile
from tissuejax.fitting.result import Fit
from tissuejax.report.numbers import headed, write_series
from tissuejax.report.plot import FAINT, HELD, INK, MODEL, Plot, grid
from tissuejax.report.scales import display, label


def write_profiles(subject: "Profiles", path: Path) -> Path:
    """The figure's points as CSV: where each parameter was held, SI, and how much chi-square rises."""
    declared = subject.fit.problem.predictor.model.parameters
    return write_series(
        path,
        (
            ({"parameter": p.path}, {headed("held at", declared[p.path].unit): p.values, "rise of chi-square": p.rise})
            for p in subject.profiles
        ),
    )


@dataclass(frozen=True)
class Profiles:
    """A fit and the profiles of some of its parameters."""

    fit: Fit
    profiles: tuple[Profile, ...]


class ProfileCurves(Plot):
    """One panel a parameter."""

    name: ClassVar[str] = "profiles"
    subject: ClassVar[type] = Profiles
    order: ClassVar[int] = 10

    def prepare(self, subject: Profiles) -> list[tuple[Profile, float, float, str, float]]:
        """Profile, estimate, standard error, unit and 95 % threshold of each."""
        declared, fit = subject.fit.problem.predictor.model.parameters, subject.fit
        top = fit.uncertainty.quantile() ** 2
        return [(p, fit.values[p.path], fit.std[p.path], declared[p.path].unit, top) for p in subject.profiles]

    def caption(self, data: list) -> str:
        """How to read it."""
        return (
            "Rise of chi-square with each parameter held and the others fitted again (blue), beside "
            "the parabola of the standard error (grey). The 95 % interval lies where blue is below the dashed line; "
            "a profile that stays below it is not bounded on that side."
        )

    def draw(self, data: list) -> Figure:
        """Rise over value."""
        figure, axes = grid(len(data), columns=min(3, len(data)), height=2.8)
        for ax, (found, value, std, unit, top) in zip(axes, data, strict=True):
            factor, shown = display(unit, abs(value) or 1.0)
            ax.plot(found.values / factor, found.rise, "o-", color=MODEL, markersize=3, linewidth=1.3, label="profile")
            if np.isfinite(std) and std > 0:
                x = np.linspace(found.values.min(), found.values.max(), 100)
                ax.plot(x / factor, ((x - value) / std) ** 2, color=FAINT, linewidth=1.0, label="standard error")
            ax.axhline(top, color=HELD, linestyle="--", linewidth=1.0, label="95 %")
            ax.axvline(value / factor, color=INK, linewidth=0.6)
            ax.set_ylim(-0.3, 3 * top)
            ax.set_title(found.path, loc="left", fontsize=9.5, color=INK)
            ax.set_xlabel(f"{found.path.split('.')[-1]}{label(shown)}")
            ax.set_ylabel("rise of chi-square")
        handles, names = axes[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=3, frameon=False, fontsize=8)
        return figure

"""What each parameter does over stretch or time, and which directions the data see."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from tissuejax.fitting.sensitivity import Sensitivity
from tissuejax.report.plot import INK, SERIES, Plot, grid
from tissuejax.report.scales import display, label

MOST_CHANNELS = 6


@dataclass(frozen=True)
class Panel:
    """One channel: x, its label, change by parameter in `unit`."""

    title: str
    x: Float[np.ndarray, " n"]
    x_label: str
    change: dict[str, Float[np.ndarray, " n"]]
    unit: str


class Sensitivities(Plot):
    """theta dy/dtheta of every parameter, one panel a channel."""

    name: ClassVar[str] = "sensitivity"
    subject: ClassVar[type] = Sensitivity
    order: ClassVar[int] = 10

    def prepare(self, subject: Sensitivity) -> list[Panel]:
        """Components of vector channels are summed in quadrature."""
        panels = []
        for key in next(iter(subject.change.values())):
            recording, channel = key.split("/", 1)
            predicted = subject.predicted[recording]
            series = predicted.channels[channel]
            drive = next((n for n in ("stretch", "shear") if n in predicted.inputs), None)
            x = np.asarray(predicted.inputs[drive] if drive else series.time, float)
            if x.ndim != 1 or len(x) != len(series.time):
                x, drive = np.asarray(series.time, float), None
            change = {path.removeprefix("energy."): _flat(by[key]) for path, by in subject.change.items()}
            panels.append(Panel(key, x, drive or "time (s)", change, series.unit))
        return panels[:MOST_CHANNELS]

    def caption(self, data: list[Panel]) -> str:
        """How to read it."""
        return (
            "Change of each channel if one parameter grew by 100 % (linearised). Curves of one shape can't be "
            "told apart: "
            "only their sum is seen."
        )

    def draw(self, data: list[Panel]) -> Figure:
        """One colour a parameter."""
        figure, axes = grid(len(data), columns=min(3, len(data)), height=3.2)
        for ax, panel in zip(axes, data, strict=True):
            size = max(float(np.nanmax(np.abs(c), initial=0.0)) for c in panel.change.values())
            factor, unit = display(panel.unit, size)
            order = np.argsort(panel.x, kind="stable") if panel.x_label != "time (s)" else slice(None)
            for colour, (name, change) in zip(SERIES * 4, panel.change.items(), strict=False):
                ax.plot(panel.x[order], change[order] / factor, color=colour, label=name, linewidth=1.4)
            ax.axhline(0, color=INK, linewidth=0.5)
            ax.set_title(panel.title, loc="left", fontsize=9.5, color=INK)
            ax.set_xlabel(panel.x_label)
            ax.set_ylabel(f"theta dy/dtheta{label(unit)}")
        axes[0].legend(frameon=False, fontsize=8, ncols=2)
        return figure


class Directions(Plot):
    """Eigenvectors of the Fisher information and how sharply each is seen."""

    name: ClassVar[str] = "fisher"
    subject: ClassVar[type] = Sensitivity
    order: ClassVar[int] = 20

    def prepare(self, subject: Sensitivity) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
        """Labels, weights (directions by parameters), relative standard errors."""
        labels = tuple(path.removeprefix("energy.") for path in subject.paths)
        weights = np.array([[d.weights[p] for p in subject.paths] for d in subject.directions])
        return labels, weights, np.array([d.relative_std for d in subject.directions])

    def caption(self, data) -> str:
        """The worst direction."""
        blind = int(np.sum(data[2] > 1))
        return (
            "Directions in relative parameters, the best seen first, with the relative standard error that these data "
            f"give; {blind} of {len(data[2])} are not identified (above 100 %)."
        )

    def draw(self, data) -> Figure:
        """Weights as a matrix beside the errors as bars."""
        labels, weights, std = data
        figure, (left, right) = grid(2, columns=2, height=max(2.6, 0.5 * len(labels) + 1.2))
        rows = np.arange(len(std))
        left.grid(False)
        left.imshow(weights, cmap="RdBu_r", vmin=-1, vmax=1, aspect="auto")
        left.set_xticks(np.arange(len(labels)), labels, rotation=45, ha="right")
        left.set_yticks(rows, [f"direction {i + 1}" for i in rows])
        for i, row in enumerate(weights):
            for j, w in enumerate(row):
                left.text(
                    j, i, f"{w:+.2f}", ha="center", va="center", fontsize=7, color="white" if abs(w) > 0.6 else INK
                )
        right.barh(rows, np.minimum(std, 1e6), color=[SERIES[0] if s < 1 else SERIES[1] for s in std], height=0.55)
        right.set_xscale("log")
        right.axvline(1, color=INK, linewidth=0.8)
        right.set_yticks(rows, [])
        right.invert_yaxis()
        right.set_xlabel("relative standard error (1 = 100 %)")
        return figure


def _flat(change: np.ndarray) -> np.ndarray:
    return change if change.ndim == 1 else np.sqrt(np.nansum(change.reshape(len(change), -1) ** 2, axis=1))

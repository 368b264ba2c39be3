"""The first figure of a diagnosis: what was measured, what the base model says, and what it says with the effects."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from tissuejax.diagnosis.foreseen import prediction_std
from tissuejax.diagnosis.result import Diagnosis
from tissuejax.estimation.covariance import inflation
from tissuejax.estimation.quantile import quantile
from tissuejax.estimation.series import Segment
from tissuejax.report.plot import BASE, HELD, INK, MODEL, Plot, band, clock, grid, legend_below, scatter
from tissuejax.report.scales import display, label

MOST_CURVES = 5
DENSE_CURVE = 1500


@dataclass(frozen=True)
class Curve:
    """One series, SI.

    Attributes:
        title: recording and channel.
        measured, base, improved: the series; `improved` is None where nothing was added to the base.
        half: half-width of the 95 % band about the improved (or base) model.
        drive: what was done, with its name and SI unit; `swept` if it moves enough to be an axis.
        held: whether the recording took no part in the fits shown; timed: whether time was recorded.
    """

    title: str
    channel: str
    time: Float[np.ndarray, " n"]
    drive: Float[np.ndarray, " n"]
    drive_name: str
    drive_unit: str
    measured: Float[np.ndarray, " n"]
    base: Float[np.ndarray, " n"]
    improved: Float[np.ndarray, " n"] | None
    half: Float[np.ndarray, " n"]
    unit: str
    held: bool
    timed: bool

    @property
    def swept(self) -> bool:
        """Whether the drive moves at all."""
        return bool(np.ptp(self.drive) > 0)


class DiagnosisCurves(Plot):
    """Measured, base and improved, in the channel's own unit."""

    name: ClassVar[str] = "measured"
    subject: ClassVar[type] = Diagnosis
    order: ClassVar[int] = 5

    def prepare(self, subject: Diagnosis) -> list[Curve]:
        """The series that the base misses most, held-out ones always among them, and the marker that it misses most."""
        bench, base, chosen = subject.search.bench, subject.search.empty, subject.verdict.chosen
        half = _half(subject)
        z = (bench.y - base.prediction) / bench.sigma

        def miss(s: Segment) -> float:
            return float(np.mean(z[s.rows] ** 2))

        scalar = [s for s in bench.segments if "marker" not in s.component and _carries(bench, s)]
        held = sorted((s for s in scalar if s.recording in bench.held_out), key=miss)[::-1][:2]
        marks = sorted((s for s in bench.segments if "marker" in s.component), key=miss)[-1:]
        fitted = sorted((s for s in scalar if s.recording not in bench.held_out), key=miss)[::-1]
        names = (*bench.fitted, *bench.held_out)
        shown = fitted[: MOST_CURVES - len(held) - len(marks)] + held + marks
        return [
            Curve(
                f"{s.recording}{' (held out)' if s.recording in bench.held_out else ''}",
                s.label.replace("_", " "),
                s.time,
                s.drive,
                s.drive_name,
                s.drive_unit,
                bench.y[s.rows],
                base.prediction[s.rows],
                chosen.prediction[s.rows] if chosen.keys else None,
                half[s.rows],
                s.unit,
                s.recording in bench.held_out,
                s.timed,
            )
            for s in sorted(shown, key=lambda s: (names.index(s.recording), s.label))
        ]

    def caption(self, data: list[Curve]) -> str:
        """What the lines are, and how many of the held-out values the band holds."""
        effects = any(t.improved is not None for t in data)
        text = "Measured (points), the base model (dashed)" + (" and with the effects named (line)" if effects else "")
        text += ", over what was done and over time. Band: where 95 % of measured values should lie"
        held = [t for t in data if t.held]
        if held:
            model = [t.base if t.improved is None else t.improved for t in held]
            inside = np.concatenate([np.abs(t.measured - m) <= t.half for t, m in zip(held, model, strict=True)])
            text += f"; it holds {np.mean(inside):.0%} of those held out"
        return text + "."

    def draw(self, data: list[Curve]) -> Figure:
        """A row a series: left over what was done, right over time."""
        figure, axes = grid(2 * len(data), columns=2, height=2.5)
        for i, curve in enumerate(data):
            if curve.swept:
                _draw(axes[2 * i], curve, by_time=False)
            else:
                axes[2 * i].set_visible(False)
            _draw(axes[2 * i + 1], curve, by_time=True)
        legend_below(figure, axes)
        return figure


def _draw(ax, curve: Curve, by_time: bool) -> None:
    factor, unit = display(curve.unit, float(np.nanmax(np.abs(curve.measured), initial=0.0)))
    thin = slice(None, None, max(1, len(curve.time) // DENSE_CURVE))
    scale, drive_unit = display(curve.drive_unit, float(np.nanmax(np.abs(curve.drive), initial=0.0)))
    x = (curve.time if by_time else curve.drive / scale)[thin]
    colour, kind = (HELD, ", held out") if curve.held else (MODEL, "")
    best = curve.base if curve.improved is None else curve.improved
    scatter(ax, x, curve.measured[thin] / factor)
    low, high = ((best + side * curve.half)[thin] / factor for side in (-1, 1))
    band(ax, x, low, high, colour, f"95 % band{kind}")
    line = {"linewidth": 1.3, "zorder": 4}
    if curve.improved is None:
        ax.plot(x, curve.base[thin] / factor, color=colour, label=f"base model{kind}", **line)
    else:
        ax.plot(x, curve.base[thin] / factor, color=BASE, linestyle=(0, (4, 2)), label="base model", **line)
        ax.plot(x, curve.improved[thin] / factor, color=colour, label=f"with effects{kind}", **line)
    ax.set_title(curve.title, loc="left", fontsize=9.5, color=INK)
    ax.set_xlabel(clock(curve.timed) if by_time else f"{curve.drive_name}{label(drive_unit)}")
    ax.set_ylabel(f"{curve.channel}{label(unit)}")


def _carries(bench, s: Segment) -> bool:
    """Whether a component of a channel is more than a twentieth of the channel's largest."""
    alike = [o for o in bench.segments if (o.recording, o.channel) == (s.recording, s.channel)]
    largest = max(float(np.max(np.abs(bench.y[o.rows]))) for o in alike)
    return float(np.max(np.abs(bench.y[s.rows]))) > 0.05 * largest


def _half(d: Diagnosis) -> Float[np.ndarray, " N"]:
    """Half-widths: noise, errors of the estimates where a prediction costs nothing, and what any law leaves."""
    a, keys = d.answered, frozenset(d.answered.chosen.keys)
    fit = a.plain[keys]
    level = inflation(fit.chi2, fit.n, fit.k, estimated=True)[0] if a.bench.estimated else 1.0
    variance = level * a.bench.sigma**2 + a.rest_size() ** 2
    if a.bench is a.fitting:
        variance = variance + prediction_std(a.bench, a.whitenings[keys], fit) ** 2
    return quantile(0.95, a.chosen.dof) * np.sqrt(variance)

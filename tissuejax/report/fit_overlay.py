"""Measured points, the fitted model with its band, the model with effects off: over what was done and over time."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from tissuejax.fitting.bands import half_width, prediction_std
from tissuejax.fitting.result import Fit
from tissuejax.report.plot import BASE, HELD, INK, MEASURED, MODEL, Plot, band, grid, legend_below, scatter
from tissuejax.report.scales import display, label
from tissuejax.report.series import Curve, components, curves

PANELS = 8  # series; more recordings than this are better read in the table
DENSE_OVERLAY = 400  # points drawn a panel


@dataclass(frozen=True)
class Shown:
    """One series of a fit.

    Attributes:
        curve: measured and predicted.
        band: half width of the 95 % band of a measured value (estimates and noise), or None.
        bare: the same model with every effect off, or None where there is no effect.
    """

    curve: Curve
    band: Float[np.ndarray, " n"] | None
    bare: Float[np.ndarray, " n"] | None

    @property
    def recording(self) -> str:
        """Its name."""
        return self.curve.recording


class FitOverlay(Plot):
    """Measurement and model on the same axes."""

    name: ClassVar[str] = "fit"
    subject: ClassVar[type] = Fit
    order: ClassVar[int] = 10

    def prepare(self, subject: Fit) -> list[Shown]:
        """The first series, held-out recordings always among them."""
        found, bands, bare = curves(subject), _bands(subject), _bare(subject)
        every = [Shown(c, bands.get((c.recording, c.channel)), bare.get((c.recording, c.channel))) for c in found]
        held = [s for s in every if s.curve.held]
        return [s for s in every if not s.curve.held][: PANELS - min(len(held), PANELS // 2)] + held[: PANELS // 2]

    def caption(self, data: list[Shown]) -> str:
        """What the colours mean."""
        text = f"Measured and fitted, {len(data)} series, over what was done and over time."
        if any(s.band is not None for s in data):
            text += " Band: where 95 % of measured values should lie, from the estimates' errors and the noise."
            missing = list(dict.fromkeys(s.recording for s in data if s.band is None))
            text += f" No band was computed for {', '.join(missing)}." if missing else ""
        if any(s.bare is not None for s in data):
            text += " Dashed: the same energy with every effect off, not refitted."
        return text + (" Orange: recordings that took no part in the fit." if any(s.curve.held for s in data) else "")

    def draw(self, data: list[Shown]) -> Figure:
        """A row a series: left over stretch, shear or depth where there is one, right over time."""
        both = any(s.curve.drive is not None for s in data)
        figure, axes = grid(len(data) * (2 if both else 1), columns=2, height=2.5)
        panels = iter(axes)
        for shown in data:
            if both and shown.curve.drive is not None:
                draw_shown(next(panels), shown, by_time=False)
            elif both:
                next(panels).set_visible(False)
            draw_shown(next(panels), shown, by_time=True)
        legend_below(figure, axes)
        return figure


def draw_shown(ax, shown: Shown, by_time: bool, measured: bool = True) -> None:
    """One series on one axis, with band and bare model; `measured` is False where there is nothing but the model."""
    curve = shown.curve
    factor, unit = display(curve.unit, float(np.nanmax(np.abs(curve.measured), initial=0.0)))
    x, across = curve.axis(by_time)
    colour, kind = (HELD, "model, held out") if curve.held else (MODEL, "model")
    thin = slice(None, None, max(1, len(x) // DENSE_OVERLAY))
    if measured:
        scatter(ax, x[thin], curve.measured[thin] / factor)
    if shown.bare is not None:
        ax.plot(x, shown.bare / factor, "--", color=BASE, linewidth=1.1, zorder=3, label="effects off")
    if shown.band is not None:
        low, high = ((curve.predicted + side * shown.band) / factor for side in (-1, 1))
        band(ax, x, low, high, colour, "95 % band, held out" if curve.held else "95 % band")
    ax.plot(x, curve.predicted / factor, color=colour, linewidth=1.3, zorder=4, label=kind)
    ax.set_title(f"{curve.recording}{' (held out)' if curve.held else ''}", loc="left", fontsize=9.5, color=INK)
    ax.set_xlabel(across)
    ax.set_ylabel(f"{curve.channel.replace('_', ' ')}{label(unit)}")


def draw_curve(ax, curve: Curve, by_time: bool) -> None:
    """One series on one axis, against time or else against stretch, shear or depth."""
    factor, unit = display(curve.unit, float(np.nanmax(np.abs(curve.measured), initial=0.0)))
    x, across = curve.axis(by_time)
    thin = slice(None, None, max(1, len(x) // DENSE_OVERLAY))
    ax.plot(x[thin], curve.measured[thin] / factor, ".", color=MEASURED, markersize=3.5, zorder=2)
    if curve.predicted is not None:
        ax.plot(x, curve.predicted / factor, color=HELD if curve.held else MODEL, linewidth=1.5, zorder=3)
    ax.set_title(f"{curve.recording}{' (held out)' if curve.held else ''}", loc="left", fontsize=9.5, color=INK)
    ax.set_xlabel(across)
    ax.set_ylabel(f"{curve.channel.replace('_', ' ')}{label(unit)}")


def _bands(found: Fit) -> dict[tuple[str, str], np.ndarray]:
    """Half widths by (recording, channel label)."""
    problem, spread = found.problem, found.uncertainty
    std = found.curve_std
    if problem.predictor.name == "homogeneous":
        std = prediction_std(problem, found.values, spread, tuple(found.predictions))
    return {key: half_width(values, level, spread) for key, values, level in _labelled(found, std)}


def _labelled(found: Fit, series):
    """((recording, channel label), one column, noise level) of arrays by recording and channel; a cloud of markers
    by what is given of its mean way, one number a sample."""
    levels = found.problem.noise.std
    of_channel = {key.split("/")[-1]: s for key, s in levels.items()}
    for name, channels in series.items():
        measured = found.problem.predictor.sample.recordings[name].channels
        for channel, values in channels.items():
            values, kind = np.asarray(values, float), np.asarray(measured[channel].values)
            level = levels.get(f"{name}/{channel}") or measured[channel].noise_std or of_channel.get(channel)
            if kind.ndim == 3:
                level = None if level is None else level / np.sqrt(kind.shape[1])
            for k, shown in components(channel, kind) if values.ndim < 3 else ():
                yield (name, shown), values if values.ndim == 1 else values[:, k], level


def _bare(found: Fit) -> dict[tuple[str, str], np.ndarray]:
    """Predictions with the amplitudes of all effects at zero, by (recording, channel label)."""
    predictor = found.problem.predictor
    model = predictor.model
    if not model.effects or predictor.name != "homogeneous":
        return {}
    amplitudes = [f"effects.{e.name}.{a}" for e in model.effects for a in e.amplitudes]
    off = {p: v for p, v in found.values.items() if not any(p == a or p.startswith(f"{a}.") for a in amplitudes)}
    finer = predictor.of(tuple(found.predictions)).predict(off)
    series = {name: {c: np.asarray(ch.values) for c, ch in r.channels.items()} for name, r in finer.items()}
    return {key: values for key, values, _ in _labelled(found, series)}

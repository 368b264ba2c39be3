"""The misfit by frequency: breathing, pulse and mains stand out as lines, missing physics as a slope."""

from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from tissuejax.diagnosis.periodogram import periodogram
from tissuejax.diagnosis.result import Diagnosis
from tissuejax.report.plot import FAINT, INK, MODEL, Plot, grid, legend_below


class DiagnosisSpectrum(Plot):
    """Power of a sinusoid in the residual over noise, summed over recordings, base and chosen model."""

    name: ClassVar[str] = "spectrum"
    subject: ClassVar[type] = Diagnosis
    order: ClassVar[int] = 30

    def prepare(self, subject: Diagnosis) -> dict | None:
        """Frequencies and power before and after, for the scalar channels."""
        bench = subject.search.bench
        out = []
        for r in (subject.search.empty, subject.verdict.chosen):
            z = (bench.y - r.prediction) / bench.sigma
            series = [(s.time - s.time[0], z[s.rows]) for s in bench.segments if "marker" not in s.component]
            f, power, _ = periodogram(series)
            if not len(f):
                return None
            out.append(power / (2 * len(series)))
        return {"frequency": f, "before": out[0], "after": out[1]}

    def caption(self, data: dict) -> str:
        """The strongest line."""
        strongest = data["frequency"][int(np.argmax(data["before"]))]
        return (
            "Periodogram of the residual over noise (1 is white noise; correlated noise rises to the left). The base "
            f"model's strongest component has a period of {1 / strongest:.3g} s. Grey: base model; blue: with the "
            "effects of the verdict."
        )

    def draw(self, data: dict) -> Figure:
        """Both spectra on logarithmic scales."""
        figure, (ax,) = grid(1, height=2.9)
        ax.loglog(data["frequency"], np.maximum(data["before"], 1e-2), color=FAINT, linewidth=1, label="base model")
        ax.loglog(data["frequency"], np.maximum(data["after"], 1e-2), color=MODEL, linewidth=0.9, label="with effects")
        ax.axhline(1, color=INK, linewidth=0.6, linestyle=":", label="white noise")
        ax.set_xlabel("frequency (Hz)")
        ax.set_ylabel("power / that of white noise")
        legend_below(figure, [ax])
        return figure

"""What is still missing once the verdict's physics is in: the remainder as smooth functions of drive, rate and time."""

from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from tissuejax.diagnosis.remainder import Remainder, remainder
from tissuejax.diagnosis.result import Diagnosis
from tissuejax.report.plot import FAINT, HELD, INK, MODEL, Plot, clock, grid
from tissuejax.report.scales import display, label

SMOOTH_IN = ("drive", "rate", "time")


class DiagnosisRemainder(Plot):
    """Three curves of the channel that is missed most, over its noise."""

    name: ClassVar[str] = "remainder"
    subject: ClassVar[type] = Diagnosis
    order: ClassVar[int] = 35

    def prepare(self, subject: Diagnosis) -> tuple[Remainder, float, str, tuple[str, ...], str] | None:
        """The remainder of the worst scalar channel, its noise, the name of the drive, and what was held out."""
        bench, left = subject.search.bench, subject.verdict.chosen.prediction
        scalar = [s for s in bench.segments if "marker" not in s.component]
        if not scalar:
            return None
        z = ((bench.y - left) / bench.sigma) ** 2
        worst = max(scalar, key=lambda s: float(np.mean(z[s.rows])))
        found = remainder(bench, left, worst.channel, worst.component)
        if found.share["noise"] > 0.9:
            return None
        sigma = np.concatenate([bench.sigma[s.rows] for s in scalar if s.label == worst.label])
        names = {s.drive_name for s in scalar if s.label == worst.label}
        drive = f"{worst.drive_name}{label(worst.drive_unit)}" if len(names) == 1 else "stretch - 1, or shear"
        return found, float(np.median(sigma)), drive, bench.held_out, clock(worst.timed)

    def caption(self, data: tuple[Remainder, float, str, tuple[str, ...], str]) -> str:
        """How much is smooth and where to look first."""
        found, *_ = data
        smooth = {k: found.share[k] for k in SMOOTH_IN}
        first = max(smooth, key=smooth.get)
        return (
            f"What the verdict leaves, as a smooth function (no physics): {1 - found.share['noise']:.0%} of its "
            f"squares are smooth, {smooth[first]:.0%} a function of {first}. The pale band is twice the noise. All "
            "numbers are in remainder.json."
        )

    def draw(self, data: tuple[Remainder, float, str, tuple[str, ...], str]) -> Figure:
        """Drive, rate, time (a curve for each recording)."""
        found, sigma, drive, held, passed = data
        figure, axes = grid(3, height=2.6, sharey=True)
        largest = max(float(np.max(np.abs(c["value"]), initial=0.0)) for c in found.curves.values())
        factor, unit = display(found.unit, max(largest, sigma))
        for ax in axes:
            ax.axhspan(-2 * sigma / factor, 2 * sigma / factor, color="#e9edf0", zorder=0)
            ax.axhline(0, color=INK, linewidth=0.5)
        for ax, name in zip(axes, ("drive", "rate"), strict=False):
            curve = found.curves[name]
            ax.plot(curve["x"], np.array(curve["value"]) / factor, color=MODEL, linewidth=1.4)
        fastest = float(np.max(np.abs(found.curves["rate"]["x"]))) or 1.0
        axes[1].set_xscale("symlog", linthresh=1e-3 * fastest)
        axes[1].set_xticks([-fastest, 0.0, fastest], [f"{-fastest:.2g}", "0", f"{fastest:.2g}"])
        axes[1].minorticks_off()
        for name, curve in found.curves.items():
            if name.startswith("time/"):
                colour = HELD if name.removeprefix("time/") in held else FAINT
                axes[2].plot(curve["x"], np.array(curve["value"]) / factor, color=colour, linewidth=1.2)
        axes[0].set_xlabel(drive)
        axes[1].set_xlabel("its rate (m/s)" if drive.endswith("(m)") else "its rate (1/s)")
        axes[2].set_xlabel(f"{passed}; a curve a recording, orange held out")
        axes[0].set_ylabel(f"{found.channel.replace('_', ' ')}{label(unit)}")
        return figure

"""Markers on the surface: which of them the model misses, and in which direction, under the deepest probe."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.remainder import PlaceRemainder, over_places
from tissuejax.diagnosis.result import Diagnosis
from tissuejax.report.plot import INK, Plot, grid
from tissuejax.report.scales import display

MOST_MARKERS = 3  # recordings shown, those missed most


@dataclass(frozen=True)
class Seen:
    """One recording's markers: what is left of them before and after, five times their noise, residual over noise."""

    recording: str
    held: bool
    before: PlaceRemainder
    after: PlaceRemainder
    noise: float
    chi_before: np.ndarray
    chi_after: np.ndarray


def per_marker(bench: Bench, prediction: np.ndarray, recording: str, markers: tuple[int, ...]) -> np.ndarray:
    """Root mean square residual over noise of each marker."""
    z = ((bench.y - prediction) / bench.sigma) ** 2
    mine = [s for s in bench.segments if s.recording == recording and s.component.startswith("marker")]
    parts = {m: np.concatenate([z[s.rows] for s in mine if int(s.component.split()[1]) == m]) for m in markers}
    return np.array([np.sqrt(np.mean(parts[m])) for m in markers])


class DiagnosisMarkers(Plot):
    """Seen from above: base model above, verdict below; colour is residual over noise, arrows its direction."""

    name: ClassVar[str] = "markers"
    subject: ClassVar[type] = Diagnosis
    order: ClassVar[int] = 24

    def prepare(self, subject: Diagnosis) -> list[Seen] | None:
        """The recordings whose markers are missed most."""
        bench, base, chosen = subject.search.bench, subject.search.empty, subject.verdict.chosen
        found = []
        for name in (*bench.fitted, *bench.held_out):
            before = over_places(bench, base.prediction, name)
            after = over_places(bench, chosen.prediction, name)
            if before is None or after is None:
                continue
            chi = [per_marker(bench, r.prediction, name, before.markers) for r in (base, chosen)]
            sigma = [bench.sigma[s.rows] for s in bench.segments if s.recording == name and "marker" in s.component]
            noise = 5 * float(np.median(np.concatenate(sigma)))
            found.append(Seen(name, name in bench.held_out, before, after, noise, *chi))
        found.sort(key=lambda s: -float(np.mean(s.chi_before**2)))
        return sorted(found[:MOST_MARKERS], key=lambda s: s.held) or None

    def caption(self, data: list[Seen]) -> str:
        """Which marker is worst."""
        worst = max(data, key=lambda s: float(s.chi_before.max()))
        at = int(np.argmax(worst.chi_before))
        return (
            "Markers seen from above. Colour: RMS residual over noise (1 is noise alone); arrows: "
            "measured minus predicted under the deepest probe, the same scale in all panels. Upper row the base model, "
            f"lower row with the effects of the verdict. Worst is marker {worst.before.markers[at]} in "
            f"{worst.recording}: {worst.chi_before[at]:.1f} times the noise before, {worst.chi_after[at]:.1f} after."
        )

    def draw(self, data: list[Seen]) -> Figure:
        """Two rows of maps."""
        figure, axes = grid(2 * len(data), columns=len(data), width=max(4.2 * len(data), 5.0), height=3.2)
        top = max(float(s.chi_before.max()) for s in data)
        longest = max(float(np.max(np.linalg.norm(s.before.remainder[:, :2], axis=1))) for s in data)
        longest = max(longest, max(s.noise for s in data)) or 1.0  # what is noise has short arrows
        span = max(float(np.ptp(s.before.place[:, :2], axis=0).max()) for s in data) or 1.0
        factor, unit = display("m", longest)
        for i, s in enumerate(data):
            for ax, left, chi, when in (
                (axes[i], s.before, s.chi_before, "base model"),
                (axes[i + len(data)], s.after, s.chi_after, "verdict"),
            ):
                x, y = 1e3 * left.place[:, 0], 1e3 * left.place[:, 1]
                dots = ax.scatter(x, y, c=chi, s=26, cmap="YlOrRd", vmin=0, vmax=max(top, 2.0), edgecolors=INK, lw=0.3)
                arrow = 1e3 * 0.15 * span / longest * left.remainder[:, :2]
                ax.quiver(x, y, *arrow.T, angles="xy", scale_units="xy", scale=1, width=4e-3, color=INK)
                held = " (held out)" if s.held else ""
                ax.set_title(f"{s.recording}{held}: {when}", loc="left", fontsize=9)
                ax.margins(0.12)
                ax.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
        figure.colorbar(dots, ax=axes, label="residual / noise", shrink=0.6)
        axes[0].text(
            0,
            1.12,
            f"an arrow of 15 % of the width is {longest / factor:.2g} {unit}",
            transform=axes[0].transAxes,
            fontsize=8,
        )
        return figure

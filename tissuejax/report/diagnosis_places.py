"""Where the misfit is: by recording, by phase of the protocol, by stretch or depth."""

from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from tissuejax.diagnosis.locate import PHASES, phases, rest_value
from tissuejax.diagnosis.result import Diagnosis
from tissuejax.report.plot import FAINT, HELD, INK, MODEL, Plot, grid

BINS = 16


class DiagnosisPlaces(Plot):
    """Mean squared residual over noise of the base model, and of the chosen one, in three cuts."""

    name: ClassVar[str] = "where"
    subject: ClassVar[type] = Diagnosis
    order: ClassVar[int] = 20

    def prepare(self, subject: Diagnosis) -> dict:
        """For each cut: labels (or bin centres), chi-square per sample before and after."""
        bench = subject.search.bench
        segments = [s for s in bench.segments if "marker" not in s.component]
        out = {}
        squares = [
            ((bench.y - r.prediction) / bench.sigma) ** 2 for r in (subject.search.empty, subject.verdict.chosen)
        ]
        names = list(dict.fromkeys(s.recording for s in segments))
        out["recording"] = (
            names,
            *(
                [float(np.mean(np.concatenate([z[s.rows] for s in segments if s.recording == n]))) for n in names]
                for z in squares
            ),
        )
        which = np.concatenate([phases(s) for s in segments])
        flat = [np.concatenate([z[s.rows] for s in segments]) for z in squares]
        seen = [i for i in range(4) if np.any(which == i)]
        out["phase"] = ([PHASES[i] for i in seen], *([float(z[which == i].mean()) for i in seen] for z in flat))
        mixed = len({s.drive_name for s in segments}) > 1  # stretch and shear meet as strains
        drive = np.concatenate([s.drive - (rest_value(s) if mixed else 0.0) for s in segments])
        edges = np.linspace(drive.min(), drive.max() + 1e-12, BINS + 1)
        at = np.clip(np.digitize(drive, edges) - 1, 0, BINS - 1)
        full = [i for i in range(BINS) if np.sum(at == i) > 5]
        centres = [float(0.5 * (edges[i] + edges[i + 1])) for i in full]
        out["drive"] = (centres, *([float(z[at == i].mean()) for i in full] for z in flat))
        factor, unit = (1e-3, " (mm)") if segments[0].drive_unit == "m" else (1.0, "")
        out["drive"] = ([c / factor for c in centres], *out["drive"][1:])
        out["drive_name"] = "stretch - 1, or shear" if mixed else segments[0].drive_name + unit
        out["rest"] = 0.0 if mixed else rest_value(segments[0])
        out["held"] = list(bench.held_out)
        return out

    def caption(self, data: dict) -> str:
        """Where it is worst."""
        names, before, _ = data["phase"]
        worst = names[int(np.argmax(before))]
        return (
            f"Mean squared residual over noise (1 is noise alone). The base model misses most during {worst}. "
            "Grey: base model; blue: with the effects of the verdict."
        )

    def draw(self, data: dict) -> Figure:
        """Three panels on logarithmic scales."""
        figure, axes = grid(3, height=2.7)
        for ax, cut in zip(axes[:2], ("recording", "phase"), strict=True):
            labels, before, after = data[cut]
            x = np.arange(len(labels))
            ax.bar(x - 0.2, before, 0.38, color=FAINT)
            ax.bar(x + 0.2, after, 0.38, color=[HELD if n in data["held"] else MODEL for n in labels])
            crowded = len(labels) > 5 or max(map(len, labels)) > 11
            ax.set_xticks(x, labels, rotation=40 if crowded else 0, ha="right" if crowded else "center")
            ax.set_xlabel(cut)
        centres, before, after = data["drive"]
        axes[2].plot(centres, before, "o-", color=FAINT, markersize=3.5)
        axes[2].plot(centres, after, "o-", color=MODEL, markersize=3.5)
        axes[2].axvline(data["rest"], color=INK, linewidth=0.5)
        axes[2].set_xlabel(data["drive_name"])
        for ax in axes:
            ax.set_yscale("log")
            ax.axhline(1, color=INK, linewidth=0.6, linestyle=":")
        axes[0].set_ylabel("chi² per sample")
        colours = {"base model": FAINT, "with effects": MODEL} | (
            {"with effects, held out": HELD} if data["held"] else {}
        )
        handles = [*(Patch(color=c) for c in colours.values()), Line2D([], [], color=INK, linewidth=0.6, linestyle=":")]
        names = [*colours, "noise alone"]
        figure.legend(handles, names, loc="outside lower center", ncols=len(names), frameon=False, fontsize=8)
        return figure

"""The page of a cut: the record with its prediction or its teeth, toughness along the path, and the numbers."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tissuejax.fitting.cut_result import CutFit
from tissuejax.fitting.sawtooth import SECTIONS, Sawtooth
from tissuejax.recordings.recording import Sample
from tissuejax.report import cut_fit
from tissuejax.report.page import png, render, write_drawn
from tissuejax.report.plot import MEASURED, MODEL, SERIES, grid
from tissuejax.storage import write_json, write_text


def write_cut(
    out: Path, record: Mapping, teeth: Mapping[str, Sawtooth], sample: Sample, found: CutFit | None, field=None
) -> dict[str, Path]:
    """result.json, report.html and figures of an identification or a fit (of a fit its curves as CSV and its parameters
    as LaTeX too); paths by name."""
    pictures = []
    if teeth:
        pictures.append(
            ("teeth", "Filtered force against the motion, the segments' polynomials and their peaks.", _saw(teeth))
        )
        text = "Strength by section length, and energy, tooth by tooth (the source's way)."
        pictures.append(("strength", text, _strengths(teeth)))
    if found is not None:
        text = "Force against the motion over time and over the place of the edge, and what the fit leaves of it."
        if found.by == "balance":
            text += " What is at the entry, or just after a turn, takes no part in a fit by the balance of energies."
        pictures.append(("record", text, cut_fit.overlay(found)))
    if field is not None:
        pictures.append(("along", "Toughness along the path.", _field(field)))
    written = {"result": write_json(out / "result.json", record)}
    drawn = [{"name": n, "caption": text, "png": png(f), "figure": f} for n, text, f in pictures]
    written |= write_drawn(drawn, out)
    lines, said = ([], []) if found is None else (cut_fit.rows(found), cut_fit.sentences(found))
    page = render("cutting.html.j2", title=f"{sample.name}: cut", said=said, rows=lines, figures=drawn)
    written["page"] = write_text(out / "report.html", page)
    if found is not None:
        written["curves"] = cut_fit.write_curves(found, out / "curves.csv")
        written["table"] = cut_fit.write_latex(found, out / "parameters.tex")
    return written


def _saw(teeth):
    figure, axes = grid(len(teeth), 1, 9.0, 2.9)
    for ax, (name, found) in zip(axes, teeth.items(), strict=True):
        ax.plot(found.time, found.force[:, 0], color=MEASURED, linewidth=1, label="x, filtered")
        ax.plot(found.time, found.force[:, 1], color=SERIES[2], linewidth=0.8, label="z, filtered")
        for tooth, (x, _) in zip(found.teeth, found.fits, strict=True):
            ax.plot(found.time[tooth.first : tooth.peak + 1], x, color=MODEL, linewidth=1.6)
        peaks = [t.peak for t in found.teeth]
        ax.plot(found.time[peaks], found.force[peaks, 0], "o", color=SERIES[1], markersize=4, label="fracture")
        ax.set(xlabel="time (s)", ylabel="force (N)", title=name)
        ax.legend(fontsize=7, frameon=False)
    return figure


def _strengths(teeth):
    figure, axes = grid(2, 2, 9.0, 3.0)
    wide = 0.8 / len(teeth)
    for i, (name, found) in enumerate(teeth.items()):
        n, color = np.arange(1, len(found.teeth) + 1), SERIES[i % len(SERIES)]
        for s, mark in zip(SECTIONS, "o^x", strict=True):
            strong = [1e-3 * t.strength[s][0] for t in found.teeth]
            axes[0].plot(
                n, strong, f"{mark}-", color=color, ms=5, lw=0.8, fillstyle="none", label=f"{name}, {1e3 * s:g}"
            )
        height = [t.per_area for t in found.teeth]
        axes[1].bar(n + (i - (len(teeth) - 1) / 2) * wide, height, 0.9 * wide, color=color, label=name)
    axes[0].set(xlabel="tooth", ylabel="normal strength (kPa)")
    axes[1].set(xlabel="tooth", ylabel="energy over area (J/m²)")
    most = max(len(found.teeth) for found in teeth.values())
    for ax in axes:
        ax.set_xticks(np.arange(1, most + 1, max(1, most // 10)))
    axes[0].legend(fontsize=6, frameon=False, title="section of the edge, mm", title_fontsize=6)
    axes[1].legend(fontsize=7, frameon=False)
    return figure


def _field(field):
    figure, axes = grid(1, 1, 7.0, 2.7)
    axes[0].plot(1e3 * field[:, 0], field[:, 1], "o-", color=MODEL, markersize=4)
    axes[0].set(xlabel="along the path (mm)", ylabel="toughness (J/m²)")
    axes[0].set_ylim(0, 1.1 * field[:, 1].max())
    return figure

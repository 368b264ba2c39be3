"""The page of a cut: the record with its prediction or its teeth, toughness along the path, and the numbers."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tissuejax.fitting.cut_result import CutFit
from tissuejax.fitting.sawtooth import SECTIONS, Sawtooth
from tissuejax.recordings.recording import Sample
from tissuejax.report.page import png, render
from tissuejax.report.plot import INK, MEASURED, MODEL, SERIES, grid
from tissuejax.storage import write_bytes, write_json, write_text


def write_cut(
    out: Path, record: Mapping, teeth: Mapping[str, Sawtooth], sample: Sample, found: CutFit | None, field=None
) -> dict[str, Path]:
    """result.json, report.html and figures of an identification or a fit; paths by name."""
    pictures = []
    if teeth:
        pictures.append(
            ("teeth", "Filtered force against the motion, the segments' polynomials and their peaks.", _saw(teeth))
        )
        text = "Strength by section length, and energy, tooth by tooth (the source's way)."
        pictures.append(("strength", text, _strengths(teeth)))
    if found is not None:
        pictures.append(
            ("record", "Force against the motion: recorded and predicted at the estimate.", _overlay(found))
        )
    if field is not None:
        pictures.append(("along", "Toughness along the path.", _field(field)))
    written = {"result": write_json(out / "result.json", record)}
    shown = []
    for name, caption, figure in pictures:
        picture = png(figure)
        written[name] = write_bytes(out / f"{name}.png", picture)
        shown.append({"name": name, "caption": caption, "png": picture})
    lines = [] if found is None else _rows(found)
    said = "" if found is None else " ".join(f"Take care: {w}." for w in found.warnings)
    page = render("cutting.html.j2", title=f"{sample.name}: cut", text=said, rows=lines, figures=shown)
    written["page"] = write_text(out / "report.html", page)
    return written


def _rows(found: CutFit) -> list[dict]:
    declared, rows = found.predictor.model.parameters, []
    for path, std in found.std.items():
        low, high = found.interval[path]
        why = found.unidentified.get(path)
        note = f"not identified: {why}" if why else f"{low:.4g} to {high:.4g}"
        row = {"path": path, "value": f"{found.values[path]:.4g}", "std": f"{std:.2g}", "unit": declared[path].unit}
        rows.append(row | {"note": note})
    return rows


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


def _overlay(found: CutFit):
    names = found.predictor.names
    figure, axes = grid(len(names), 1, 9.0, 2.9)
    for ax, name in zip(axes, names, strict=True):
        seen = found.predictor.sample.recordings[name].channels["cutting_force"]
        made = found.predicted[name].channels["cutting_force"]
        ax.plot(seen.time, seen.values, ".", color=MEASURED, markersize=2.5, label="recorded")
        ax.plot(made.time, made.values, color=MODEL, linewidth=1.5, label=f"predicted by {found.by}")
        ax.axhline(0, color=INK, linewidth=0.5)
        ax.set(xlabel="time (s)", ylabel="force (N)", title=name)
        ax.legend(fontsize=7, frameon=False)
    return figure


def _field(field):
    figure, axes = grid(1, 1, 7.0, 2.7)
    axes[0].plot(1e3 * field[:, 0], field[:, 1], "o-", color=MODEL, markersize=4)
    axes[0].set(xlabel="along the path (mm)", ylabel="toughness (J/m²)")
    axes[0].set_ylim(0, 1.1 * field[:, 1].max())
    return figure

"""The page of the study: tables of every part that was run, and the blade's force against its closed form."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tissuejax.report.page import png, render
from tissuejax.storage import write_bytes, write_text


def _recovered(runs: list[dict]) -> Figure:
    """Error of every estimate with its standard error; the first record and the one without an entry, as fitted."""
    figure = Figure(figsize=(10, 5.6), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=(1.25, 1))
    whole = [r for r in runs if r["what"] == "entry included"]
    names = [f"{r['record_h_mm']:.2g} mm, {r['truth'][0]:.0f} Pa\nnoise {r['noise']}, {_signs(r)}" for r in whole]
    for ax, what in zip(left.subplots(1, 3, sharey=True), ("strength", "energy", "friction"), strict=True):
        off, std = ([r[f"{what}_{kind}"] for r in whole] for kind in ("percent", "std_percent"))
        ax.errorbar(off, range(len(whole)), xerr=std, fmt="o", markersize=4, capsize=2, linewidth=1)
        ax.axvline(0, color="0.6", linewidth=0.8)
        ax.set(xlabel=f"{what}: error (%)", yticks=range(len(whole)))
        ax.set_yticklabels(names, fontsize=7)
    left.axes[0].invert_yaxis()
    for ax, r in zip(right.subplots(2, 1), (runs[0], runs[-1]), strict=True):
        at, seen, made = r["record"]
        ax.plot(at, seen, ".", color="0.4", markersize=6, label="record: means over 1 mm of the way")
        ax.plot(at, made, linewidth=1.4, label="fitted")
        ax.set(xlabel="time (s)", ylabel="force (N)")
        ax.set_title(r["what"], fontsize=9)
        ax.legend(frameon=False, fontsize=8, loc="upper left")
    return figure


def _signs(run: dict) -> str:
    """Where a fit began: "- + -" for strength, energy, friction half too low or too high."""
    return " ".join(word[0] for word in run["start"].split() if word[0] in "+-")


def _kept(folder: Path, name: str, caption: str, figure: Figure) -> dict:
    picture = png(figure)
    (folder / "figures").mkdir(exist_ok=True)
    write_bytes(folder / "figures" / f"{name}.png", picture)
    return {"name": name, "caption": caption, "png": picture}


def _curves(curves, xlabel: str, ylabel: str, level: float | None = None, said: str | None = None) -> Figure:
    """Curves of (label, x, y) over each other, and a level to hold them against."""
    figure = Figure(figsize=(8, 3.2), layout="constrained")
    ax = figure.subplots()
    for label, x, y in curves:
        ax.plot(x, y, label=label, linewidth=1.2)
    if level is not None:
        ax.axhline(level, color="k", linewidth=0.8, linestyle="--", label=said)
    ax.set(xlabel=xlabel, ylabel=ylabel)
    ax.legend(frameon=False, fontsize=8)
    return figure


def _means(at, force) -> tuple[np.ndarray, np.ndarray]:
    """Means over 40 samples, 1 mm of the way, and where each stands."""
    return np.asarray(at)[20:-19], np.convolve(force, np.ones(40) / 40, "valid")


def _differences(part: dict) -> list[tuple[str, dict]]:
    """Derivatives against central differences: of a cut that is hardly damped, on a finer mesh, damped as in a fit."""
    named = {"": part, ", elements of 0.5 mm": part.get("finer", {}), ", damped as a fit does": part.get("calm", {})}
    return [(f"derivatives, step by step{more}", some) for more, some in named.items() if "differences" in some]


def write(folder: Path, found: dict) -> Path:
    """report.html and the figures from result.json."""
    tables = []
    for name, part in found.items():
        runs = part.get("runs") if isinstance(part, dict) else None
        runs = runs or [part]
        plain = [k for k, v in runs[0].items() if isinstance(v, int | float | str)]
        rows = [[f"{r[k]:.4g}" if isinstance(r.get(k), float) else r.get(k, "") for k in plain] for r in runs]
        if plain:
            tables.append({"title": name, "columns": [k.replace("_", " ") for k in plain], "rows": rows})
        for title, some in _differences(part):
            rows = [[k, f"{v:.2g}", f"{some['differences_of_means'][k]:.2g}"] for k, v in some["differences"].items()]
            columns = ["parameter and relative step", "derivative against central difference", "of means over 1 mm"]
            tables.append({"title": title, "columns": columns, "rows": rows})
    shown = []
    if "recovery" in found:
        runs = found["recovery"]["runs"]
        figure = _recovered(runs)
        shown += [
            _kept(
                folder,
                "recovery",
                "Records of finer meshes fitted from 50 % off: errors with their standard errors, and two records.",
                figure,
            )
        ]
    if any("series" in r for r in found.get("steady", {}).get("runs", [])):
        runs = found["steady"]["runs"]
        curves = [(f"h {r['h_mm']:g} mm", *r["series"]) for r in runs]
        axes = "travel of the blade (mm)", "force per depth (N/m)"
        figure = _curves(curves, *axes, level=runs[0]["expected_N_m"])
        shown += [_kept(folder, "force", "Force on the blade; dashed: closed form.", figure)]
    if "meshes" in found:
        curves = [(f"h {r['h_mm']:g} mm", *_means(*r["series"])) for r in found["meshes"]["runs"]]
        figure = _curves(curves, "edge of the blade (mm)", "force per depth, over 1 mm (N/m)")
        shown += [_kept(folder, "entry", "A blade goes into an uncut front: three meshes, one law.", figure)]
    if "series" in found.get("source", {}):  # none where the run broke down
        at, against, along = found["source"]["series"]
        curves = [("against the motion", at, against), ("along the blade", at, along)]
        level, said = found["source"]["published_peak_N_m"], "published strength times thickness"
        figure = _curves(curves, "edge of the blade (mm)", "force over depth (N/m)", level, said)
        shown += [_kept(folder, "source", "The source's run with a toughness that its force implies.", figure)]
    page = render("cutting.html.j2", title="Is the cutting simulation right?", tables=tables, figures=shown)
    return write_text(folder / "report.html", page)

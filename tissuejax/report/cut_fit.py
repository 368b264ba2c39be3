"""What a page says and shows of a fit of cuts: a sentence, the numbers, and the record over time and over the way."""

from pathlib import Path

import numpy as np

from tissuejax.estimation.ending import Ending
from tissuejax.fitting.cut_result import ENERGY, FRICTION, ONSET, STRENGTH, CutFit
from tissuejax.report.fit_tables import PARAMETERS
from tissuejax.report.numbers import write_series, write_tabular
from tissuejax.report.plot import INK, MEASURED, MODEL, grid, legend_below
from tissuejax.report.scales import display

CHANNEL = "cutting_force"
NORMAL_95 = 1.96  # standard deviations of the noise in which 95 % of the samples are
CALLED = {
    STRENGTH: "Strength of the faces",
    ENERGY: "Toughness",
    FRICTION: "Friction of the blade",
    ONSET: "Length over which the force sets in, beyond 2 mm",
}


def sentences(found: CutFit) -> list[str]:
    """What was found, in units; what the record can't tell; what to take care of."""
    said = [_told(found)]
    if found.status != Ending.CONVERGED:
        said.append(f"The fit did not converge ({found.status}); the numbers are where it stopped.")
    said += [f"{CALLED.get(p, p)}: not identified: {why}." for p, why in found.unidentified.items()]
    return said + [f"Take care: {w}." for w in found.warnings]


def _told(found: CutFit) -> str:
    parts, told = [], [p for p in found.std if p not in found.unidentified]
    if ENERGY in told:
        low, high = found.interval[ENERGY]
        parts.append(f"the tissue parts at {found.values[ENERGY]:.4g} J/m² (95 %: {low:.4g} to {high:.4g})")
    if STRENGTH in told:
        low, high = found.interval[STRENGTH]
        by, unit = display("Pa", found.values[STRENGTH])
        parts.append(f"its faces hold {found.values[STRENGTH] / by:.4g} {unit} ({low / by:.4g} to {high / by:.4g})")
    if FRICTION in told:
        low, high = found.interval[FRICTION]
        parts.append(f"the blade rubs with a coefficient of {found.values[FRICTION]:.4g} ({low:.4g} to {high:.4g})")
    noise = [found.predictor.sample.recordings[n].channels[CHANNEL].noise_std for n in found.predictor.names]
    parts = parts or ["the record tells none of what was asked"]
    if all(noise):
        parts.append(f"the fit leaves {np.sqrt(found.chi2_per_sample):.3g} times the noise")
    text = "; ".join(parts)
    return text[0].upper() + text[1:] + "."


def rows(found: CutFit) -> list[dict]:
    """A row a parameter: value, standard error, 95 % interval, or why it is not identified; what was given last."""
    declared, out = found.predictor.model.parameters, []
    for path, std in found.std.items():
        low, high = found.interval[path]
        by, unit = display(declared[path].unit, abs(found.values[path]))
        note = "not identified" if path in found.unidentified else f"{low / by:.4g} to {high / by:.4g}"
        mesh = f", {found.numerical[path] / by:.2g} of it the mesh" if found.numerical[path] else ""
        row = {"path": path, "value": f"{found.values[path] / by:.4g}", "std": f"{std / by:.2g}{mesh}"}
        out.append(row | {"unit": unit, "note": note})
    for path in declared:
        if path in found.std or path not in found.values or path.startswith("effects.onset"):
            continue
        by, unit = display(declared[path].unit, abs(found.values[path]))
        missing = path in found.unidentified
        value, note = ("-", "not identified") if missing else (f"{found.values[path] / by:.4g}", "given")
        out.append({"path": path, "value": value, "std": "", "unit": unit, "note": note})
    return out


def series(found: CutFit, name: str) -> dict[str, np.ndarray]:
    """Time (s), place of the edge (m), force against the motion recorded and predicted (N), noise (N; NaN if none)."""
    seen = found.predictor.sample.recordings[name].channels[CHANNEL]
    made, path = found.predicted[name].channels[CHANNEL], found.predictor.paths_of[name]
    time = np.asarray(seen.time, float)
    return {
        "time (s)": time,
        "place (m)": np.interp(time, path.time, path.x),
        "recorded (N)": np.asarray(seen.values, float),
        "predicted (N)": np.interp(time, np.asarray(made.time), np.asarray(made.values)),
        "noise (N)": np.full(len(time), np.nan if seen.noise_std is None else seen.noise_std),
    }


def overlay(found: CutFit):
    """Each record over time and over the place of the edge, and below what the fit leaves of it."""
    names = found.predictor.names
    figure, axes = grid(4 * len(names), 2, 10.0, 2.3)
    for i, name in enumerate(names):
        s = series(found, name)
        time, place, seen, made, noise = s.values()
        by, unit = display("N", float(np.max(np.abs(seen))))
        share = noise if np.isfinite(noise).all() else np.full_like(noise, by)
        left_unit = "times the noise" if share is noise else unit
        for ax, low, x, what in zip(
            axes[4 * i : 4 * i + 2], axes[4 * i + 2 : 4 * i + 4], (time, 1e3 * place), ("time (s)", "edge at (mm)"),
            strict=True,
        ):  # fmt: skip
            if share is noise:
                low_, high = (made - NORMAL_95 * noise) / by, (made + NORMAL_95 * noise) / by
                ax.fill_between(x, low_, high, color=MODEL, alpha=0.18, linewidth=0, label="95 % of the noise")
            ax.plot(x, seen / by, ".", color=MEASURED, markersize=3, label="recorded")
            ax.plot(x, made / by, color=MODEL, linewidth=1.3, label=f"predicted by {found.by}")
            ax.axhline(0, color=INK, linewidth=0.5)
            ax.set(xlabel=what, ylabel=f"force ({unit})", title=name)
            low.plot(x, (seen - made) / share, ".", color=MEASURED, markersize=3)
            low.axhline(0, color=INK, linewidth=0.5)
            low.set(xlabel=what, ylabel=f"left ({left_unit})")
    legend_below(figure, axes[:1])
    return figure


def write_curves(found: CutFit, path: Path) -> Path:
    """The figure's numbers as CSV, SI: one row a sample."""
    return write_series(path, (({"recording": name}, series(found, name)) for name in found.predictor.names))


def write_latex(found: CutFit, path: Path) -> Path:
    r"""A `tabular` of the parameters."""
    with_error = ((r, f"{r['value']} ± {r['std'].split(',')[0]}" if r["std"] else r["value"]) for r in rows(found))
    return write_tabular(path, PARAMETERS, ((r["path"], value, r["note"], r["unit"]) for r, value in with_error))

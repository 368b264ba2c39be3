"""The page of a comparison, its table as CSV and LaTeX, its figures and their curves."""

from pathlib import Path
from typing import Any

from tissuejax.fitting.comparison import Comparison
from tissuejax.report.comparison_curves import ComparisonCurves
from tissuejax.report.comparison_table import lines, numbers, verdict
from tissuejax.report.numbers import headed, write_rows, write_series, write_tabular
from tissuejax.report.page import figures, render, write_drawn
from tissuejax.storage import write_json, write_text

TOLD = ("name", "free", "aic", "bic", "weight", "chi2", "fitted", "held")
COLUMNS = dict(
    zip(
        ("model", "parameters", "AIC - least", "BIC - least", "Akaike weight", "chi² / dof", "RMSE", "RMSE held out"),
        "lrrrrrrr",
        strict=True,
    )
)


def write_comparison(found: Comparison, out: Path, made: dict[str, Any] | None = None) -> dict[str, Path]:
    """comparison.json, comparison.csv and .tex, curves.csv, report.html and the figures; their paths by name."""
    rows, drawn = lines(found), figures(found)
    page = render(
        "comparison.html.j2",
        title=f"Models of {found.sample} compared",
        verdict=verdict(found),
        rows=rows,
        failed=found.failed,
        least_aic=min(r.aic for r in found.rows),
        least_bic=min(r.bic for r in found.rows),
        n=found.best.n,
        figures=drawn,
    )
    return {
        "result": write_json(out / "comparison.json", {"made": made} | found.record()),
        "table": write_rows(out / "comparison.csv", numbers(found)),
        "latex": write_tabular(out / "comparison.tex", COLUMNS, ([row[k] for k in TOLD] for row in rows)),
        **_curves(found, out / "curves.csv"),
        **write_drawn(drawn, out),
        "page": write_text(out / "report.html", page),
    }


def _curves(found: Comparison, path: Path) -> dict[str, Path]:
    """The figure's curves, where the fits are at hand."""
    shown = ComparisonCurves().prepare(found)
    if shown is None:
        return {}
    series = []
    for k, c in enumerate(shown.measured):
        words = {"recording": c.recording, "channel": c.channel, "held out": str(int(c.held))}
        columns = {"time (s)" if c.timed else "sample": c.time}
        columns |= {headed(c.drive_name, c.drive_unit): c.drive} if c.drive is not None else {}
        columns |= {headed("measured", c.unit): c.measured}
        series.append((words, columns | {headed(name, c.unit): of[k] for name, of in shown.predicted.items()}))
    return {"data": write_series(path, series)}  # "curves" is the figure

"""The page of a comparison, its table as CSV and its figures."""

import csv
import io
from pathlib import Path
from typing import Any

from tissuejax.fitting.comparison import Comparison
from tissuejax.report.comparison_table import lines, verdict
from tissuejax.report.page import figures, render
from tissuejax.storage import write_bytes, write_json, write_text


def write_comparison(found: Comparison, out: Path, made: dict[str, Any] | None = None) -> dict[str, Path]:
    """comparison.json, comparison.csv, report.html and the figures; their paths by name."""
    rows, drawn = lines(found), figures(found)
    table = io.StringIO()
    writer = csv.DictWriter(table, list(rows[0]))
    writer.writeheader()
    writer.writerows(rows)
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
        "table": write_text(out / "comparison.csv", table.getvalue()),
        **{f["name"]: write_bytes(out / f"{f['name']}.png", f["png"]) for f in drawn},
        "page": write_text(out / "report.html", page),
    }

"""The page of a campaign."""

from pathlib import Path
from typing import Any

from tissuejax.campaign.run import headline
from tissuejax.report.cohort import Cohort
from tissuejax.report.page import figures, render, write_drawn
from tissuejax.storage import write_text

ROWS = 200  # rows on the page; all are in the table


def write_cohort(rows: list[dict[str, Any]], counts: dict[str, Any], out: Path) -> dict[str, Path]:
    """report.html and the figures; their paths by name."""
    drawn = figures(Cohort(tuple(rows)))
    columns = list(dict.fromkeys(n for row in rows for n in row))
    name = out.parent.name if out.name == "campaign" else out.name  # of a problem file: out/liver/campaign
    page = render(
        "cohort.html.j2", title=f"Campaign {name}", lead=headline(counts), counts=counts, rows=rows[:ROWS],
        columns=columns, most=ROWS, figures=drawn,
    )  # fmt: skip
    return write_drawn(drawn, out) | {"page": write_text(out / "report.html", page)}

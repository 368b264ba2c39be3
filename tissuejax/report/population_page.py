"""The page of a population, its figure and its numbers."""

from pathlib import Path

from tissuejax.campaign.population import Population
from tissuejax.report.page import figures, render
from tissuejax.storage import write_bytes, write_json, write_text


def write_population(found: Population, out: Path) -> dict[str, Path]:
    """population.json, report.html and the figure; their paths by name."""
    drawn, record = figures(found), found.record()
    page = render("population.html.j2", title=f"A population of {record['specimens']} specimens", record=record,
                  paths=found.of.paths, units=dict(zip(found.of.paths, found.of.units, strict=False)),
                  figures=drawn)  # fmt: skip
    return {
        "numbers": write_json(out / "population.json", record),
        **{f["name"]: write_bytes(out / f"{f['name']}.png", f["png"]) for f in drawn},
        "page": write_text(out / "report.html", page),
    }

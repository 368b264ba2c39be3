"""The page of a population, its figure, its numbers and the table of its specimens."""

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np

from tissuejax.campaign.population import Population
from tissuejax.report.page import figures, render, write_drawn
from tissuejax.report.population import intervals, shown_in
from tissuejax.report.scales import ratios
from tissuejax.storage import write_json, write_text


def write_population(found: Population, out: Path) -> dict[str, Path]:
    """population.json, specimens.csv, report.html and the figure; their paths by name."""
    drawn, record, rows = figures(found), found.record(), specimens(found)
    page = render("population.html.j2", title=f"A population of {record['specimens']} specimens", record=record,
                  parameters=parameters(found, record), specimens=rows, figures=drawn)  # fmt: skip
    return {
        "numbers": write_json(out / "population.json", record),
        "specimens": write_text(out / "specimens.csv", _table(found, rows)),
        **write_drawn(drawn, out),
        "page": write_text(out / "report.html", page),
    }


def specimens(found: Population) -> list[dict[str, Any]]:
    """One row a specimen: name, group, what makes its fit suspect, and of every parameter the value by itself and in
    the population with their ends of 95 %, SI ("SI") and as shown ("separate", "population")."""
    of, units = found.of, shown_in(found.of)
    separate, shrunken = intervals(found)
    return [
        {
            "sample": name,
            "group": of.groups[i] if of.groups else "",
            "suspect": of.suspect[i] if of.suspect else "",
            "SI": [(*separate[i, :, k].tolist(), *shrunken[i, :, k].tolist()) for k in range(len(of.paths))],
            "values": [
                {"separate": _span(separate[i, :, k] / f), "population": _span(shrunken[i, :, k] / f)}
                for k, (f, _) in enumerate(units)
            ],
        }
        for i, name in enumerate(of.samples)
    ]


def parameters(found: Population, record: dict[str, Any]) -> list[dict[str, str]]:
    """Rows of the table of typical values and spreads, in words: one unit a family, spreads as per cent or a factor."""
    rows = []
    for path, (factor, unit) in zip(found.of.paths, shown_in(found.of), strict=True):

        def spread(of: dict[str, Any], path=path, factor=factor) -> str:
            ends = [of["median"], *of["95 %"]]
            if record["logarithm"][path]:
                return ratios(*ends)
            return _span(np.array(ends) / factor)

        pooled = [v / factor for v in record["pooled"][path]]
        row = {"path": path, "unit": "" if unit == "1" else unit, "pooled": f"{pooled[0]:.4g} ± {pooled[1]:.2g}"}
        for name in ("typical", "new_specimen"):
            of = record[name][path]
            row[name] = _span(np.array([of["median"], *of["95 %"]]) / factor)
        row["between_specimens"] = spread(record["between_specimens"][path])
        if record["groups"]:
            row["between_groups"] = spread(record["between_groups"][path])
        rows.append(row)
    return rows


def _span(value: np.ndarray) -> str:
    """(value, low, high) as a text."""
    return "{:.4g} ({:.4g} to {:.4g})".format(*value)


def _table(found: Population, rows: list[dict[str, Any]]) -> str:
    of, text = found.of, io.StringIO()
    heads = [
        f"{path} {what}{f' ({unit})' if unit != '1' else ''}"
        for path, unit in zip(of.paths, of.units or ("1",) * len(of.paths), strict=True)
        for what in (f"{end}{kind}" for kind in ("separate", "population") for end in ("", "low ", "high "))
    ]
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["sample", "group", "suspect", *heads])
    writer.writerows([r["sample"], r["group"], r["suspect"], *(v for one in r["SI"] for v in one)] for r in rows)
    return text.getvalue()

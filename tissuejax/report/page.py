"""A self-contained page: text, tables and figures in one HTML file that a colleague can read and keep."""

import base64
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2
from matplotlib.figure import Figure

from tissuejax import report as package
from tissuejax.families import members
from tissuejax.fitting.advice import numerics_sentence, suspect
from tissuejax.fitting.result import Fit
from tissuejax.report import sentences
from tissuejax.report.fit_tables import write_curves, write_latex
from tissuejax.report.plot import Plot
from tissuejax.storage import write_bytes, write_figure, write_json, write_text

DPI = 130
VECTOR = ("svg", "pdf")


def plots(subject: Any) -> list[Plot]:
    """All plots that picture this kind of subject, in the order of a page."""
    kinds = [kind for kind in members(package, Plot).values() if isinstance(subject, kind.subject)]
    return [kind() for kind in sorted(kinds, key=lambda k: (k.order, k.name))]


def figures(subject: Any) -> list[dict[str, Any]]:
    """Name, caption, PNG and the figure itself of every plot that has something to show."""
    found = []
    for plot in plots(subject):
        data = plot.prepare(subject)
        if data is not None:
            figure = plot.draw(data)
            found.append({"name": plot.name, "caption": plot.caption(data), "png": png(figure), "figure": figure})
    return found


def png(figure: Figure) -> bytes:
    """A figure as PNG. It is laid out once, before it is drawn: what has a layout engine matplotlib draws twice, and
    in every format anew."""
    figure.set_dpi(DPI)
    if engine := figure.get_layout_engine():
        engine.execute(figure)
    figure.set_layout_engine(None)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI)
    return buffer.getvalue()


def write_drawn(drawn: list[dict[str, Any]], out: Path) -> dict[str, Path]:
    """Figures as PNG, for papers as SVG and PDF in the subfolder `print`: paths by name, and by name and format."""
    return {f["name"]: write_bytes(out / f"{f['name']}.png", f["png"]) for f in drawn} | {
        f"{f['name']}.{kind}": write_figure(out / "print" / f"{f['name']}.{kind}", f["figure"])
        for f in drawn
        for kind in VECTOR
    }


def render(template: str, **content: Any) -> str:
    """A page from a template of this room; figures go in as base64."""
    loader = jinja2.FileSystemLoader(Path(__file__).parent)
    environment = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.filters["base64"] = lambda data: base64.b64encode(data).decode()
    return environment.get_template(template).render(**content)


def write_fit(found: Fit, out: Path, pictures: bool = True) -> dict[str, Path]:
    """result.json, report.html, one PNG a figure, curves.csv, parameters.tex, and the figures as SVG and PDF.

    Args:
        found: the fit.
        out: folder, made if missing.
        pictures: False leaves figures and page out (many fits in a row).

    Returns:
        Paths by name: "result", "page", "curves", "table", and the figures by name and by name and format.
    """
    written = {"result": write_json(out / "result.json", found.record())}
    if not pictures:
        return written
    drawn = figures(found)
    written |= write_drawn(drawn, out)
    page = render(
        "fit.html.j2",
        title=f"Fit of {found.problem.predictor.sample.name}",
        found=found,
        record=found.record(),
        summary=sentences.summary(found),
        steps=sentences.next_steps(found),
        suspect=suspect(found),
        parameters=sentences.table(found),
        errors=sentences.errors(found),
        sites=sentences.sites(found),
        numerics=numerics_sentence(found),
        figures=drawn,
    )
    written["page"] = write_text(out / "report.html", page)
    written["curves"] = write_curves(found, out / "curves.csv")
    written["table"] = write_latex(found, out / "parameters.tex")
    return written


def write_figures(subject: Any, out: Path) -> Mapping[str, Path]:
    """PNG, SVG and PDF of every figure of any subject that has plots."""
    return write_drawn(figures(subject), out)

"""The data of a fit's figures as CSV, and its parameters as a LaTeX table."""

import csv
import io
from pathlib import Path

import numpy as np

from tissuejax.fitting.result import Fit
from tissuejax.report import sentences
from tissuejax.report.fit_overlay import FitOverlay
from tissuejax.storage import write_text

COLUMNS = ("recording", "channel", "unit", "held out", "time (s)", "drive", "measured", "model", "band", "effects off")
SPECIAL = {"_": r"\_", "%": r"\%", "&": r"\&", "#": r"\#", "±": r"$\pm$", "^": r"\^{}"}


def write_curves(found: Fit, path: Path) -> Path:
    """One row a sample of every series in the first figure, SI: measured, model, half width of the 95 % band."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    for shown in FitOverlay().prepare(found):
        c = shown.curve
        empty = np.full(len(c.time), np.nan)
        columns = (c.time, c.drive, c.measured, c.predicted, shown.band, shown.bare)
        for numbers in zip(*(empty if x is None else x for x in columns), strict=True):
            cells = ["" if not np.isfinite(x) else f"{x:.9g}" for x in numbers]
            writer.writerow([c.recording, c.channel, c.unit, int(c.held), *cells])
    return write_text(path, text.getvalue())


def write_latex(found: Fit, path: Path) -> Path:
    r"""A `tabular` of the parameters: value, standard error, 95 % interval, unit; fixed ones say so."""
    lines = [r"\begin{tabular}{lrrl}", r"parameter & value & 95\,\% interval & unit \\ \hline"]
    for row in sentences.table(found):
        cells = [row["path"], row["value"], row["interval"] or row["note"], row["unit"]]
        lines.append(" & ".join(map(escaped, cells)) + r" \\")
    return write_text(path, "\n".join([*lines, r"\end{tabular}"]) + "\n")


def escaped(text: str) -> str:
    """Text for LaTeX."""
    return "".join(SPECIAL.get(c, c) for c in text)

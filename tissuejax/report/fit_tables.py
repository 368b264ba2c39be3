"""The data of a fit's figures as CSV, and its parameters as a LaTeX table."""

from pathlib import Path

from tissuejax.fitting.result import Fit
from tissuejax.report import sentences
from tissuejax.report.fit_overlay import FitOverlay, Shown
from tissuejax.report.numbers import HALF, headed, write_series, write_tabular

PARAMETERS = {"parameter": "l", "value": "r", "95 % interval": "r", "unit": "l"}


def write_curves(found: Fit, path: Path) -> Path:
    """One row a sample of every series in the first figure, SI: measured, model, half-width of the 95 % band."""
    return write_series(path, map(_series, FitOverlay().prepare(found)))


def _series(shown: Shown):
    c = shown.curve
    words = {"recording": c.recording, "channel": c.channel, "held out": str(int(c.held))}
    columns = {"time (s)" if c.timed else "sample": c.time}
    columns |= {headed(c.drive_name, c.drive_unit): c.drive} if c.drive is not None else {}
    made = {"measured": c.measured, "model": c.predicted, HALF: shown.band, "effects off": shown.bare}
    return words, columns | {headed(name, c.unit): values for name, values in made.items() if values is not None}


def write_latex(found: Fit, path: Path) -> Path:
    r"""A `tabular` of the parameters: value, standard error, 95 % interval, unit; fixed ones say so."""
    rows = ((r["path"], r["value"], r["interval"] or r["note"], r["unit"]) for r in sentences.table(found))
    return write_tabular(path, PARAMETERS, rows)

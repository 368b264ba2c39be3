"""The data of a diagnosis' first figure as CSV, and its parameters as a LaTeX table."""

from pathlib import Path

from tissuejax.diagnosis.result import Diagnosis
from tissuejax.report import diagnosis_sentences as sentences
from tissuejax.report.diagnosis_curves import Curve, DiagnosisCurves
from tissuejax.report.fit_tables import PARAMETERS
from tissuejax.report.numbers import HALF, headed, write_series, write_tabular


def write_curves(found: Diagnosis, path: Path) -> Path:
    """One row a sample of every series in the first figure, SI: measured, base, improved, half-width of the band."""
    return write_series(path, map(_series, DiagnosisCurves().prepare(found)))


def _series(c: Curve):
    name = c.title.removesuffix(" (held out)")
    words = {"recording": name, "channel": c.channel, "held out": str(int(c.held))}
    columns = {"time (s)" if c.timed else "sample": c.time}
    columns |= {headed(c.drive_name, c.drive_unit): c.drive} if c.drive_name != "time" else {}
    made = {"measured": c.measured, "base model": c.base, "with effects": c.improved, HALF: c.half}
    return words, columns | {headed(n, c.unit): values for n, values in made.items() if values is not None}


def write_latex(found: Diagnosis, path: Path) -> Path:
    r"""A `tabular` of what was missing, then of the base model's parameters with the effects."""
    rows = [(r["path"], r["value"], r["interval"] or r["note"], r["unit"]) for r in sentences.parameters(found)]
    rows += [(r["path"], r["after"], "", r["unit"]) for r in sentences.base(found)]
    return write_tabular(path, PARAMETERS, rows)

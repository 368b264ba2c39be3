"""The numbers of a page as files: curves as CSV with units in the header, tables as LaTeX. One way for every page."""

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from tissuejax.storage import write_text

SPECIAL = {"_": r"\_", "%": r"\%", "&": r"\&", "#": r"\#", "±": r"$\pm$", "^": r"\^{}", "²": r"$^2$"}
HALF = "half-width of the 95 % band"


def write_series(path: Path, series: Iterable[tuple[Mapping[str, str], Mapping[str, np.ndarray | None]]]) -> Path:
    """A row a sample of every series.

    Args:
        path: the CSV file.
        series: words that are the same in all its rows, and columns by header. Series of other units have other
            headers; what a series lacks (or None, or NaN) is an empty cell.
    """
    series = list(series)
    heads = [list(dict.fromkeys(k for one in series for k in one[part])) for part in (0, 1)]
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow([*heads[0], *heads[1]])
    for words, columns in series:
        known = {k: np.asarray(v, float) for k, v in columns.items() if v is not None}
        for i in range(max((len(v) for v in known.values()), default=0)):
            cells = [known[k][i] if k in known else np.nan for k in heads[1]]
            told = [f"{x:.9g}" if np.isfinite(x) else "" for x in cells]
            writer.writerow([*(words.get(k, "") for k in heads[0]), *told])
    return write_text(path, text.getvalue())


def write_rows(path: Path, rows: Sequence[Mapping[str, object]]) -> Path:
    """Rows by header as CSV, every header that occurs; what is None is an empty cell."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(dict.fromkeys(k for row in rows for k in row)))
    writer.writeheader()
    writer.writerows(rows)
    return write_text(path, text.getvalue())


def write_tabular(path: Path, columns: Mapping[str, str], rows: Iterable[Sequence[str]]) -> Path:
    r"""A LaTeX `tabular`: `columns` are its headers with their alignment (l, r), cells are plain text."""
    lines = [rf"\begin{{tabular}}{{{''.join(columns.values())}}}"]
    lines.append(" & ".join(map(escaped, columns)) + r" \\ \hline")
    lines += [" & ".join(map(escaped, row)) + r" \\" for row in rows]
    return write_text(path, "\n".join([*lines, r"\end{tabular}"]) + "\n")


def escaped(text: str) -> str:
    """Text for LaTeX."""
    return "".join(SPECIAL.get(c, c) for c in text)


def headed(name: str, unit: str) -> str:
    """The header of a column: its name and SI unit, "stretch (1)"."""
    return f"{name} ({unit})"

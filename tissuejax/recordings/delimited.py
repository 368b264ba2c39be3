"""Delimited text (comma, semicolon, tab or spaces; gzip or plain) as named columns of text, numbers on request."""

import csv
import gzip
import re
import zlib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError, unknown
from tissuejax.recordings.checks import refusal

SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}
MISSING = {"", "nan", "na", "n/a", "null", "-"}


@dataclass(frozen=True)
class Columns:
    """A text table: column names, the cells as text, and the line of the file that each row stood on."""

    path: Path
    cells: dict[str, np.ndarray]
    lines: np.ndarray
    decimal: str = "."
    _numbers: dict[str, np.ndarray] = field(default_factory=dict, repr=False)

    def text(self, name: str | int) -> np.ndarray:
        """A column's cells as text; an integer is a column's place from 1."""
        if isinstance(name, int) and 1 <= name <= len(self.cells):
            name = list(self.cells)[name - 1]
        if name not in self.cells:
            raise InputError(f"{self.path}: {unknown('column', str(name), self.cells)}")
        return self.cells[name]

    def numbers(self, name: str | int) -> Float[np.ndarray, " rows"]:
        """A column as numbers, NaN where a cell is missing.

        Raises:
            InputError: a cell that is no number, with its line.
        """
        key = str(name)
        if key not in self._numbers:
            cells = self.text(name)
            try:
                values = cells.astype(float)
            except ValueError:
                values = np.array([self._number(cell, i, name) for i, cell in enumerate(cells)])
            self._numbers[key] = values
        return self._numbers[key]

    def _number(self, cell: str, row: int, name: str | int) -> float:
        try:
            return float(cell.replace(",", ".") if self.decimal == "," else cell)
        except ValueError:
            if cell.strip().lower() in MISSING:
                return np.nan
            hint = "With decimal commas, set decimal = ',' in the side file." if "," in cell else ""
            if row == 0 and not re.search(r"\d", cell):
                hint = "If this is a row of units, set units_row = true in the side file."
            place = f"line {self.lines[row]}, column {name!r}"
            raise refusal(self.path, place, repr(cell), "a number", hint) from None


def load(
    path: Path,
    separator: str | None = None,
    decimal: str = ".",
    comment: str = "#",
    skip: int = 0,
    header: bool = True,
    units_row: bool = False,
) -> Columns:
    """Read a delimited text file.

    Args:
        path: the file; gzip is recognised by its content.
        separator: "comma", "semicolon", "tab", "space" or one character; None looks at the first line.
        decimal: decimal sign.
        comment: lines that begin with it are left out; "" for none.
        skip: lines before the header that are left out.
        header: whether the first line names the columns; otherwise they are called by their place, from 1.
        units_row: whether a line of units stands under the names; it is left out.

    Raises:
        InputError: an empty file, no rows, a row with too few or too many cells (with its line), binary content.
    """
    rows = text_lines(path)[skip:]
    kept = [
        (skip + i + 1, row) for i, row in enumerate(rows) if row.strip() and not (comment and row.startswith(comment))
    ]
    if not kept:
        raise InputError(f"{path}: found an empty table, expected a line of column names and rows of numbers")
    mark = SEPARATORS.get(separator or "", separator) or _guess(kept[0][1], decimal)
    split = [(line, _split(text, mark)) for line, text in kept]
    names = split[0][1] if header else [str(i + 1) for i in range(len(split[0][1]))]
    names = [name or f"column {k + 1}" for k, name in enumerate(names)]
    body = split[1 + bool(units_row) :] if header else split
    if len(set(names)) < len(names):
        twice = sorted({n for n in names if names.count(n) > 1})
        raise refusal(path, f"line {split[0][0]}", f"column names that come twice: {twice}", "each name once")
    if not body:
        raise refusal(path, "rows", "none", "at least one row under the column names")
    for line, cells in body:
        if len(cells) != len(names):
            found = f"{len(cells)} cells"
            advice = (
                f"The separator read is {mark!r}; set `separator`, `skip` or `comment` in the side file if that is "
                f"wrong, or let `tissuejax import {path.name}` find them."
            )
            raise refusal(path, f"line {line}", found, f"{len(names)} as in line {split[0][0]}", advice)
    cells = np.array([cells for _, cells in body], dtype=object).reshape(len(body), len(names))
    return Columns(path, {n: cells[:, i] for i, n in enumerate(names)}, np.array([line for line, _ in body]), decimal)


def text_lines(path: Path) -> list[str]:
    """The lines of a text file, gzip or plain, whichever of UTF-16, UTF-8, cp1252 and latin-1 decodes it.

    Raises:
        InputError: an empty file, damaged gzip, binary content.
    """
    content = path.read_bytes()
    if not content:
        raise InputError(f"{path}: found an empty file, expected a table of columns")
    if content[:2] == b"\x1f\x8b":
        try:
            content = gzip.decompress(content)
        except (OSError, EOFError, zlib.error) as error:
            raise InputError(f"{path}: found damaged gzip content ({error}), expected a whole .csv.gz") from error
    if b"\x00" in content[:4096] and content[:2] not in (b"\xff\xfe", b"\xfe\xff"):
        raise InputError(f"{path}: found binary content, expected text columns; export the table as CSV")
    for encoding in ("utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig", "cp1252", "latin-1"):
        try:
            return content.decode(encoding).splitlines()
        except UnicodeDecodeError:
            continue
    raise AssertionError("latin-1 decodes anything")


def _guess(line: str, decimal: str) -> str:
    for mark in ("\t", ";", ","):
        if mark in line and mark != decimal:
            return mark
    return " "


def _split(text: str, mark: str) -> list[str]:
    if mark == " ":
        return re.split(r"\s+", text.strip())
    if '"' not in text:
        return [cell.strip() for cell in text.split(mark)]
    return [cell.strip() for cell in next(csv.reader([text], delimiter=mark, skipinitialspace=True))]

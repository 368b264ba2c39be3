"""Delimited text (comma, semicolon, tab or spaces; gzip or plain) as named columns of text, numbers on request."""

import csv
import gzip
import io
import re
import zipfile
import zlib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError, unknown
from tissuejax.recordings.checks import refusal
from tissuejax.recordings.clock import seconds

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

    def times(self, name: str | int) -> Float[np.ndarray, " rows"]:
        """A column of times as numbers; dates and times of day as seconds from the first one, NaN where one is missing.

        Raises:
            InputError: as `numbers`, where the cells are neither.
        """
        counted = seconds(self.text(name))
        return self.numbers(name) if counted is None else counted

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
            return float(plain(cell, self.decimal))
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
    if header and not comment:
        kept[0] = (kept[0][0], unmarked(kept[0][1]))
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
    if content[:4] == b"PK\x03\x04":
        raise InputError(f"{path}: {_packed(content)}")
    if b"\x00" in content[:4096] and content[:2] not in (b"\xff\xfe", b"\xfe\xff"):
        raise InputError(f"{path}: found binary content, expected text columns; export the table as CSV")
    for encoding in ("utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig", "cp1252", "latin-1"):
        try:
            return content.decode(encoding).splitlines()
        except UnicodeDecodeError:
            continue
    raise AssertionError("latin-1 decodes anything")


def _packed(content: bytes) -> str:
    """What a zip archive is, and what to do with it."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as packed:
            inside = [n for n in packed.namelist() if not n.endswith("/")]
    except zipfile.BadZipFile:
        return "found a damaged zip archive, expected text columns"
    if "xl/workbook.xml" in inside:
        return "found an Excel workbook (.xlsx), expected text columns; save the sheet as CSV"
    more = ", ..." if len(inside) > 3 else ""
    return f"found a zip archive with {', '.join(inside[:3])}{more}; unpack it and name the file in it"


def unmarked(line: str) -> str:
    """A line of names without the comment mark that NumPy and plotting programs put before it ("# time force")."""
    return re.sub(r"^\s*[#%]+\s+", "", line)


def plain(cell: str, decimal: str) -> str:
    """A number's text as Python reads it: decimal point, no marks between thousands ("1,250.5", "1.250,5")."""
    thousands = "." if decimal == "," else ","
    if grouped(cell, decimal):
        cell = cell.replace(thousands, "")
    return cell.replace(",", ".") if decimal == "," else cell


def grouped(cell: str, decimal: str) -> bool:
    """Whether a number has marks between its thousands; only where a decimal sign shows which mark is which."""
    mark = "." if decimal == "," else ","
    return bool(re.fullmatch(rf"\s*[-+]?\d{{1,3}}({re.escape(mark)}\d{{3}})+{re.escape(decimal)}\d*\s*", cell))


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

"""Tables in a text file of unknown layout: separator, decimal sign, where rows begin, names, units, the lines above.

A line is a row if most of its cells are numbers; a run of such lines with as many cells is a table; the line above is
its names, or its units where the line above that reads as names. The separator and the decimal sign are those under
which the most cells are numbers.
"""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass

from tissuejax.recordings.delimited import grouped, unmarked
from tissuejax.recordings.exports.meanings import quantity_of, readable, sizes_of, split_unit

CELLS_AND_DECIMALS = (("\t", "."), (";", ","), (";", "."), (",", "."), ("\t", ","), ("|", "."), (" ", "."), (" ", ","))
NAMES = {"\t": "tab", ";": "semicolon", ",": "comma", " ": "space", "|": "|"}
_NUMBER = {
    ".": re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eEdD][-+]?\d+)?|[-+]?(nan|inf)", re.I),
    ",": re.compile(r"[-+]?(\d+,?\d*|,\d+)([eEdD][-+]?\d+)?|[-+]?(nan|inf)", re.I),
}
LOOKED_AT = 3000  # lines by which separator and decimal sign are judged


@dataclass(frozen=True)
class TextTable:
    """One table of a text file.

    Attributes:
        names: of the columns, as they stand; "column 3" where none stands.
        units: one a column, from the names or from a row of units; "" where none stands.
        rows: cells as text.
        first: index of the first row's line.
        names_at: index of the line of names, None without one.
        units_row: whether a row of units stands between names and rows.
        above: index of the first line that belongs to it: the end of the table before.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    rows: list[list[str]]
    first: int
    names_at: int | None
    units_row: bool
    above: int


@dataclass(frozen=True)
class TextFile:
    """A text file understood: how its lines are split, and its tables."""

    separator: str
    decimal: str
    tables: tuple[TextTable, ...]


def split(line: str, separator: str) -> list[str]:
    """The cells of a line, without quotes and blanks around them."""
    if separator == " ":
        return line.split()
    if '"' in line:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))]
    return [cell.strip() for cell in line.split(separator)]


def is_number(cell: str, decimal: str = ".") -> bool:
    """Whether a cell is a number under this decimal sign."""
    return bool(_NUMBER[decimal].fullmatch(cell)) or grouped(cell, decimal)


def is_row(cells: Sequence[str], decimal: str) -> bool:
    """Whether a line's cells are mostly numbers, and at least two of them."""
    if decimal == "." and len(cells) > 1 and _floats(cells):
        return True
    filled = [c for c in cells if c]
    numbers = sum(is_number(c, decimal) for c in filled)
    return numbers >= 2 and numbers >= 0.6 * len(filled)


def _floats(cells: Sequence[str]) -> bool:
    """Whether every cell is a number to Python: the quick answer for most rows."""
    try:
        for cell in cells:
            float(cell)
    except ValueError:
        return False
    return True


def _continues(cells: Sequence[str], marks: int, decimal: str) -> bool:
    """Whether a line goes on with a table: a row, or a row of which only one cell is left."""
    return is_row(cells, decimal) or (len(cells) == marks and any(is_number(c, decimal) for c in cells))


def understood(lines: Sequence[str], separator: str | None = None, decimal: str | None = None) -> TextFile:
    """Separator, decimal sign and every table of a text file.

    Args:
        lines: of the file.
        separator, decimal: where they are known.
    """
    if separator is None or decimal is None:
        separator, decimal = _judged(lines[:LOOKED_AT], separator, decimal)
    found: list[TextTable] = []
    i, above = 0, 0
    while i < len(lines):
        cells = _stripped(split(lines[i], separator)) if lines[i].strip() else []
        if not is_row(cells, decimal):
            i += 1
            continue
        names, units, names_at, units_row, width = _heading(lines, i, above, separator, decimal)
        width = max(width, len(cells))
        rows, first, marks = [], i, len(split(lines[i], separator))
        while i < len(lines) and lines[i].strip():
            cells = split(lines[i], separator)
            if len(_stripped(cells)) > width or not _continues(cells, marks, decimal):
                break
            rows.append((cells + [""] * width)[:width])
            i += 1
        if found and names_at is None and width == len(found[-1].names):  # blank lines between rows
            found[-1].rows.extend(rows)
            above = i
            continue
        names = tuple(n or f"column {k + 1}" for k, n in enumerate((list(names) + [""] * width)[:width]))
        units = tuple((list(units) + [""] * width)[:width])
        found.append(TextTable(_distinct(names), units, rows, first, names_at, units_row, above))
        above = i
    return TextFile(separator, decimal, tuple(found))


_PAIR = re.compile(r"[^=:\d][^=:]*(=|:)\s*\S[^=:]*")


def _pairs(line: str) -> list[tuple[str, str]]:
    """Several key lines on one: "L0 = 25 mm, area = 12 mm^2", "Length (mm);25;Width (mm);4", "Width;6;mm;Gap;2;mm"."""
    for mark in (";", "\t", ","):
        parts = [p.strip().strip('"') for p in line.split(mark)]
        parts = [p for p in parts if p]
        if len(parts) > 1 and all(_PAIR.fullmatch(p) for p in parts):
            halves = [re.split(r"\s*[=:]\s*", p, maxsplit=1) for p in parts]
            return [(h[0], h[1]) for h in halves]
        for width in (2, 3):
            groups = [parts[k : k + width] for k in range(0, len(parts), width)]
            if len(groups) > 1 and all(_stated(g, width) for g in groups):
                return [(g[0].rstrip(" :="), " ".join(g[1:])) for g in groups]
    return []


def _stated(cells: Sequence[str], width: int) -> bool:
    """Whether cells are a name, a number and, of three, its unit."""
    number = len(cells) == width and any(is_number(cells[1], sign) for sign in (".", ","))
    return number and not is_number(cells[0]) and (width == 2 or readable(cells[2].strip("()[]")))


def header(lines: Sequence[str], separator: str) -> dict[str, str]:
    """Key lines ("Specimen Width (mm);6", "Width: 6 mm", "Width","6","mm", "k (N/m)<tab>0.019") as a dictionary."""
    found: dict[str, str] = {}
    for line in lines:
        if not line.strip():
            continue
        line = unmarked(line)
        if several := _pairs(line):
            for key, value in several:
                found.setdefault(key, value)
            continue
        colon = re.match(r"\s*([^:]*[^:\s]):\s+(\S.*)$", line)
        cells = [colon[1], colon[2].strip()] if colon else _stripped(split(line, separator))
        if len(cells) == 1 and separator != "\t":
            cells = _stripped(line.split("\t"))
        if len(cells) == 1:
            parts = re.split(r"\s*[:=]\s+|\s*=\s*|:$", cells[0], maxsplit=1)
            if len(parts) == 1:  # "SMDuration (s) 0.000": a key with its unit, a blank, a number
                parts = re.split(r"(?<=\))\s+(?=[-+.\d])", cells[0], maxsplit=1)
            cells = [p.strip() for p in parts]
        if len(cells) < 2 or not cells[0]:
            continue
        key, value = cells[0].rstrip(" :="), cells[1]
        if len(cells) > 2 and readable(cells[2].strip("()[]")):
            value = f"{value} {cells[2].strip('()[]')}"
        found.setdefault(key, value)
    return found


def sizes_above(tables: Sequence[TextTable]) -> tuple[dict[str, str], list[TextTable]]:
    """What a small table above the data says of the specimen (sizes, one row), as key lines; the other tables."""
    found: dict[str, str] = {}
    left = []
    for k, table in enumerate(tables):
        if k + 1 < len(tables) and len(table.rows) == 1 and any(sizes_of(n) for n in table.names):
            for name, unit, value in zip(table.names, table.units, table.rows[0], strict=True):
                key = name if not unit or split_unit(name)[1] else f"{name} ({unit})"
                found.setdefault(key, value)
        else:
            left.append(table)
    return found, left


def _stripped(cells: list[str]) -> list[str]:
    while cells and not cells[-1]:
        cells = cells[:-1]
    return cells


def _judged(lines: Sequence[str], separator: str | None, decimal: str | None) -> tuple[str, str]:
    best, most = ((separator or ",", decimal or "."), 0)
    for mark, sign in CELLS_AND_DECIMALS:
        if (separator or mark) != mark or (decimal or sign) != sign:
            continue
        score = 0
        for line in lines:
            cells = split(line, mark) if line.strip() else []
            if is_row(cells, sign):
                numbers = sum(is_number(c, sign) for c in cells)
                score += 3 * numbers - 2 * sum(1 for c in cells if c)
        if score > most:
            best, most = (mark, sign), score
    return best


def _heading(
    lines: Sequence[str], first: int, above: int, separator: str, decimal: str
) -> tuple[list[str], list[str], int | None, bool, int]:
    """Names, units, the line of names, whether a units row stands under it, and the width that they claim."""
    places = [k for k in range(max(above, first - 4), first) if lines[k].strip()]
    if not places or places[-1] < first - 2:
        return [], [], None, False, 0
    near = _stripped(split(unmarked(lines[places[-1]]), separator))
    if len(near) < 2 or sum(is_number(c, decimal) for c in near if c) > 0.3 * len(near):
        return [], [], None, False, 0
    if len(places) > 1 and _are_units(near):
        names = _stripped(split(unmarked(lines[places[-2]]), separator))
        bracketed = all(c[0] in "([" for c in near if c)
        named = any(quantity_of(split_unit(n)[0]) for n in names)
        if len(names) >= 2 and not any(is_number(n, decimal) for n in names) and (bracketed or named):
            units = [
                c.strip("()[] ") if readable(c.strip("()[] ")) else "" for c in split(lines[places[-1]], separator)
            ]
            return names, units, places[-2], True, len(names)
    return near, [split_unit(n)[1] for n in near], places[-1], False, len(near)


def _are_units(cells: Sequence[str]) -> bool:
    """Whether the filled cells are units, bracketed or not, but for a few that no one knows."""
    filled = [c for c in cells if c]
    units = [
        readable(c.strip("()[] ")) or (c[0] in "([" and c[-1] in ")]" and len(c) < 12) or c in ("-", "#")
        for c in filled
    ]
    return bool(filled) and sum(units) >= 0.7 * len(filled)


def _distinct(names: Sequence[str]) -> tuple[str, ...]:
    """Names that come twice get a number: "Force", "Force (2)"."""
    seen: dict[str, int] = {}
    out = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        out.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return tuple(out)


def groups(table: TextTable) -> list[TextTable]:
    """The table split where its column names begin again; rows in which a group is empty are left out of it."""
    plain = [re.sub(r" \(\d+\)$", "", name) for name in table.names]
    starts = [k for k, name in enumerate(plain) if name == plain[0] and name] if plain else []
    width = starts[1] if len(starts) > 1 else len(plain)
    if len(starts) < 2 or plain != plain[:width] * len(starts):
        return [table]
    found = []
    for start in starts:
        part = slice(start, start + width)
        rows = [row[part] for row in table.rows if any(row[part])]
        found.append(
            TextTable(
                tuple(plain[:width]), table.units[part], rows, table.first, table.names_at, table.units_row, table.above
            )
        )
    return found

"""Full fields of image correlation as text: a row a point, its coordinates and its displacement.

What differs from program to program (names of columns, unit, how a lost point is marked) is data in each program's
file; this is the engine. The reference state is the first frame and the deformed state the second.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tissuejax.errors import InputError
from tissuejax.recordings.delimited import text_lines
from tissuejax.recordings.exports import text
from tissuejax.recordings.exports.meanings import quantity_of, split_unit
from tissuejax.recordings.exports.tracked import Tracked


@dataclass(frozen=True)
class FieldColumns:
    """Patterns (whole name without unit, case counts) of the columns of a program's field.

    Attributes:
        place: of x, y and z in the reference state; z may be missing from a file.
        moved: of the displacement along them.
        lost: column and test that tells a lost point, or None.
        label: of the point's number, or "".
    """

    place: Sequence[str]
    moved: Sequence[str]
    lost: tuple[str, Callable[[np.ndarray], np.ndarray]] | None = None
    label: str = ""


def field(path: Path, columns: FieldColumns, unit: str = "", assumed: Sequence[str] = ()) -> Tracked:
    """The reference and the deformed positions of the points of one field.

    Args:
        path: the file.
        columns: its columns.
        unit: of lengths, where the names don't tell.
        assumed: what to say.

    Raises:
        InputError: no table, or columns that are missing (which were looked for, which are there).
    """
    lines = text_lines(path)
    whole = text.understood(lines)
    if not whole.tables:
        raise InputError(f"{path}: found no table of points")
    table = max(whole.tables, key=lambda t: len(t.rows))
    bare = [_name(n) for n in table.names]
    place = [_find(bare, p) for p in columns.place]
    moved = [_find(bare, p) for p in columns.moved]
    if None in (*place[:2], *moved[:2]):
        raise InputError(
            f"{path}: found columns {', '.join(table.names)}, expected coordinates and displacements called like "
            f"{', '.join([*columns.place[:2], *columns.moved[:2]])}"
        )
    units = [_unit(n, u) for n, u in zip(table.names, table.units, strict=True)]
    stated = next((u for k, u in enumerate(units) if k in (*place, *moved) and u), "") or unit
    numbers = np.array([[_number(c, whole.decimal) for c in row] for row in table.rows])
    at = np.stack([numbers[:, k] if k is not None else np.zeros(len(numbers)) for k in place], axis=1)
    by = np.stack([numbers[:, k] if k is not None else np.zeros(len(numbers)) for k in moved], axis=1)
    if columns.lost is not None and (k := _find(bare, columns.lost[0])) is not None:
        by = np.where(columns.lost[1](numbers[:, k])[:, None], np.nan, by)
    named = _find(bare, columns.label) if columns.label else None
    labels = [row[named] for row in table.rows] if named is not None else [str(i + 1) for i in range(len(at))]
    return Tracked(None, np.stack([at, at + by]), tuple(labels), stated, tuple(assumed), place[2] is None)


def names_of_field(head: str, columns: FieldColumns, axes: int = 2) -> bool:
    """Whether a line of a file's beginning names coordinates and their displacements, as a program does, and no time.

    Args:
        head: the beginning.
        columns: the program's.
        axes: how many of x, y and z must be there.
    """
    for line in head.splitlines():
        cells = [_name(c) for c in re.split(r"[;,\t]", line)]
        if all(_find(cells, p) is not None for p in (*columns.place[:axes], *columns.moved[:axes])):
            return not any(quantity_of(c) == "time" for c in cells)
    return False


def _name(cell: str) -> str:
    """A column's name without quotes, comment mark and unit, of which some ("pixel") are no unit to others."""
    return re.sub(r"\s*\[[^\]]*\]$", "", split_unit(cell.strip(' "#'))[0].strip(' "'))


def _unit(name: str, unit: str) -> str:
    """The unit of a column; pixels are no length, though a printer's "px" is one."""
    return "pixel" if re.search(r"[\[(](px|pix|pixels?)[\])]", name, re.I) else unit


def _find(names: Sequence[str], pattern: str) -> int | None:
    return next((k for k, n in enumerate(names) if re.fullmatch(pattern, n)), None)


def _number(cell: str, decimal: str) -> float:
    try:
        return float(cell.replace(",", ".") if decimal == "," else cell)
    except ValueError:
        return np.nan

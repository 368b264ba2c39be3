"""The family of table exports: what a machine's raw file holds, as named columns with units and key lines."""

import abc
import functools
import gzip
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np

from tissuejax.errors import InputError, unknown
from tissuejax.families import members
from tissuejax.recordings.delimited import Columns, text_lines
from tissuejax.recordings.exports import text

UNSEEN = "no real file was at hand: the reader follows its public description"
BLOCK = "block"  # the column that says which block of the file a row stood in, where there are several


@dataclass(frozen=True)
class Exported:
    """The content of an export.

    Attributes:
        columns: all rows, blocks one under another.
        units: unit of each column as it stands in the file; "" where none stands.
        header: key lines of the file.
        blocks: names of the blocks (steps, tests, sheets); one for a plain file.
        assumed: sentences on what the reader took for granted.
    """

    columns: Columns
    units: Mapping[str, str]
    header: Mapping[str, str] = field(default_factory=dict)
    blocks: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()


class TableExport(abc.ABC):
    """One machine's raw text or workbook.

    Class data:
        name: as written in a side file, `format = "..."`.
        machine: what wrote it, for messages.
        basis: what the reader was tested on: "a real file ...", or its public description; see `by_description`.
        experiment: the kind of test that such a file holds; "" where it may be any.
        meanings: column name (bare, see `meanings.bare`) to quantity, where the words of `meanings` don't tell.
    """

    name: ClassVar[str]
    machine: ClassVar[str]
    basis: ClassVar[str]
    experiment: ClassVar[str] = ""
    meanings: ClassVar[Mapping[str, str]] = {}

    @abc.abstractmethod
    def recognises(self, path: Path, head: str) -> bool:
        """Whether a file with this beginning (text of its first 8192 bytes) is of this format."""

    @abc.abstractmethod
    def read(self, path: Path) -> Exported:
        """The content.

        Raises:
            InputError: no table in it, or one cut short.
        """


def by_description(basis: str) -> bool:
    """Whether a reader was written without a real file, by what its basis says: every other begins "a real file"."""
    return not basis.startswith(("a real file", "the real files"))


@functools.cache
def table_exports() -> dict[str, TableExport]:
    """All table exports by name."""
    import tissuejax.recordings.exports as folder

    return {name: kind() for name, kind in members(folder, TableExport).items()}


def export_named(name: str) -> TableExport:
    """The export called `name`.

    Raises:
        InputError: an unknown one; the nearest are offered.
    """
    if name not in table_exports():
        raise unknown("format of a raw export", name, table_exports())
    return table_exports()[name]


def recognised(path: Path) -> TableExport | None:
    """The export that a file is, by its content; None where no member knows it."""
    head = head_of(path)
    return next((kind for kind in table_exports().values() if kind.recognises(path, head)), None)


def head_of(path: Path) -> str:
    """The first 8192 bytes of a file as text, unpacked where it is gzip."""
    with open(path, "rb") as file:
        content = file.read(8192)
    if content[:2] == b"\x1f\x8b":
        try:
            with gzip.open(path) as file:
                content = file.read(8192)
        except (OSError, EOFError, zlib.error):  # said by whoever reads the whole
            return ""
    return decoded(content)


def decoded(content: bytes) -> str:
    """The beginning of a file as text, whatever its encoding; binary content gives what it gives."""
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16", "ignore")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def from_text(
    path: Path,
    separator: str | None = None,
    decimal: str | None = None,
    blocks: Sequence[str] | None = None,
    assumed: Sequence[str] = (),
    keep: Sequence[int] | None = None,
) -> Exported:
    """The tables of a text file as one export.

    Args:
        path: the file.
        separator, decimal: where the format fixes them.
        blocks: names of the tables kept; "1", "2", ... by default.
        assumed: what to say.
        keep: places of the tables that hold data, counted from 0; all by default.

    Raises:
        InputError: no table of numbers in the file.
    """
    lines = text_lines(path)
    whole = text.understood(lines, separator, decimal)
    tables = [whole.tables[k] for k in keep] if keep is not None else list(whole.tables)
    tables = [t for t in tables if t.rows]
    if not tables:
        raise InputError(f"{path}: found no table of numbers, expected rows of numbers under a line of column names")
    first = tables[0]
    above = lines[: first.names_at if first.names_at is not None else first.first]
    return stacked(path, tables, text.header(above, whole.separator), blocks, assumed, whole.decimal)


def stacked(
    path: Path,
    tables: Sequence[text.TextTable],
    header: Mapping[str, str],
    blocks: Sequence[str] | None = None,
    assumed: Sequence[str] = (),
    decimal: str = ".",
) -> Exported:
    """Tables one under another: the union of their columns, and the column `block` where there are several."""
    names = list(dict.fromkeys(n for t in tables for n in t.names))
    units = {n: u for t in reversed(tables) for n, u in zip(t.names, t.units, strict=True)}
    labels = list(blocks) if blocks is not None else [str(k + 1) for k in range(len(tables))]
    cells: dict[str, np.ndarray] = {}
    for name in names:
        parts = [
            [row[t.names.index(name)] for row in t.rows] if name in t.names else [""] * len(t.rows) for t in tables
        ]
        cells[name] = np.array([c for part in parts for c in part], dtype=object)
    if len(tables) > 1:
        cells[BLOCK] = np.array([b for b, t in zip(labels, tables, strict=True) for _ in t.rows], dtype=object)
        units[BLOCK] = ""
    lines = np.array([t.first + k + 1 for t in tables for k in range(len(t.rows))])
    return Exported(Columns(path, cells, lines, decimal), units, header, tuple(labels), tuple(assumed))

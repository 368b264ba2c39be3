"""A text file with several tables, or with other text between and after them: every table of numbers, as blocks."""

from pathlib import Path
from typing import ClassVar

from tissuejax.errors import InputError
from tissuejax.recordings.delimited import text_lines
from tissuejax.recordings.exports import text
from tissuejax.recordings.exports.export import Exported, TableExport, stacked


class PlainText(TableExport):
    """Any text with tables of numbers in it; chosen by name (`format = "text"`) or by `tissuejax import`."""

    name: ClassVar[str] = "text"
    machine: ClassVar[str] = "any text with tables in it"
    basis: ClassVar[str] = "the real files of the other formats"

    def recognises(self, path: Path, head: str) -> bool:
        """Never: anything might be this."""
        return False

    def read(self, path: Path) -> Exported:
        """Every table, and each group of columns whose names begin again, numbered from 1 in the column `block`."""
        lines = text_lines(path)
        whole = text.understood(lines)
        sizes, measured = text.sizes_above(whole.tables)
        tables = [part for table in measured for part in text.groups(table)]
        if not tables:
            raise InputError(
                f"{path}: found no table of numbers, expected rows of numbers under a line of column names"
            )
        top = tables[0].names_at if tables[0].names_at is not None else tables[0].first
        assumed = ("separator, decimal sign and names are guessed anew whenever it is read",)
        header = text.header(lines[:top], whole.separator) | sizes
        return stacked(path, tables, header, None, assumed, whole.decimal)

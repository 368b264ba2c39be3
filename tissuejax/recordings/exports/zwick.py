"""ZwickRoell's testXpert: tables of names, units below them, often with decimal commas, one specimen beside another.

Columns: Prüfzeit, Standardweg, Standardkraft, Dehnung, Traversenweg (or their English names). Where the same columns
come again to the right, each group is a specimen of its own.
"""

from pathlib import Path
from typing import ClassVar

from tissuejax.recordings.delimited import text_lines
from tissuejax.recordings.exports import text
from tissuejax.recordings.exports.export import Exported, TableExport, stacked

_MARKS = ("testXpert", "Standardkraft", "Standard force", "Standardweg", "Traversenweg", "Prüfzeit")


class Zwick(TableExport):
    """Text table of testXpert."""

    name: ClassVar[str] = "zwick-testxpert"
    machine: ClassVar[str] = "ZwickRoell testXpert"
    basis: ClassVar[str] = "its public description"

    def recognises(self, path: Path, head: str) -> bool:
        """By its own column names."""
        return any(mark in head for mark in _MARKS)

    def read(self, path: Path) -> Exported:
        """Each table, and each group of columns in it, as a block."""
        lines = text_lines(path)
        whole = text.understood(lines)
        tables = [part for table in whole.tables for part in text.groups(table)]
        top = whole.tables[0].names_at or whole.tables[0].first if whole.tables else len(lines)
        return stacked(path, tables, text.header(lines[:top], whole.separator), decimal=whole.decimal)

"""Instron's Bluehill: raw data ("Specimen_RawData_1.csv") and tables of results, commas, units in a second row.

Raw data: key lines ("General : Start Date"), a blank line, names (Time, Extension, Load, Segment ID, Total Cycle
Count ...), a row of units in brackets, numbers. A table of results ("Results Table 1") has one row a specimen; it
stands alone or above the raw data and is left out of the rows.
"""

from pathlib import Path
from typing import ClassVar

from tissuejax.errors import InputError
from tissuejax.recordings.delimited import text_lines
from tissuejax.recordings.exports import text
from tissuejax.recordings.exports.export import Exported, TableExport, stacked
from tissuejax.recordings.exports.meanings import bare, quantity_of, split_unit

_MARKS = ("Text Inputs :", "General : ", "Segment ID", "Results Table", "Total Cycle Count", "Bluehill")


class Bluehill(TableExport):
    """Raw data and tables of results of Bluehill 2 and later."""

    name: ClassVar[str] = "instron-bluehill"
    machine: ClassVar[str] = "Instron Bluehill"
    basis: ClassVar[str] = "a real file (Bluehill 2 raw data); of tables of results their public description"

    def recognises(self, path: Path, head: str) -> bool:
        """By its key lines and its columns of segments and cycles."""
        return any(mark in head for mark in _MARKS) and "Total Time (s)" not in head

    def read(self, path: Path) -> Exported:
        """The raw data, each table of them one block; key lines, and a table of results by its first row, as header.

        Raises:
            InputError: a table of results alone, or no table.
        """
        lines = text_lines(path)
        whole = text.understood(lines)
        raw = [t for t in whole.tables if any(quantity_of(split_unit(n)[0]) == "time" for n in t.names)]
        results = [t for t in whole.tables if t not in raw]
        if not raw:
            found = "a table of results (one row a specimen)" if results else "no table of numbers"
            raise InputError(f"{path}: found {found}, expected raw data with a column of time: export RawData ... .csv")
        top = raw[0].names_at if raw[0].names_at is not None else raw[0].first
        header = text.header(lines[:top], whole.separator)
        for table in results[:1]:
            for name, unit, value in zip(table.names, table.units, table.rows[0], strict=True):
                key = name if not unit or unit in name else f"{name} ({unit})"
                if bare(name):
                    header.setdefault(key, value)
        return stacked(path, raw, header, decimal=whole.decimal)

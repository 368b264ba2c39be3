"""Agilent's (Keysight's) nanoindenters: NanoSuite workbooks (.xls), one sheet a test, units in the second row.

1.797693e308 stands for "no value". Sheets of tests come in falling order and are read in rising order.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from tissuejax.errors import InputError
from tissuejax.recordings.exports.export import Exported, TableExport, stacked
from tissuejax.recordings.exports.text import TextTable

NO_VALUE = 1e300
_OLE = "\xd0\xcf\x11\xe0"


class Agilent(TableExport):
    """Workbook of NanoSuite."""

    name: ClassVar[str] = "agilent-nanosuite"
    machine: ClassVar[str] = "Agilent nanoindenter (NanoSuite)"
    basis: ClassVar[str] = "a real file"
    experiment: ClassVar[str] = "probing"
    meanings: ClassVar[Mapping[str, str]] = {
        "displacement into surface": "displacement",
        "load on sample": "force",
        "time on sample": "time",
    }

    def recognises(self, path: Path, head: str) -> bool:
        """An old workbook with sheets called "Test 001"."""
        return head.startswith(_OLE) and bool(_sheets(path))

    def read(self, path: Path) -> Exported:
        """Each test as a block.

        Raises:
            InputError: no sheet of a test in it.
        """
        sheets = _sheets(path)
        if not sheets:
            raise InputError(f"{path}: found no sheet called 'Test 001' or so, expected one a test")
        tables = [_table(sheet) for sheet in sheets]
        assumed = ["1.797693e308 stands for no value"]
        return stacked(path, tables, {}, [s.name.strip() for s in sheets], assumed)


def _sheets(path: Path) -> list:
    import xlrd
    from xlrd.biffh import XLRDError

    try:
        book = xlrd.open_workbook(str(path))
    except (XLRDError, OSError, IndexError, AssertionError, ValueError, KeyError):
        return []
    found = [s for s in book.sheets() if re.fullmatch(r"Test\s*\d+", s.name.strip()) and s.nrows > 2]
    return sorted(found, key=lambda s: s.name)


def _table(sheet) -> TextTable:
    names = [str(v).strip() for v in sheet.row_values(0)]
    units = [str(v).strip() for v in sheet.row_values(1)]
    used = [k for k, n in enumerate(names) if n]
    rows = []
    for i in range(2, sheet.nrows):
        row = [_cell(v) for v in sheet.row_values(i)]
        rows.append([row[k] for k in used])
    return TextTable(tuple(names[k] for k in used), tuple(units[k] for k in used), rows, 2, 0, True, 0)


def _cell(value: object) -> str:
    if isinstance(value, float):
        return "" if abs(value) > NO_VALUE else repr(value)
    return str(value).strip()

"""A text file with several tables, or with other text between and after them: every table of numbers, as blocks."""

from pathlib import Path
from typing import ClassVar

from tissuejax.recordings.exports.export import Exported, TableExport, from_text


class PlainText(TableExport):
    """Any text with tables of numbers in it; chosen by name (`format = "text"`) or by `tissuejax import`."""

    name: ClassVar[str] = "text"
    machine: ClassVar[str] = "any text with tables in it"
    basis: ClassVar[str] = "the real files of the other formats"

    def recognises(self, path: Path, head: str) -> bool:
        """Never: anything might be this."""
        return False

    def read(self, path: Path) -> Exported:
        """Every table, numbered from 1 in the column `block` where there are several."""
        return from_text(path, assumed=("separator, decimal sign and names are guessed anew whenever it is read",))

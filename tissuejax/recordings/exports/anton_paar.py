"""Anton Paar's (CSM's) indentation testers: text export, tab-separated, "Time [s]  Pd [nm]  Fn [mN]".

The units stand in the names or in a row of their own below them.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from tissuejax.recordings.exports.export import Exported, TableExport, from_text
from tissuejax.recordings.exports.meanings import split_unit


class AntonPaar(TableExport):
    """Text export of an indentation: penetration depth Pd and normal force Fn over time."""

    name: ClassVar[str] = "anton-paar"
    machine: ClassVar[str] = "Anton Paar indentation tester"
    basis: ClassVar[str] = "its public description"
    experiment: ClassVar[str] = "probing"
    meanings: ClassVar[Mapping[str, str]] = {
        "pd": "displacement",
        "fn": "force",
        "penetration depth": "displacement",
        "normal force": "force",
    }

    def recognises(self, path: Path, head: str) -> bool:
        """By the names of its columns."""
        lines = [
            {split_unit(cell.strip(' "'))[0].strip() for cell in re.split(r"[\t;,]", x)} for x in head.splitlines()
        ]
        return any({"Pd", "Fn"} <= cells for cells in lines)

    def read(self, path: Path) -> Exported:
        """Its table."""
        return from_text(path)

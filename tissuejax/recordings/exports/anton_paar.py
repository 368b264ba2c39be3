"""Anton Paar's (CSM's) indentation testers: text export, tab-separated, "Time [s]  Pd [nm]  Fn [mN]"."""

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from tissuejax.recordings.exports.export import Exported, TableExport, from_text


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
        return "Pd [" in head and "Fn [" in head

    def read(self, path: Path) -> Exported:
        """Its table."""
        return from_text(path)

"""`tissuejax import`: a lab's own table, described by a side file, as a recording file."""

import argparse
from pathlib import Path
from typing import ClassVar

from tissuejax.commands.command import Command, Reply
from tissuejax.errors import InputError
from tissuejax.recordings.files import names, read, write


class Import(Command):
    """Write a recording file (HDF5, version 1) from a table and its side file."""

    name: ClassVar[str] = "import"
    order: ClassVar[int] = 25
    summary: ClassVar[str] = "turn a lab's own CSV table into a recording file, by a small side file"
    teaches: ClassVar[str] = """
Turn a table (CSV, also compressed) into a recording file. SIDE.toml names the table and says what its columns mean:
units, kind of experiment, specimen size, engineering or true quantities, sign. No code is needed; `fits/` holds
examples for each real data set. A file with several samples writes one recording file each: give a folder, or pick
one with SIDE.toml#NAME.

  tissuejax import fits/rubber/rubber.toml#Treloar_1944 treloar.h5
  tissuejax import specimens.toml out/
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """SIDE.toml and OUT."""
        parser.add_argument("side", metavar="SIDE.toml", help="side file; SIDE.toml#NAME for one sample of many")
        parser.add_argument(
            "out", metavar="OUT.h5", type=Path, help="recording file to write, or a folder for several samples"
        )

    def run(self, given: argparse.Namespace) -> Reply:
        """Read every sample, write every file."""
        known = names(given.side)
        single = given.out.suffix in (".h5", ".hdf5")
        if single and len(known) > 1:
            raise InputError(
                f"{given.side} holds {len(known)} samples, {given.out} is one file: give a folder, or "
                f"{given.side}#{known[0]}"
            )
        written = {}
        for name in known:
            sample = read(given.side, name)
            path = given.out if single else given.out / f"{name}.h5"
            write(sample, path)
            written[name] = {"file": str(path), "recordings": len(sample.recordings)}
        text = "\n".join(f"{w['file']}: {name}, {w['recordings']} recordings" for name, w in written.items())
        return Reply({"written": written}, text)

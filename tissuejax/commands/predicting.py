"""`tissuejax predict`: what a fitted model says of recordings, also of those it never saw."""

import argparse
from pathlib import Path
from typing import ClassVar

from tissuejax.commands.command import Command, Reply
from tissuejax.commands.results import read_result
from tissuejax.commands.simulating import add_output, simulated
from tissuejax.errors import unknown
from tissuejax.recordings.files import read


class Predict(Command):
    """Predictions beside the measurement."""

    name: ClassVar[str] = "predict"
    order: ClassVar[int] = 38
    summary: ClassVar[str] = "what a fitted model says of recordings, beside what was measured"
    teaches: ClassVar[str] = """
Predict the recordings of a file with a fitted model: nothing is fitted. Writes a recording file with the predictions,
CSV tables with prediction and measurement side by side, a figure, and for probings with --states the deformed states, a
picture and an animation with the residuals of the markers.

  tissuejax predict out/liver/result.json liver.h5
  tissuejax predict out/rubber/result.json other-day.h5 --only planar
  tissuejax predict out/liver/result.json liver.h5 --only r3 --states
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """RESULT.json, FILE, --only and where to write."""
        parser.add_argument("result", type=Path, metavar="RESULT.json", help="a result of `tissuejax fit`")
        parser.add_argument("file", metavar="FILE", help="recordings to predict")
        parser.add_argument("--only", action="append", default=[], metavar="RECORDING", help="this one (repeat)")
        add_output(parser)

    def run(self, given: argparse.Namespace) -> Reply:
        """Read, predict, write."""
        of, sample = read_result(given.result), read(given.file)
        for name in given.only:
            if name not in sample.recordings:
                raise unknown("recording", name, sample.recordings)
        names = tuple(n for n in sample.recordings if n in given.only or not given.only)
        return simulated(of, sample, names, given, given.out or Path("out") / f"{sample.name}-predicted", measured=True)

"""`tissuejax demo`: the main job on recordings that come with the project."""

import argparse
from pathlib import Path
from typing import ClassVar

import tissuejax.commands as package
from tissuejax import verbs
from tissuejax.commands.command import SUSPECT, Command, Reply
from tissuejax.commands.diagnose import diagnosed
from tissuejax.commands.fitting import reply
from tissuejax.commands.outputs import folder_named
from tissuejax.errors import InputError
from tissuejax.progress import for_terminal
from tissuejax.recordings.files import read

PLACES = (Path(package.__path__[0]).parents[1] / "data" / "demo", Path("data") / "demo")
ENERGY, HELD = "reduced-polynomial-2", "holdout"


class Demo(Command):
    """Fit the two demonstration samples, diagnose the second, and say where the pages are."""

    name: ClassVar[str] = "demo"
    order: ClassVar[int] = 1
    summary: ClassVar[str] = "the main job on recordings that come with the project"
    teaches: ClassVar[str] = """
Fits a strain energy to two small samples that come with the project, each pulled, pressed and sheared; a fourth
recording is held out. The first is elastic: the model fits to the noise and predicts the held-out recording. In the
second something is concealed: the fit's page says that it can't follow, and the diagnosis says what is missing.
Read the pages in a browser.

  tissuejax demo --out out/demo
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """--out."""
        parser.add_argument(
            "--out", "-o", type=folder_named, default=Path("out/demo"), metavar="FOLDER", help="default: out/demo"
        )

    def run(self, given: argparse.Namespace) -> Reply:
        """Fit both, diagnose the one that can't be fitted, write the pages."""
        folder = next((p for p in PLACES if p.is_dir()), None)
        if folder is None:
            raise InputError(f"the demonstration data are not here; run in a checkout (looked at {PLACES[0]})")
        texts, record, code = [], {}, 0
        for name in ("elastic", "relaxing"):
            sample = read(folder / f"{name}.h5")
            found = verbs.fit(sample, ENERGY, holdout=[HELD], progress=for_terminal())
            answer = reply(found, verbs.write(found, given.out / name))
            texts += [f"== {folder / name}.h5", "", answer.text, ""]
            record[name] = answer.record
            if answer.code != SUSPECT:  # the second can't be fitted: that is what it is there for
                code = max(code, answer.code)
        found = verbs.diagnose(sample, ENERGY, holdout=HELD, progress=for_terminal())
        answer = diagnosed(found, verbs.write(found, given.out / "diagnosis"))
        texts += [f"== what is missing in {folder / name}.h5", "", answer.text, ""]
        record["diagnosis"] = answer.record
        return Reply(record, "\n".join(texts).rstrip(), code)

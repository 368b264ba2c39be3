"""`tissuejax study`: re-run the studies on real recordings in `fits/`, each by its own script."""

import argparse
import runpy
import time
from pathlib import Path
from typing import ClassVar

from tissuejax.commands.command import Command, Reply
from tissuejax.errors import InputError

SCRIPT = "study.py"


class Study(Command):
    """Run `study.py` of each folder named."""

    name: ClassVar[str] = "study"
    order: ClassVar[int] = 60
    summary: ClassVar[str] = "re-run a study on real recordings (a folder under fits/)"
    teaches: ClassVar[str] = """
Re-runs a study: its question and answer are in FOLDER/README.md, its numbers in FOLDER/result.json, its figures
beside them. The recordings themselves are not part of the project; the environment variable TISSUEJAX_SHARED names
the folder that holds them (recordings/...), by default ../shared beside the checkout.

  tissuejax study fits/rubber
  tissuejax study fits/*                   all of them
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """FOLDERs."""
        parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER", help="folders with a study.py")

    def run(self, given: argparse.Namespace) -> Reply:
        """Run each in turn; folders without a script are passed over if others have one."""
        with_script = [f for f in given.folders if (f / SCRIPT).is_file()]
        if not with_script:
            raise InputError(
                f"no {SCRIPT} in {', '.join(map(str, given.folders))}; a study is a folder such as fits/rubber"
            )
        done = {}
        for folder in with_script:
            begun = time.perf_counter()
            answer = runpy.run_path(str(folder / SCRIPT))["main"](folder)
            done[str(folder)] = {"seconds": time.perf_counter() - begun, "answer": answer}
        lines = [f"{folder}: {d['seconds']:.0f} s, {d['answer']}" for folder, d in done.items()]
        return Reply({"studies": done}, "\n".join(lines))

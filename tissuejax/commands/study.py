"""`tissuejax study`: re-run the studies on real recordings in `fits/`, each by its own scripts."""

import argparse
import runpy
import time
from pathlib import Path
from typing import ClassVar

from tissuejax.commands.command import Command, Reply
from tissuejax.errors import InputError

SCRIPTS = ("study.py", "diagnosis.py")


class Study(Command):
    """Run `study.py` and `diagnosis.py` of each folder named, where they are."""

    name: ClassVar[str] = "study"
    order: ClassVar[int] = 60
    summary: ClassVar[str] = "re-run a study on real recordings (a folder under fits/)"
    teaches: ClassVar[str] = """
Re-runs a study: its question and answer are in FOLDER/README.md, its numbers in FOLDER/result.json (those of the
diagnosis of the same recordings in FOLDER/diagnosis.json), its figures beside them. The recordings themselves are
not part of the project; the environment variable TISSUEJAX_SHARED names the folder that holds them (recordings/...), by
default ../shared beside the checkout.

  tissuejax study fits/rubber
  tissuejax study fits/beef --only diagnosis
  tissuejax study fits/*                   all of them
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """FOLDERs."""
        parser.add_argument(
            "folders", nargs="+", type=Path, metavar="FOLDER", help="folders with a study.py or diagnosis.py"
        )
        parser.add_argument("--only", choices=[Path(s).stem for s in SCRIPTS], help="one of the two scripts")

    def run(self, given: argparse.Namespace) -> Reply:
        """Run each in turn; folders without a script are passed over if others have one."""
        scripts = [s for s in SCRIPTS if given.only in (None, Path(s).stem)]
        found = [folder / s for folder in given.folders for s in scripts if (folder / s).is_file()]
        if not found:
            raise InputError(
                f"no {' or '.join(scripts)} in {', '.join(map(str, given.folders))}; "
                "a study is a folder such as fits/rubber"
            )
        done = {}
        for script in found:
            begun = time.perf_counter()
            answer = runpy.run_path(str(script))["main"](script.parent)
            name = str(script.parent if script.name == SCRIPTS[0] else script)
            done[name] = {"seconds": time.perf_counter() - begun, "answer": answer}
        lines = [f"{name}: {d['seconds']:.0f} s, {d['answer']}" for name, d in done.items()]
        return Reply({"studies": done}, "\n".join(lines))

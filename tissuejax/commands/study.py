"""`tissuejax study`: re-run the studies on real recordings in `fits/`, each by its own scripts."""

import argparse
import datetime
import json
import os
import runpy
import shutil
import subprocess
import time
from pathlib import Path
from typing import ClassVar

from tissuejax.cache import source
from tissuejax.commands.command import Command, Reply
from tissuejax.errors import InputError
from tissuejax.storage import write_json

SCRIPTS = ("study.py", "diagnosis.py")


class Study(Command):
    """Run `study.py` and `diagnosis.py` of each folder named, where they are."""

    name: ClassVar[str] = "study"
    order: ClassVar[int] = 60
    summary: ClassVar[str] = "re-run a study on real recordings (a folder under fits/)"
    teaches: ClassVar[str] = """
Re-runs a study: its question and answer are in FOLDER/README.md, its numbers in FOLDER/result.json (those of the
diagnosis of the same recordings in FOLDER/diagnosis.json), its figures beside them, and in FOLDER/run.json when, by
which commit and code and in how long each script ran last. The recordings themselves are
not part of the project; the environment variable TISSUEJAX_SHARED names the folder that holds them (recordings/...), by
default ../shared beside the checkout.

  tissuejax study fits/rubber
  tissuejax study fits/beef --only diagnosis
  tissuejax study fits/*                   all of them
  tissuejax study fits/rubber --out out/studies     in a copy, out/studies/rubber, so that nothing here is overwritten

Without --out the numbers and figures in FOLDER are overwritten. A study that goes on from what it finds (result.json)
does so in the copy too.
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """FOLDERs."""
        parser.add_argument(
            "folders", nargs="+", type=Path, metavar="FOLDER", help="folders with a study.py or diagnosis.py"
        )
        parser.add_argument("--out", "-o", type=Path, metavar="FOLDER", help="run in a copy here; default: in place")
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
        if given.out is not None:
            found = [_copied(script, given.out) for script in found]
        for script in found:
            begun = time.perf_counter()
            answer = runpy.run_path(str(script))["main"](script.parent)
            name = str(script.parent if script.name == SCRIPTS[0] else script)
            done[name] = {"seconds": time.perf_counter() - begun, "answer": answer}
            _note(script, done[name])
        lines = [f"{name}: {d['seconds']:.0f} s, {d['answer']}" for name, d in done.items()]
        lines += (
            [] if given.out else ["", "numbers and figures in these folders were overwritten; --out runs in a copy"]
        )
        return Reply({"studies": done}, "\n".join(lines))


def _note(script: Path, done: dict) -> None:
    """Write into `run.json` beside the numbers when and by which code a script ran."""
    path = script.parent / "run.json"
    kept = json.loads(path.read_text()) if path.exists() else {}
    commit = _git("rev-parse", "--short=7", "HEAD")
    if _git("status", "--porcelain", "--", str(source.ROOT), str(script.resolve())):
        commit += "-dirty"
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    said = {"date": now, "commit": commit or None, "source": source.LOADED, "seconds": round(done["seconds"], 1)}
    write_json(path, kept | {script.name: said | {"answer": done["answer"]}})


def _git(*asked: str) -> str:
    """What git says of this checkout; nothing where there is no git, or no checkout."""
    try:
        return subprocess.run(["git", "-C", str(source.ROOT), *asked], capture_output=True, text=True).stdout.strip()
    except OSError:
        return ""


def _copied(script: Path, out: Path) -> Path:
    """The same script in a copy of its folder; recordings are still found where the checkout has them."""
    folder, target = script.parent.resolve(), out / script.parent.resolve().name
    if not target.exists():
        shutil.copytree(folder, target, ignore=shutil.ignore_patterns("__pycache__"))
    beside = next((p / "shared" for p in folder.parents if (p / "shared").is_dir()), None)
    if beside is not None:
        os.environ.setdefault("TISSUEJAX_SHARED", str(beside))
    return target / script.name

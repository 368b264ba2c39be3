"""Is the cutting simulation right? Closed forms, meshes, balances, derivatives, cost, and the source's own run.

tissuejax study fits/cutting          about half an hour on a free core; parts that the same code made are kept

Each part is a function that gives plain numbers. PARTS="strip;cost" in the environment: only parts whose names begin so
(and such as are missing); PARTS=none draws page and figures of what is there.
"""

import runpy
import time
from pathlib import Path

import jax

from tissuejax.cache import source
from tissuejax.cache.parts import Parts

jax.config.update("jax_enable_x64", True)

PARTS = (
    "bonded", "peel", "strip", "beam", "strength", "steady", "meshes", "cost", "derivatives", "nearly", "solid",
    "separation", "recovery", "source",
)  # fmt: skip


def needed(folder: Path) -> dict[str, tuple[Path, ...]]:
    """Files beside the package that a part depends on, and what some need more; not those that draw."""
    tests = source.ROOT.parent / "tests" / "cutting"
    every = (folder / "cases.py", *(tests / f"{n}.py" for n in ("oracles", "slabs", "records")))
    more = {"separation": (folder / "separation.py",), "source": (folder / "source_run.py",)}
    return {part: every + more.get(part, ()) for part in PARTS}


def timed(work) -> dict:
    """What `work()` gives, and how long that took."""
    begun, cpu = time.perf_counter(), time.process_time()
    found = work()
    return found | {"seconds": {"wall": time.perf_counter() - begun, "cpu": time.process_time() - cpu}}


def main(folder: Path) -> str:
    """Run what is missing or of other code; write result.json and the figures; the answer in a sentence."""
    needs = needed(folder)
    kept = Parts(folder / "result.json", {file for files in needs.values() for file in files})
    cases = runpy.run_path(str(folder / "cases.py"))
    for part in PARTS:
        kept.get(part, lambda part=part: timed(cases[part]), needs[part])
    found = kept.parts
    runpy.run_path(str(folder / "page.py"))["write"](folder, found)
    whole = [r for r in found["recovery"]["runs"] if r["what"] == "entry included"]
    worst = {n: max(abs(r[f"{n}_percent"]) for r in whole) for n in ("energy", "strength", "friction")}
    off = ", ".join(f"{name} {most:.1f} %" for name, most in worst.items())
    answer = f"records of a finer mesh, {len(whole)} fits from 50 % off, at worst: {off}; see report.html"
    return ". ".join(filter(None, (answer, kept.said())))

"""Is the cutting simulation right? Closed forms, meshes, balances, derivatives, cost, and the source's own run.

tissuejax study fits/cutting          about half an hour on a free core; parts that are in result.json are kept

Each part is a function that gives plain numbers; delete its key from result.json to run it again.
"""

import json
import runpy
import time
from pathlib import Path

import jax

from tissuejax.storage import write_json

jax.config.update("jax_enable_x64", True)

PARTS = (
    "bonded", "peel", "strip", "beam", "strength", "steady", "meshes", "cost", "derivatives", "nearly", "solid",
    "separation", "recovery", "source",
)  # fmt: skip


def main(folder: Path) -> str:
    """Run the parts that are missing; write result.json and the figures; the answer in a sentence."""
    path = folder / "result.json"
    found = json.loads(path.read_text()) if path.exists() else {}
    cases = runpy.run_path(str(folder / "cases.py"))
    for part in PARTS:
        if part in found or part not in cases:
            continue
        begun, cpu = time.perf_counter(), time.process_time()
        found[part] = cases[part]()
        found[part]["seconds"] = {"wall": time.perf_counter() - begun, "cpu": time.process_time() - cpu}
        write_json(path, found)
    runpy.run_path(str(folder / "page.py"))["write"](folder, found)
    whole = [r for r in found["recovery"]["runs"] if r["what"] == "entry included"]
    worst = {n: max(abs(r[f"{n}_percent"]) for r in whole) for n in ("energy", "strength", "friction")}
    off = ", ".join(f"{name} {most:.1f} %" for name, most in worst.items())
    return f"records of a finer mesh, {len(whole)} fits from 50 % off, at worst: {off}; see report.html"

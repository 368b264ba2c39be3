"""What a user waits for: help, import, a look at a file, diagnoses of material tests and probings, in fresh processes.

    python tests/bench/bench_diagnosis.py [doors] [material] [p01 p02 p03 p04]

Each is run twice with one program cache: first empty, then filled. Wall and CPU seconds (of all processes; both cores).
Material tests: the first six of the sealed set whose seed is 450aa57 (`fits/challenge/material-eleventh`), made anew
here. Probings: the practice recordings beside the checkout, or where `TISSUEJAX_SHARED` says. What is named on the
command line is measured and replaces its lines in `results/diagnosis.json`, everything by default.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from bench_step import RESULTS, write

ROOT = Path(__file__).resolve().parents[2]
SHARED = Path(os.environ.get("TISSUEJAX_SHARED", ROOT.parent / "shared")) / "practice"
SEED, CASES = "450aa57b4a3e09a0a1ed2ac1415819d32a9c21d4", 6
DOORS = {
    "tissuejax --help": ("-m", "tissuejax", "--help"),
    "import tissuejax": ("-c", "import tissuejax"),
    "inspect": ("-m", "tissuejax", "inspect", str(ROOT / "data/demo/relaxing.h5")),
}


def timed(arguments: tuple[str, ...], cache: str) -> dict:
    """One run of Python with these arguments in a process of its own."""
    environment = os.environ | {"TISSUEJAX_CACHE": cache}
    environment.pop("JAX_COMPILATION_CACHE_DIR", None)
    before, begun = _spent(), time.perf_counter()
    subprocess.run([sys.executable, *arguments], env=environment, check=True, capture_output=True)
    return {"wall s": round(time.perf_counter() - begun, 2), "CPU s": round(_spent() - before, 2)}


def _spent() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def twice(arguments: tuple[str, ...]) -> dict:
    """With an empty cache, then with what that left."""
    with tempfile.TemporaryDirectory() as cache:
        return {"cold": timed(arguments, cache), "warm": timed(arguments, cache)}


def diagnosed(file: Path, *more: str) -> dict:
    """A diagnosis of one file as a user asks for it, cold and warm, and its answer."""
    with tempfile.TemporaryDirectory() as cache, tempfile.TemporaryDirectory() as out:
        figures = {}
        for name in ("cold", "warm"):
            there = Path(out) / name
            order = ("-m", "tissuejax", "diagnose", str(file), *more, "--out", str(there))
            figures[name] = timed(order, cache)
        said = json.loads((there / "result.json").read_text())
    return figures | {
        "answer": said["verdict"],
        "names": [e["name"] for e in said["effects"]],
        "load": os.getloadavg()[0],
    }


def of_cases() -> dict:
    """The first cases of a sealed set, made anew, and the median and the worst of them."""
    with tempfile.TemporaryDirectory() as folder:
        order = ("make", folder, "--kind", "material", "--count", str(CASES), "--commit", SEED)
        subprocess.run([sys.executable, "-m", "tissuejax", "challenge", *order], check=True, capture_output=True)
        manifest = json.loads((Path(folder) / "manifest.json").read_text())
        figures = {}
        for case in manifest["cases"]:
            file = Path(folder) / "cases" / f"{case['name']}.h5"
            figures[case["name"]] = diagnosed(file, "--energy", case["energy"])
            print(case["name"], figures[case["name"]], flush=True)
    walls = {state: [f[state]["wall s"] for f in figures.values()] for state in ("cold", "warm")}
    return {f"{s}: median, worst s": [float(np.median(w)), max(w)] for s, w in walls.items()} | figures


def main() -> None:
    asked = sys.argv[1:] or ["doors", "material", "p01", "p02", "p03", "p04"]
    kept = RESULTS / "diagnosis.json"
    figures = json.loads(kept.read_text()) if kept.exists() else {}
    for what in asked:
        if what == "doors":
            figures[what] = {name: twice(arguments) for name, arguments in DOORS.items()}
        elif what == "material":
            figures[what] = of_cases()
        else:
            figures[what] = diagnosed(SHARED / f"{what}.h5", "--energy", "reduced-polynomial-2")
        print(what, figures[what], flush=True)
        write("diagnosis", figures)


if __name__ == "__main__":
    main()

"""The whole of p01: two recordings fitted from a start 50 % off, the third predicted; programs compiled, then kept.

    python tests/bench/bench_probing.py [PRACTICE FOLDER]

Two processes (both cores). Run twice in fresh processes with one program cache: first empty, then filled. Writes
`results/probing.json`: wall seconds, CPU seconds of all processes, simulations and what was found.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from bench_step import write

START = {"energy.C10": 950.0, "energy.C20": 250.0, "volumetric.K": 30e3}


def once(practice: Path) -> dict:
    """One fit in this process."""
    begun = time.perf_counter()
    import tissuejax as tj
    from tissuejax.experiments.predictor import predictor
    from tissuejax.experiments.workers import _workers
    from tissuejax.fitting.options import Unknowns
    from tissuejax.fitting.probed import fit_probed
    from tissuejax.fitting.setup import problem
    from tissuejax.verbs import material

    sample = tj.read(practice / "p01.h5")
    model = material("reduced-polynomial-2", volumetric="quadratic")
    posed = problem(predictor(model, sample, ["r1", "r2"]), unknowns=Unknowns(start=START))
    found = fit_probed(posed, holdout=("r3",))
    wall = time.perf_counter() - begun
    for worker in _workers:
        worker.close()
    cpu = sum(
        getattr(resource.getrusage(who), f)
        for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
        for f in ("ru_utime", "ru_stime")
    )
    base = json.loads((practice / "keys-probing.json").read_text())["p01"]["base"]
    return {
        "wall s": round(wall, 1),
        "CPU s": round(cpu, 1),
        "simulations of the pair": found.simulations,
        "chi-square per sample": round(found.fit.chi2 / posed.n_samples, 3),
        "off the truth, %": {
            p.split(".")[1]: round(100 * (found.fit.values[p] / base[p.split(".")[1]] - 1), 1) for p in START
        },
        "load": os.getloadavg()[0],
    }


def main() -> None:
    root = Path(__file__).resolve().parents[2]
    shared = Path(os.environ.get("TISSUEJAX_SHARED", root.parent / "shared")) / "practice"
    figures = {}
    with tempfile.TemporaryDirectory() as cache:
        for name in ("compile included", "programs kept"):
            environment = os.environ | {"TISSUEJAX_CACHE": cache}
            environment.pop("JAX_COMPILATION_CACHE_DIR", None)
            told = subprocess.run(
                [sys.executable, __file__, "--once", str(shared)],
                env=environment,
                capture_output=True,
                text=True,
                check=True,
            )
            figures[name] = json.loads(told.stdout.splitlines()[-1])
            print(name, figures[name], flush=True)
    write("probing", figures)


if __name__ == "__main__":
    if "--once" in sys.argv:
        print(json.dumps(once(Path(sys.argv[-1]))))
    else:
        main()

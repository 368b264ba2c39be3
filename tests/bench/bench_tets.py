"""A step of tets with nodal pressure, and of hexes on one thread and on two. Run as a script.

    OMP_NUM_THREADS=1 XLA_FLAGS=--xla_cpu_multi_thread_eigen=false python tests/bench/bench_tets.py

Writes `results/tets.json`: nanoseconds of CPU time a tet and step (a cube of 10,368 tets, six to a hex), float32, N=4,
beside a hex of the same cube in turns; and the wall time of 8,000 hexes in a process with one thread and in one with
two, over each other.
"""

import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from bench_step import VALUES, cube, measure, write

from tissuejax.energies.reduced_polynomial import ReducedPolynomial
from tissuejax.energies.volumetric import Quadratic
from tissuejax.mesh.columns import box
from tissuejax.tled import build
from tissuejax.tled.simulate import compiled

SIX = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]  # tets about one diagonal
SIDE, ROUNDS = 12, 5
ALONE = {"OMP_NUM_THREADS": "1", "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false"}


def tets(n: int, steps: int):
    """The gravity cube of `bench_step`, each hex cut into six tets."""
    hexes = box((0.1, 0.1, 0.1), (n, n, n))
    cells = hexes.cells[:, np.array(SIX)].reshape(-1, 4)
    scene = build.scene(
        replace(hexes, cells=cells, cell_type="tetra"),
        build.Tissue(ReducedPolynomial(order=4), Quadratic(), VALUES, dict(K=2000.0), 981.0),
        np.arange(20) * 1e-3,
        gravity=(0, 0, -9.81),
    )
    step = 0.5 * float(scene.clock.step)
    return scene.put({"clock.interval": jnp.asarray(steps * step), "clock.steps": steps}).cast(jnp.float32)


def wall() -> None:
    """Print the best wall time of a run of 8,000 hexes, ns an element and step."""
    scene, best = cube(20, 4, jnp.float32), float("inf")
    jax.block_until_ready(compiled(scene))
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        jax.block_until_ready(compiled(scene))
        best = min(best, time.perf_counter() - begun)
    print(json.dumps(best / (len(scene.body.cells) * scene.clock.frames * scene.clock.steps) * 1e9))


def threads(several: bool) -> float:
    """`wall` in a process of its own, on one thread or on as many as there are cores."""
    environment = {k: v for k, v in os.environ.items() if k not in ALONE} | ({} if several else ALONE)
    done = subprocess.run(
        [sys.executable, __file__, "wall"], env=environment, cwd=Path(__file__).parent, check=True, capture_output=True
    )
    return round(float(done.stdout.split()[-1]), 1)


def main() -> None:
    found = measure({"a tet": tets(SIDE, 100), "a hex of the same cube": cube(SIDE, 4, jnp.float32)}, ROUNDS)
    one, two = threads(several=False), threads(several=True)
    write(
        "tets",
        {f"{6 * SIDE**3} tets, float32, N=4, ns of CPU time": {k: round(x, 1) for k, x in found.items()}}
        | {"8,000 hexes, wall ns": {"one thread": one, f"{os.cpu_count()} cores": two, "ratio": round(two / one, 2)}},
    )


if __name__ == "__main__":
    wall() if sys.argv[1:] == ["wall"] else main()

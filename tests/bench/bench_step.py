"""Time of one explicit step by elements, energy and precision; memory of a large body. Run as a script.

    OMP_NUM_THREADS=1 XLA_FLAGS=--xla_cpu_multi_thread_eigen=false python tests/bench/bench_step.py

Prints a table and writes `results/step.json`: nanoseconds of CPU time an element and step, the best of several, and
ratios (`bench_growth.py` draws how it grows). The energies of one size take turns, so that a busy machine disturbs
their ratio least.
"bent" is the same cube taken for general hexes, as bodies from a point cloud are.
"""

import functools
import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import yardstick

from tissuejax.energies.reduced_polynomial import ReducedPolynomial
from tissuejax.energies.volumetric import Quadratic
from tissuejax.mesh.columns import box
from tissuejax.tled import build
from tissuejax.tled.simulate import compiled

jax.config.update("jax_enable_x64", True)
RESULTS = Path(__file__).parent / "results"
VALUES = dict(C10=781.898, C20=-747.631, C30=426.135, C40=122.701)


def cube(n: int, order: int, dtype, steps: int = 0):
    """The gravity cube with n^3 hexes; 8 million element steps or more in 20 frames, and so many steps that what is
    worked out once a run does not count."""
    steps = steps or max(50, round(4e5 / n**3))
    values = {f"C{i}0": VALUES[f"C{i}0"] for i in range(1, order + 1)}
    scene = build.scene(
        box((0.1, 0.1, 0.1), (n, n, n)),
        build.Tissue(ReducedPolynomial(order=order), Quadratic(), values, dict(K=2000.0), 981.0),
        np.arange(20) * 1e-3,
        gravity=(0, 0, -9.81),
    )
    step = 0.5 * float(scene.clock.step)  # a corner of 27,000 hexes stiffens beyond the safe step at rest
    return scene.put({"clock.interval": jnp.asarray(steps * step), "clock.steps": steps}).cast(dtype)


def cpu(program, *arguments) -> float:
    """Seconds of CPU time of one call."""
    start = time.process_time()
    jax.block_until_ready(program(*arguments))
    return time.process_time() - start


def measure(scenes: dict, rounds: int = 5) -> dict:
    """Best nanoseconds an element and step of each scene, taken in turns."""
    best = dict.fromkeys(scenes, float("inf"))
    for name, scene in scenes.items():
        if int(compiled(scene).failed) >= 0:
            raise RuntimeError(f"{name} breaks down: the time of such a run says nothing")
    for _ in range(rounds):
        for name, scene in scenes.items():
            work = len(scene.body.cells) * scene.clock.frames * scene.clock.steps
            best[name] = min(best[name], cpu(compiled, scene) / work * 1e9)
    return best


def model() -> str:
    """The processor's name, as far as the system tells, and whether it has AVX-512."""
    try:
        told = Path("/proc/cpuinfo").read_text()
        name = told.split("model name")[1].split(":")[1].split("\n")[0].strip()
        return f"{name}, {'AVX-512' if 'avx512f' in told else 'no AVX-512'}"
    except (OSError, IndexError):
        return platform.processor() or platform.machine()


@functools.cache
def can() -> dict | None:
    """`yardstick.measure` and the step written by hand of 1,000 hexes, once a run; None where no C compiler is."""
    told, steps = yardstick.measure(), 500
    for precision, figures in (told or {}).items():
        hand = yardstick.Hand(cube(10, 4, jnp.dtype(precision).type, steps=50), precision)
        spent = yardstick.seconds(lambda: (hand.rest(), hand.run(steps)))  # noqa: B023
        figures["step written by hand, ns a hex"] = round(spent / (steps * 1000) * 1e9, 1)
    return told


def machine() -> dict:
    """Where the figures come from, and what that processor can do, measured in the same run: what they stand beside."""
    return {"processor": model(), "jax": jax.__version__, "load": os.getloadavg()[0], "yardstick": can()}


def write(name: str, figures: dict) -> None:
    """Print and store."""
    RESULTS.mkdir(exist_ok=True)
    text = json.dumps(figures | {"machine": machine()}, indent=1)
    (RESULTS / f"{name}.json").write_text(text + "\n")
    print(text)


def peak() -> int:
    """Most memory this process has held, MiB. (`ru_maxrss` would count that of the process that started it as well.)"""
    told = Path("/proc/self/status").read_text()
    return int(told.split("VmHWM:")[1].split()[0]) // 1024


def large() -> None:
    """Memory of a body of 85,184 hexes, in a process of its own."""
    scene = cube(44, 1, jnp.float32, steps=2)
    before = peak()
    jax.block_until_ready(compiled(scene))
    print(json.dumps({"peak memory MiB": peak(), "of it before the run (Python, JAX, mesh)": before}))


def main() -> None:
    figures = {}
    for n in (10, 20, 30):
        poly = cube(n, 4, jnp.float32)
        scenes = {
            "neo-Hookean float32": cube(n, 1, jnp.float32),
            "N=4 float32": poly,
            "N=4 float32, bent": poly.put({"body.element": poly.body.element.general}),
            "neo-Hookean float64": cube(n, 1, jnp.float64),
        }
        best = measure(scenes)
        figures[f"{n**3} hexes"] = {k: round(v, 1) for k, v in best.items()} | {
            "N=4 over neo-Hookean": round(best["N=4 float32"] / best["neo-Hookean float32"], 3),
            "float64 over float32": round(best["neo-Hookean float64"] / best["neo-Hookean float32"], 2),
        }
        print(f"{n**3} hexes", figures[f"{n**3} hexes"], flush=True)
    told = subprocess.run([sys.executable, __file__, "--large"], capture_output=True, text=True, check=True)
    figures["85184 hexes"] = json.loads(told.stdout.splitlines()[-1])
    write("step", {"unit": "ns of CPU time an element and step"} | figures)


if __name__ == "__main__":
    large() if "--large" in sys.argv else main()

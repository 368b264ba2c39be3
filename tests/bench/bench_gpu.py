"""The solver on a graphics card, beside the same machine's processor. Run as a script, once, where a card is.

    python tests/bench/bench_gpu.py

Writes `results/gpu.json` with the card's name: wall nanoseconds an element and step of 88,000 and of 1,000,000 hexes,
and the simulations that 256 diagnoses of one probing would ask for at once: 256 runs with constants of their own, and
256 Jacobians to five constants, over one of each. A ball pressed into a block, in double precision, says whether
both compute the same: the largest difference of its force and of the force's derivative, over their largest value.
A diagnosis itself is a search that the host drives, one question
after the other: it has no form as one batch. The processor's figures come from the same run, by a process of its own:
where a compiler is, the compiled loop on one core. Nothing in the project depends on a card.
"""

import json
import os
import subprocess
import sys
import time
import traceback
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
from bench_gradient import channels
from bench_step import VALUES, machine

from tissuejax.energies.reduced_polynomial import ReducedPolynomial
from tissuejax.energies.volumetric import Quadratic
from tissuejax.mesh.columns import box
from tissuejax.storage import write_json
from tissuejax.tled import build
from tissuejax.tled.simulate import COMPILER_OPTIONS, compiled, simulate

BODIES = {"88,000 hexes": (40, 44, 50), "1,000,000 hexes": (100, 100, 100)}
STEPS = {"88,000 hexes": 50, "1,000,000 hexes": 10}  # a frame, of 20 frames; a fifth of them on the processor
BATCH = 256
SMALL, SMALL_STEPS = (10, 10, 10), 25
ROUNDS = 3


def body(counts, steps: int, dtype):
    """A cube of soft tissue in gravity, 20 frames of so many steps."""
    scene = build.scene(
        box((0.1, 0.1, 0.1), counts),
        build.Tissue(ReducedPolynomial(order=4), Quadratic(), VALUES, dict(K=2000.0), 981.0),
        np.arange(20) * 1e-3,
        gravity=(0, 0, -9.81),
    )
    step = 0.5 * float(scene.clock.step)
    return scene.put({"clock.interval": jnp.asarray(steps * step), "clock.steps": steps}).cast(dtype)


def wall(program, *arguments) -> float:
    """Best seconds of a call that was compiled before."""
    jax.block_until_ready(program(*arguments))
    best = float("inf")
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        jax.block_until_ready(program(*arguments))
        best = min(best, time.perf_counter() - begun)
    return best


def step(name: str, dtype) -> float:
    """Nanoseconds an element and step."""
    steps = STEPS[name] if jax.default_backend() != "cpu" else STEPS[name] // 5
    scene = body(BODIES[name], steps, dtype)
    if int(compiled(scene).failed) >= 0:
        raise RuntimeError(f"{name} breaks down: the time of such a run says nothing")
    return 1e9 * wall(compiled, scene) / (len(scene.body.cells) * scene.clock.frames * scene.clock.steps)


def batch(count: int) -> dict[str, float]:
    """Seconds of so many small runs at once, and of their Jacobians to five constants."""
    scene = body(SMALL, SMALL_STEPS, jnp.float32)
    x = jnp.asarray(np.random.default_rng(1).uniform(0.9, 1.1, (count, 5)), jnp.float32)

    def jacobian(x):
        return jax.vmap(lambda d: jax.jvp(lambda x: channels(x, scene), (x,), (d,))[1])(jnp.eye(5, dtype=x.dtype))

    def jitted(f):
        return jax.jit(jax.vmap(f), compiler_options=COMPILER_OPTIONS)

    return {
        "runs": wall(jitted(lambda x: channels(x, scene)), x),
        "Jacobians": wall(jitted(jacobian), x),
    }


def pressed() -> dict[str, list[float]]:
    """Force on a ball that is pressed into a block, N, frame by frame, and its derivative by C10, N/Pa."""
    t = np.linspace(0, 1, 101)
    way = np.stack([0 * t, 0 * t, 0.0448 - 0.008 * t], 1)
    scene = build.scene(
        box((0.18, 0.115, 0.04), (14, 10, 5)),
        build.Tissue(ReducedPolynomial(order=2), Quadratic(), dict(C10=780.0, C20=300.0), dict(K=20e3), 1060.0),
        np.arange(6) / 6,
        build.ProbePath(t, way, 0.00475),
    )

    def force(stiffness):
        values = {"C10": stiffness, "C20": jnp.asarray(300.0)}
        return simulate(scene.put({"tissue.energy_values": values})).force[:, 2]

    both = jax.jit(lambda c: jax.jvp(force, (c,), (jnp.ones(()),)), compiler_options=COMPILER_OPTIONS)
    return dict(zip(("force", "derivative"), (x.tolist() for x in both(jnp.asarray(780.0))), strict=True))


def apart(card: dict, processor: dict) -> dict[str, float]:
    """Largest difference of each series, over its largest value."""
    return {
        name: float(np.max(np.abs(np.subtract(card[name], series))) / np.max(np.abs(series)))
        for name, series in processor.items()
    }


def figures() -> dict:
    """All of it on the device that JAX has; what fails says why."""
    found: dict = {"device": str(jax.devices()[0].device_kind)}
    jobs = {
        f"{name}, {np.dtype(dtype).name}, ns an element and step": lambda n=name, d=dtype: round(step(n, d), 2)
        for name in BODIES
        for dtype in (jnp.float32, jnp.float64)
    }
    counts = (1, BATCH) if jax.default_backend() != "cpu" else (1, 4)
    jobs |= {f"{n} of 1,000 hexes and 500 steps, s": lambda n=n: {k: round(s, 3) for k, s in batch(n).items()}
             for n in counts}  # fmt: skip
    jobs["pressed block"] = pressed
    for name, job in jobs.items():
        try:
            found[name] = job()
        except Exception as error:  # one that fails, for want of memory say, leaves the others
            found[name] = f"{type(error).__name__}: {str(error)[:300]}"
            traceback.print_exc()
        print(name, found[name], file=sys.stderr, flush=True)
    return found


def host() -> dict:
    """The processor's figures, from a process of its own."""
    environment = os.environ | {"JAX_PLATFORMS": "cpu", "OMP_NUM_THREADS": "1"}  # the loop would share two threads
    done = subprocess.run([sys.executable, __file__, "here"], env=environment, stdout=subprocess.PIPE, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def main() -> None:
    if jax.default_backend() == "cpu":
        raise SystemExit("no graphics card that JAX can compute on is here: bench_step.py measures the processor")
    target = Path(__file__).parent / "results" / "gpu.json"
    told: dict = {"machine": machine() | {"cores": os.cpu_count()}}
    for name, job in (("card", figures), ("processor", host)):
        told[name] = job()
        write_json(target, told)  # what was measured stays, should a later part be stopped
    told["apart"] = apart(told["card"].pop("pressed block"), told["processor"].pop("pressed block"))
    write_json(target, told)
    print(target.read_text())


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    print(json.dumps(figures())) if sys.argv[1:] == ["here"] else main()

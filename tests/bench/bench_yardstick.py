"""Our step over the hand-written one of `yardstick.c`, in one run and in turns. Run as a script, where a C compiler is.

    OMP_NUM_THREADS=1 XLA_FLAGS=--xla_cpu_multi_thread_eigen=false [TISSUEJAX_NATIVE=off] python ... [HEXES A SIDE ...]

Writes `results/yardstick_c.json`, or left to XLA `results/yardstick.json`: ns of CPU time an element and step,
and the ratio.
"""

import sys

import jax.numpy as jnp
import numpy as np
from bench_step import cpu, cube, write
from yardstick import Hand, library, seconds

from tissuejax.tled import native
from tissuejax.tled.simulate import compiled


def beside(n: int, precision: str, rounds: int = 5) -> dict:
    """Both steps on the gravity cube of n^3 hexes; how far their displacements are apart."""
    scene = cube(n, 4, jnp.dtype(precision).type, steps=max(50, 200_000 // n**3))
    steps = scene.clock.frames * scene.clock.steps
    hand, u = Hand(scene, precision), np.asarray(compiled(scene).state.u).T
    hand.run(steps)
    apart = float(np.abs(hand.u[:, :3] - u).max() / np.abs(u).max())
    ours = theirs = float("inf")
    for _ in range(rounds):
        hand.rest()
        theirs = min(theirs, seconds(lambda: hand.run(steps), 1))
        ours = min(ours, cpu(compiled, scene))
    work = steps * n**3 * 1e-9
    return {"ours, ns": round(ours / work, 1), "by hand, ns": round(theirs / work, 1),
            "ratio": round(ours / theirs, 2), "displacements apart": apart}  # fmt: skip


def main(sides: list[int]) -> None:
    if library("float32") is None:
        print("no C compiler here: nothing to hold our step against")
        return
    figures = {f"{n**3} hexes, {p}": beside(n, p) for n in sides for p in ("float32", "float64")}
    write(
        "yardstick_c" if native.wanted() else "yardstick",
        {"element loop in C": native.wanted()} | figures,
    )


if __name__ == "__main__":
    main([int(n) for n in sys.argv[1:]] or [10, 20, 30])

"""How the cost of a step, a run, a fit and a diagnosis grows: with elements, steps, recordings and candidates.

    OMP_NUM_THREADS=1 python tests/bench/bench_growth.py

Writes `results/growth.json` and `results/growth.png`: seconds of CPU time of this process, each measured after a first
call that compiles. Beside each series stands the power p of cost ~ n^p that a straight line through the logarithms has.
Recordings are those of `data/demo/relaxing.h5` over and over, each with noise of its own; candidates are effects of the
catalogue, the one that acts (viscoelasticity) first. `--draw` draws the stored figures again.
"""

import json
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from bench_step import RESULTS, cpu, cube, write

import tissuejax as tj
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.tled.simulate import compiled

DEMO = Path(__file__).parents[2] / "data/demo/relaxing.h5"
ENERGY, ACTS = "reduced-polynomial-2", "viscoelasticity"
ELEMENTS, STEPS, RECORDINGS, CANDIDATES = (5, 10, 20, 30), (250, 500, 1000, 2000), (2, 4, 8, 16), (1, 2, 4, 8, 16)


def repeated(n: int) -> Sample:
    """The demonstration's recordings, over and over, `n` in all."""
    sample, rng = tj.read(DEMO), np.random.default_rng(n)
    sources = list(sample.recordings.values())
    made = {}
    for i in range(n):
        one = sources[i % len(sources)]
        seen = one.channels["nominal_stress"]
        values = np.asarray(seen.values) + rng.normal(0.0, seen.noise_std, len(seen.values)) * (i >= len(sources))
        level = seen.noise_std * (2**0.5 if i >= len(sources) else 1.0)
        channel = Channel(seen.time, values, seen.unit, level)
        made[f"r{i}"] = Recording(f"r{i}", one.experiment, one.inputs, {"nominal_stress": channel}, one.attributes)
    return eqx.tree_at(lambda s: s.recordings, sample, made, is_leaf=lambda x: isinstance(x, dict))


def spent(call: Callable[[], object]) -> float:
    """Seconds of CPU time of a call that has been made before."""
    call()
    begun = time.process_time()
    call()
    return time.process_time() - begun


def power(n: Sequence[float], seconds: Sequence[float]) -> float:
    """p of seconds ~ n^p, by least squares of the logarithms."""
    return float(np.polyfit(np.log(n), np.log(seconds), 1)[0])


def series() -> dict[str, dict[str, dict[str, float]]]:
    """Seconds by what grows and by what was done."""
    found: dict[str, dict[str, dict[str, float]]] = {}
    steps = {}
    for n in ELEMENTS:
        scene = cube(n, 4, jnp.float32, steps=50)
        jax.block_until_ready(compiled(scene))
        steps[str(n**3)] = min(cpu(compiled, scene) for _ in range(3)) / (scene.clock.frames * scene.clock.steps)
    found["elements"] = {"a step": steps}
    runs = {}
    for n in STEPS:
        scene = cube(10, 4, jnp.float32, steps=n // 20)
        jax.block_until_ready(compiled(scene))
        runs[str(n)] = min(cpu(compiled, scene) for _ in range(3))
    found["steps"] = {"a run of 1,000 hexes": runs}
    samples = {n: repeated(n) for n in RECORDINGS}
    found["recordings"] = {
        "a fit": {str(n): spent(lambda s=s: tj.fit(s, energy=ENERGY, effects=[ACTS])) for n, s in samples.items()},
        "a diagnosis": {str(n): spent(lambda s=s: tj.diagnose(s, ENERGY)) for n, s in samples.items()},
    }
    offered = tj.diagnose(samples[4], ENERGY).answered.evidence.forms
    names = [ACTS, *(n for n in offered if n != ACTS)]
    counts = [n for n in CANDIDATES if n < len(names)] + [len(names)]
    found["candidates"] = {
        "a diagnosis": {str(n): spent(lambda n=n: tj.diagnose(samples[4], ENERGY, effects=names[:n])) for n in counts}
    }
    return found


def draw(found: dict[str, dict[str, dict[str, float]]]) -> None:
    """A panel for each thing that grows."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    figure = Figure(figsize=(12, 3.2), layout="constrained")
    for ax, (what, rows) in zip(figure.subplots(1, len(found)), found.items(), strict=True):
        n: list[float] = []
        for name, row in rows.items():
            n, seconds = [float(k) for k in row], list(row.values())
            ax.loglog(n, seconds, "o-", markersize=4, linewidth=1.2, label=f"{name}: power {power(n, seconds):.2f}")
        low, high = ax.get_ylim()
        ax.set(xlabel=what, ylabel="s of CPU time", ylim=(low / 1.2, high * 2.5))  # room for the legend
        ax.set_xticks(n, [f"{x:,.0f}" for x in n])
        ax.xaxis.set_minor_formatter(NullFormatter())
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 100 * low else (1.0,)))
        ax.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
        ax.yaxis.set_minor_formatter(NullFormatter())
        ax.tick_params(labelsize=8)
        ax.spines[["top", "right"]].set_visible(False)
        ax.legend(fontsize=8, frameon=False, loc="upper left")
    figure.savefig(RESULTS / "growth.png", dpi=110)


def main() -> None:
    if "--draw" in sys.argv:
        kept = json.loads((RESULTS / "growth.json").read_text())
        found = {k: v for k, v in kept.items() if k not in ("unit", "machine")}
    else:
        found = series()
        write("growth", {"unit": "s of CPU time, best of what was measured, programs compiled before"} | found)
    draw(found)


if __name__ == "__main__":
    main()

"""The source's probing simulator (4.1.2): the settled lobe in forty states of 0.3875 mm, stored, and played back.

python fits/source/states.py                 half a minute of a core; writes out/source/lobe.run.h5
tissuejax play out/source/lobe.run.h5        the page: its states, probe and force, interpolated

The study keeps its numbers as the part "forty states".
"""

import runpy
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from tissuejax.cache import source
from tissuejax.play.stored import Run, RunSession
from tissuejax.tled.stream import run_to_file

jax.config.update("jax_enable_x64", True)
HERE = Path(__file__).parent
COUNTS, RADIUS = (20, 16, 9), 10e-3
FRAMES = 4  # of each state


def main() -> dict:
    """Simulate, store, play back, and hold the force against that of the study and eq. 4.14."""
    lobe = runpy.run_path(str(HERE / "lobe.py"))
    out = source.ROOT.parent / "out" / "source" / "lobe.run.h5"
    out.parent.mkdir(parents=True, exist_ok=True)
    out.unlink(missing_ok=True)
    geometry, u = lobe["settled"](COUNTS)
    scene = lobe["press"](geometry, u, RADIUS)
    interval = lobe["DEEPEST"] / lobe["SPEED"] / lobe["STEPS"] / FRAMES
    steps = int(np.ceil(interval / float(scene.clock.compression) / float(scene.clock.step)))
    clock = {"start": jnp.asarray(lobe["START"]), "interval": jnp.asarray(interval)}
    scene = scene.put({f"clock.{k}": v for k, v in clock.items()} | {"clock.frames": 160, "clock.steps": steps})
    run_to_file(scene.cast(jnp.float32), out, chunk=FRAMES)
    run = Run(out)
    at = lobe["START"] + np.arange(1, 41) * seconds(lobe)
    force = np.array([run.force_at(t)[2] for t in at])
    jumps = np.abs(np.diff(force))
    session = RunSession(run, "lobe")
    session.advance(0.5 * (run.times[-1] - run.times[0]))
    between = [0.5 * (run.force_at(a)[2] + run.force_at(b)[2]) for a, b in zip(at[:-1], at[1:])]
    return {
        "states": len(run.states), "hexes": len(run.cells), "bytes": out.stat().st_size,
        "state_times_s": run.times, "depth_mm": 0.3875 * np.arange(1, 41), "force_N": force,
        "fitted": lobe["exponential"](0.3875 * np.arange(1, 41), force),
        "greatest_jump_N": float(jumps.max()),
        "greatest_jump_between_pictures_N": float(np.abs(np.diff([run.force_at(t)[2] for t in
                                                  np.arange(at[0], at[-1], 1 / 30)])).max()),
        "between_states_off_the_chord_N": float(np.abs(np.array(between) - [run.force_at(t)[2] for t in
                                                (at[:-1] + at[1:]) / 2]).max()),
        "greatest_node_step_mm": float(1e3 * np.abs(np.diff(run.states, axis=0)).max()),
        "frame_bytes": len(session.frame(1)),
    }  # fmt: skip


def seconds(lobe: dict) -> float:
    """Seconds of one state."""
    return lobe["DEEPEST"] / lobe["SPEED"] / lobe["STEPS"]


if __name__ == "__main__":
    for name, value in main().items():
        if np.ndim(value) == 0:
            print(name, value)

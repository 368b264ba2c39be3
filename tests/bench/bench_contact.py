"""What contact adds to a step: a liver of 700 hexes with and without a probe on it. Run as a script.

The body has the size of the source's lobe (180 x 115 x 40 mm, 4.3.5: 708 hexes). Writes `results/contact.json`.
"""

import jax
import jax.numpy as jnp
import numpy as np
from bench_step import cpu, write

from tissuejax.energies.reduced_polynomial import ReducedPolynomial
from tissuejax.energies.volumetric import Quadratic
from tissuejax.mesh.columns import box
from tissuejax.tled import build
from tissuejax.tled.simulate import compiled

VALUES = dict(C10=781.898, C20=-747.631, C30=426.135, C40=122.701)


def main() -> None:
    t = np.linspace(0, 1.0, 101)
    position = np.stack([0 * t, 0 * t, 0.04 + 0.0048 - 0.008 * t], 1)
    scene = build.scene(
        box((0.18, 0.115, 0.04), (14, 10, 5)),
        build.Tissue(ReducedPolynomial(order=4), Quadratic(), VALUES, dict(K=20e3), 1060.0),
        np.arange(60) / 60,
        build.ProbePath(t, position, 0.00475),
    ).cast(jnp.float32)
    scenes = {"probe": scene, "alone": scene.put({"probe": None})}
    best = dict.fromkeys(scenes, float("inf"))
    for s in scenes.values():
        jax.block_until_ready(compiled(s))
    for _ in range(8):
        for name, s in scenes.items():
            best[name] = min(best[name], cpu(compiled, s))
    steps = scene.clock.frames * scene.clock.steps
    write(
        "contact",
        {
            "hexes": len(scene.body.cells),
            "contact points": int((scene.probe.area > 0).sum()),
            "steps per second of CPU time": round(steps / best["probe"]),
            "share of contact in a step, %": round(100 * (1 - best["alone"] / best["probe"]), 1),
        },
    )


if __name__ == "__main__":
    main()

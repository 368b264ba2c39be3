"""Why was the source's real-time force too stiff? Its tissue lived in slow motion, and its contact was between spheres.

tissuejax study fits/slow-motion            a minute

A simulator that computes s seconds of tissue in a second shows its tissue a hand that is 1 / s times faster. The same
press is simulated at the speeds that the tissue then sees; and the same depth is pressed with the ball that collision
spheres make of a probe (radius of the spheres on the tissue plus those on the probe).
"""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from tissuejax.energies import catalogue
from tissuejax.experiments.probing import assembled
from tissuejax.mesh.columns import box, lobe_of_mesh
from tissuejax.model import Model
from tissuejax.storage import write_json
from tissuejax.surrogate.ramp import Matter, bare_setup, ramp
from tissuejax.surrogate.site_mesh import Grid, geometry, topology
from tissuejax.tled.simulate import run

jax.config.update("jax_enable_x64", True)

RADIUS, TOP, DEPTH = 4.75e-3, 0.02, 9e-3
SPEEDS = (0.03, 0.1, 0.2, 0.46)  # m/s that the tissue sees
DAMPING = 50.0  # 1/s, of the source's file
# published: pictures a second, each 0.95 ms of tissue (Lister 2012, 4.3.4 and 4.3.5)
RATES = {"cube, neo-Hookean": 301, "cube, polynomial": 283, "liver": 234, "liver and torso": 170, "collision on": 137,
         "in contact, fastest": 50, "in contact, slowest": 23}  # fmt: skip
STEP = 0.95e-3
SPHERES = (9e-3, 2.5e-3)  # m, on the tissue and on the probe (source, appendix B)


def matter(radius: float) -> Matter:
    """A slab of liver-like tissue under a ball."""
    model = Model(catalogue.energy("reduced-polynomial-2"), catalogue.volumetric("quadratic"))
    values = {"energy.C10": 645.0, "energy.C20": 500.0, "volumetric.K": 20e3}
    return Matter(model, values, lobe_of_mesh(box((0.06, 0.06, TOP), (4, 4, 2))), radius, 1060.0)


def pressed(speed: float) -> dict:
    """Force over depth of one press at a speed, without memory in the tissue: inertia and damping alone act."""
    grid, tissue = Grid((16, 16, 6), RADIUS), matter(RADIUS)
    body = geometry(tissue.lobe, np.zeros(2), grid)
    setup = bare_setup(tissue, body, topology(grid)[2], np.zeros(2), TOP + RADIUS)
    scene, _ = assembled(tissue.model, {k: jnp.asarray(v) for k, v in tissue.values.items()}, setup)
    lasts = (DEPTH + 2e-4) / speed
    time, depth = np.array([0.0, lasts]), np.array([-2e-4, DEPTH])
    path = np.stack([0 * depth, 0 * depth, TOP + RADIUS - depth], 1)
    frames = 120
    steps = max(1, int(np.ceil(lasts / frames / float(scene.clock.step))))
    changes = {
        "probe.time": jnp.asarray(time), "probe.position": jnp.asarray(path), "clock.frames": frames,
        "clock.interval": jnp.asarray(lasts / frames), "clock.steps": steps,
        "settings.mass_damping": jnp.asarray(DAMPING),
    }  # fmt: skip
    scene = scene.put(changes)
    out = run(scene)
    at = np.interp(np.asarray(out.time), time, depth)
    force = np.asarray(out.force)[:, 2]
    deep = at > 2e-3
    return {
        "depth": at, "force": force, "mean": float(force[deep].mean()), "peak": float(force.max()),
        "work": float(np.trapezoid(force, at)), "without_contact": float((force[at > 0.5e-3] < 1e-4).mean()),
    }  # fmt: skip


def main(folder: Path) -> str:
    """Write result.json and figures/slow.png; the answer in a sentence."""
    (folder / "figures").mkdir(exist_ok=True)
    runs = {speed: pressed(speed) for speed in SPEEDS}
    slow = runs[SPEEDS[0]]
    table = {
        f"{1e3 * speed:g} mm/s": {k: r[k] / slow[k] for k in ("mean", "work", "peak")}
        | {"without_contact": r["without_contact"]}
        for speed, r in runs.items()
    }
    depths = np.array([2e-3, 4e-3, 6e-3])
    balls = {
        r: ramp(matter(r), Grid((16, 16, 6), r), np.zeros(2), TOP + r, depths).force[:, 2]
        for r in (RADIUS, sum(SPHERES))
    }
    ratio = balls[sum(SPHERES)] / balls[RADIUS]
    result = {
        "simulated_over_wall": {k: STEP * v for k, v in RATES.items()}, "speeds": table,
        "spheres": {"radius_m": sum(SPHERES), "depth_m": depths.tolist(), "force_ratio": ratio.tolist()},
    }  # fmt: skip
    write_json(folder / "result.json", result)
    figure = Figure(figsize=(6, 3.4), layout="constrained")
    ax = figure.subplots()
    for (speed, r), shade in zip(runs.items(), ["#9ecae1", "#4292c6", "#2171b5", "#08306b"]):
        ax.plot(1e3 * r["depth"], r["force"], color=shade, linewidth=1.3, label=f"tissue sees {1e3 * speed:g} mm/s")
    ax.plot(
        1e3 * depths,
        balls[sum(SPHERES)],
        "o-",
        color="#c0392b",
        markersize=4,
        linewidth=1,
        label="at rest, 11.5 mm sphere",
    )
    ax.set_xlabel("depth (mm)")
    ax.set_ylabel("force (N)")
    ax.legend(fontsize=7)
    ax.spines[["top", "right"]].set_visible(False)
    figure.savefig(folder / "figures" / "slow.png", dpi=110)
    last = table[f"{1e3 * SPEEDS[-1]:g} mm/s"]
    faster = f"mean force x {last['mean']:.2f} at {1e3 * SPEEDS[-1]:g} mm/s"
    return f"{faster}; with collision spheres x {ratio[0]:.1f} to {ratio[-1]:.1f}"


if __name__ == "__main__":
    print(main(Path(__file__).parent))

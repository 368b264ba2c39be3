"""Why was the source's real-time force too stiff? Its tissue lived in slow motion, its contact was between spheres, and
its elements were larger than the probe. Each of the three alone is simulated here.

tissuejax study fits/slow-motion            about two minutes of one core
"""

import runpy
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
jax.config.update("jax_cpu_enable_async_dispatch", False)  # as `play --direct`: a short call is not handed on

spheres, direct = (runpy.run_path(str(Path(__file__).with_name(f"{name}.py"))) for name in ("spheres", "direct"))
SIZE, RADIUS, TOP, DEPTH = (0.06, 0.06, 0.02), 4.75e-3, 0.02, 9e-3
SPEEDS = (0.03, 0.1, 0.2, 0.46)  # m/s that the tissue sees; 0.46 is a hand at 10 mm/s in the slowest contact
DAMPING = 50.0  # 1/s, of the source's file
DEPTHS = np.array([1, 2, 4, 6, 8, 10]) * 1e-3
COARSE, FINER = (6, 6, 2), (10, 10, 3)  # elements of 10 mm, as in the source's liver, and of 6 mm
# published: pictures a second, each 0.95 ms of tissue (Lister 2012, 4.3.4 and 4.3.5)
RATES = {"cube, neo-Hookean": 301, "cube, polynomial": 283, "liver": 234, "liver and torso": 170, "collision on": 137,
         "in contact, fastest": 50, "in contact, slowest": 23}  # fmt: skip
STEP = 0.95e-3


def matter(radius: float) -> Matter:
    """A slab of liver-like tissue under a ball."""
    model = Model(catalogue.energy("reduced-polynomial-2"), catalogue.volumetric("quadratic"))
    values = {"energy.C10": 645.0, "energy.C20": 500.0, "volumetric.K": 20e3}
    return Matter(model, values, lobe_of_mesh(box(SIZE, (4, 4, 2))), radius, 1060.0)


def pressed(speed: float) -> dict:
    """Force over depth of one press at a speed, without memory in the tissue: inertia and damping alone act."""
    grid, tissue = Grid((16, 16, 6), RADIUS), matter(RADIUS)
    body = geometry(tissue.lobe, np.zeros(2), grid)
    setup = bare_setup(tissue, body, topology(grid)[2], np.zeros(2), TOP + RADIUS)
    scene, _ = assembled(tissue.model, {k: jnp.asarray(v) for k, v in tissue.values.items()}, setup)
    lasts = (DEPTH + 2e-4) / speed
    clock, depth = np.array([0.0, lasts]), np.array([-2e-4, DEPTH])
    path = np.stack([0 * depth, 0 * depth, TOP + RADIUS - depth], 1)
    frames = 120
    steps = max(1, int(np.ceil(lasts / frames / float(scene.clock.step))))
    changes = {
        "probe.time": jnp.asarray(clock), "probe.position": jnp.asarray(path), "clock.frames": frames,
        "clock.interval": jnp.asarray(lasts / frames), "clock.steps": steps,
        "settings.mass_damping": jnp.asarray(DAMPING),
    }  # fmt: skip
    scene = scene.put(changes)
    out = run(scene)
    at = np.interp(np.asarray(out.time), clock, depth)
    force = np.asarray(out.force)[:, 2]
    deep = at > 2e-3
    return {
        "depth": at, "force": force, "mean": float(force[deep].mean()), "peak": float(force.max()),
        "work": float(np.trapezoid(force, at)), "without_contact": float((force[at > 0.5e-3] < 1e-4).mean()),
    }  # fmt: skip


def draw(runs: dict, truth: np.ndarray, ball: np.ndarray, coarse: dict) -> Figure:
    """Slow motion at the left, contact at the right."""
    figure = Figure(figsize=(10, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    for (speed, r), shade in zip(runs.items(), ["#9ecae1", "#4292c6", "#2171b5", "#08306b"]):
        left.plot(1e3 * r["depth"], r["force"], color=shade, linewidth=1.3, label=f"tissue sees {1e3 * speed:g} mm/s")
    left.set_title("slow motion: the hand is faster than life", fontsize=9)
    right.plot(1e3 * DEPTHS, truth, "k-", linewidth=1.6, label="ball of 4.75 mm, fine mesh")
    right.plot(1e3 * DEPTHS, ball, "k:", linewidth=1.3, label="ball of 11.5 mm, fine mesh")
    colours = {"ball against facets": "#2171b5", "spheres of the surface": "#e8a49c", "spheres of all nodes": "#c0392b"}
    for kind, colour in colours.items():
        for where, mark in (("over a node", "-"), ("between nodes", "--")):
            right.plot(1e3 * DEPTHS, coarse[where][kind], mark, color=colour, linewidth=1.1, label=f"{kind}, {where}")
    right.set_title("contact on elements of 10 mm", fontsize=9)
    left.legend(fontsize=6)
    right.legend(fontsize=6, loc="center left", bbox_to_anchor=(1, 0.5))
    for ax in (left, right):
        ax.set_xlabel("depth (mm)")
        ax.set_ylabel("force (N)")
        ax.set_ylim(-0.02, 1.15)
        ax.spines[["top", "right"]].set_visible(False)
    return figure


def main(folder: Path) -> str:
    """Write result.json and figures/slow.png; the answer in a sentence."""
    (folder / "figures").mkdir(exist_ok=True)
    runs = {speed: pressed(speed) for speed in SPEEDS}
    slow = runs[SPEEDS[0]]
    speeds = {
        f"{1e3 * speed:g} mm/s": {k: r[k] / slow[k] for k in ("mean", "work", "peak")}
        | {"without_contact": r["without_contact"]}
        for speed, r in runs.items()
    }
    reach = spheres["TISSUE"] + spheres["PROBE"]
    truth, ball = (
        ramp(matter(r), Grid((16, 16, 6), r), np.zeros(2), TOP + r, DEPTHS).force[:, 2] for r in (RADIUS, reach)
    )
    result = {
        "simulated_over_wall": {k: STEP * v for k, v in RATES.items()},
        "speeds": speeds,
        "depth_m": DEPTHS, "force_N": truth,
        "smooth ball": {"radius_m": reach, "force_ratio": ball / truth},
        "contact": [spheres["table"](matter(RADIUS), SIZE, counts, DEPTHS) for counts in (COARSE, FINER)],
    }  # fmt: skip
    write_json(folder / "result.json", result)
    draw(runs, truth, ball, result["contact"][0]).savefig(folder / "figures" / "slow.png", dpi=110)
    result["ours"] = direct["paces"](matter(RADIUS), RADIUS)
    write_json(folder / "result.json", result)
    last, at = speeds[f"{1e3 * SPEEDS[-1]:g} mm/s"], list(DEPTHS).index(2e-3)
    coarse = result["contact"][0]
    low, high = (coarse[w]["spheres of all nodes"][at] / truth[at] for w in ("over a node", "between nodes"))
    return (
        f"mean force x {last['mean']:.2f} at {1e3 * SPEEDS[-1]:g} mm/s; with spheres on elements of 10 mm x "
        f"{low:.1f} to {high:.1f} at 2 mm, smooth x {ball[at] / truth[at]:.1f}"
    )


if __name__ == "__main__":
    print(main(Path(__file__).parent))

"""Would hourglass stiffness that follows the present modulus matter? A ball pressed into a slab, statically.

Hourglass control is a share of the shear modulus at rest. Under a deep probe a law that stiffens has a larger modulus,
so the control is a smaller share of it. Here the share itself is varied twentyfold, for a mild and a steep law, beside
a finer mesh: what a modulus that grows n times under the ball would do is bounded by what a share n times as large does
everywhere. Beside it a cube squashed between bonded plates (`cube.py`), and what a step of each element costs.

tissuejax study fits/elements
"""

import runpy
import time
from pathlib import Path

import jax
import numpy as np
from matplotlib.figure import Figure

from tissuejax.energies import catalogue
from tissuejax.energies.reduced_polynomial import ReducedPolynomial
from tissuejax.energies.volumetric import Quadratic
from tissuejax.experiments.probing_settings import ProbingSettings
from tissuejax.mesh.columns import box, lobe_of_mesh
from tissuejax.model import Model
from tissuejax.storage import write_figure, write_json
from tissuejax.surrogate.ramp import Matter, ramp
from tissuejax.surrogate.site_mesh import Grid
from tissuejax.tled import build
from tissuejax.tled.simulate import compiled

jax.config.update("jax_enable_x64", True)

RADIUS, TOP, DEPTHS = 4.75e-3, 0.02, np.array([1e-3, 2e-3, 3e-3, 4e-3])
LAWS = {
    "mild (C10 645, C20 500 Pa)": ("reduced-polynomial-2", {"energy.C10": 645.0, "energy.C20": 500.0}),
    "steep (Demiray, mu 1290 Pa, b 6)": ("demiray", {"energy.mu": 1290.0, "energy.b": 6.0}),
}
SHARES, MESHES = (0.05, 0.1, 0.3, 1.0), {"576 hexes": (12, 12, 4), "1,536 hexes": (16, 16, 6)}
BLOCK = 10  # elements along each edge of the cube that is timed


def pressed(law: str, counts: tuple[int, int, int], share: float) -> list[float]:
    """Force at each depth, N."""
    name, values = LAWS[law]
    model = Model(catalogue.energy(name), catalogue.volumetric("quadratic"), ())
    lobe = lobe_of_mesh(box((0.06, 0.06, TOP), (4, 4, 2)))
    given = model.defaults | values | {"volumetric.K": 20e3}
    matter = Matter(model, given, lobe, RADIUS, 1060.0, ProbingSettings(hourglass=share))
    return ramp(matter, Grid(counts, RADIUS), np.zeros(2), TOP + RADIUS, DEPTHS).force[:, 2].tolist()


def cost(element: str | None) -> float:
    """CPU time of an element and step of a free cube, ns, the best of five runs of 200 steps."""
    g = box((0.1, 0.1, 0.1), (BLOCK,) * 3)
    scene = build.scene(
        g,
        build.Tissue(ReducedPolynomial(order=1), Quadratic(), {"C10": 500.0}, {"K": 15e3}, 1000.0),
        np.arange(1, 3) * 0.1,
        numerics=build.Numerics(element=element),
        gravity=(0.0, 0.0, -1.0),
    ).put({"clock.steps": 100})
    compiled(scene).state.u.block_until_ready()
    best = np.inf
    for _ in range(5):
        begun = time.process_time()
        compiled(scene).state.u.block_until_ready()
        best = min(best, time.process_time() - begun)
    return 1e9 * best / (200 * BLOCK**3)


def main(folder: Path) -> str:
    """Forces by share and mesh, and costs; result.json and a figure."""
    record: dict = {"depth_m": DEPTHS.tolist(), "force_N": {}}
    cube = runpy.run_path(str(folder / "cube.py"))
    record["cube squashed to 0.7"] = cube["squashed"]()
    write_json(folder / "result.json", record)
    write_figure(folder / "figures" / "cube.png", converging(record["cube squashed to 0.7"]), dpi=110)
    probing = runpy.run_path(str(folder / "probing.py"))
    if probing["practice"]().is_dir():
        record["p01 at its true constants, chi-square of the force a sample"] = probing["misfits"]()
    record["ns_an_element_and_step"] = {name or "hexahedron": cost(name) for name in (None, "hexahedron-bending")}
    for law in LAWS:
        found = record["force_N"][law] = {}
        for mesh, counts in MESHES.items():
            for share in SHARES if mesh == next(iter(MESHES)) else (0.1, 0.3):
                found[f"{mesh}, share {share:g}"] = pressed(law, counts, share)
                write_json(folder / "result.json", record)
    write_figure(folder / "figures" / "hourglass.png", drawn(record), dpi=110)
    steep = record["force_N"][list(LAWS)[1]]
    first, third = (np.array(steep[f"576 hexes, share {s:g}"]) for s in (0.1, 0.3))
    return f"steep law: three times the share moves the force by at most {np.max(np.abs(third / first - 1)):.1%}"


def drawn(record) -> Figure:
    """Force over that of the finer mesh at a share of 0.1, by depth; a panel a law."""
    figure = Figure(figsize=(9, 3.2), layout="constrained")
    axes = figure.subplots(1, len(LAWS), sharey=True)
    for ax, (law, found) in zip(axes, record["force_N"].items(), strict=True):
        base = np.array(found["1,536 hexes, share 0.1"])
        for name, force in found.items():
            fine = name.startswith("1,536")
            ax.plot(1e3 * DEPTHS, 100 * (np.array(force) / base - 1), "--s" if fine else "-o", markersize=4, label=name)
        ax.set_title(law, loc="left", fontsize=9)
        ax.set_xlabel("depth (mm)")
        ax.grid(color="#e6ebef")
    axes[0].set_ylabel("force over that of the finer\nmesh, share 0.1 (%)")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right center", frameon=False, fontsize=8)
    return figure


def converging(cube: dict) -> Figure:
    """Error of the plate's force by elements along an edge; a panel for each ratio of bulk to shear modulus."""
    figure = Figure(figsize=(9, 3.2), layout="constrained")
    axes = figure.subplots(1, len(cube), sharey=True)
    for ax, (ratio, found) in zip(axes, cube.items(), strict=True):
        for name, errors in found["error_percent"].items():
            style = "k--s" if "felupe" in name else "-o"
            ax.semilogx([int(n) for n in errors], list(errors.values()), style, markersize=4, label=name)
        ax.set_title(ratio, loc="left", fontsize=9)
        ax.set_xticks([4, 8, 16, 24], labels=["4", "8", "16", "24"])
        ax.minorticks_off()
        ax.set_xlabel("elements along an edge of the cube")
        ax.grid(color="#e6ebef")
    axes[0].set_ylabel("force over the limit (%)")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right center", frameon=False, fontsize=8)
    return figure


if __name__ == "__main__":
    print(main(Path(__file__).parent))

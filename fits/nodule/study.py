"""Is a stiff nodule felt while the probe is dragged over it, where, and how soft or deep may it be?

tissuejax study fits/nodule            some minutes

The ball is drawn along a line at one depth over a slab with one nodule; the force of a slab without it is taken off.
"""

from pathlib import Path

import jax
import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import make_interp_spline

from tissuejax.effects.inclusion import Inclusion
from tissuejax.energies import catalogue
from tissuejax.mesh.columns import box, lobe_of_mesh
from tissuejax.model import Model
from tissuejax.progress import for_terminal
from tissuejax.storage import write_json
from tissuejax.surrogate.ramp import Matter, ramp
from tissuejax.surrogate.site_mesh import Grid

jax.config.update("jax_enable_x64", True)

RADIUS, TOP, DEPTH = 4.75e-3, 0.02, 4e-3
SITES = np.linspace(-0.012, 0.012, 9)
NODULE, PLACE = 4e-3, 2e-3  # m: its radius, and where it lies along the line
CASES = {"x10, 6 mm deep": (10, 6e-3), "x3, 6 mm deep": (3, 6e-3), "x1.5, 6 mm deep": (1.5, 6e-3),
         "x10, 10 mm deep": (10, 10e-3), "x10, 14 mm deep": (10, 14e-3)}  # fmt: skip
NOTICED, NOISE = 0.1, 0.003  # N: what a hand notices (Lister 2012, 2.2.5); noise of a force sensor


def matter(stiffer: float | None, deep: float = 0.0) -> Matter:
    """A slab, with a nodule so many times stiffer whose middle lies so deep."""
    effects, values = (), {"energy.C10": 645.0, "energy.C20": 500.0, "volumetric.K": 20e3}
    if stiffer is not None:
        effects = (Inclusion(),)
        given = {"contrast": np.log(stiffer), "radius": NODULE, "x": PLACE, "y": 0.0, "z": TOP - deep}
        values = values | {f"effects.inclusion.{k}": float(v) for k, v in given.items()}
    model = Model(catalogue.energy("reduced-polynomial-2"), catalogue.volumetric("quadratic"), effects)
    return Matter(model, model.defaults | values, lobe_of_mesh(box((0.06, 0.06, TOP), (4, 4, 2))), RADIUS, 1060.0)


def line(tissue: Matter, stage) -> np.ndarray:
    """Vertical force at the sites, N."""
    force = []
    for x in SITES:
        force.append(
            ramp(tissue, Grid((16, 16, 6), RADIUS), np.array([x, 0.0]), TOP + RADIUS, np.array([DEPTH])).force[0, 2]
        )
        stage.advance()
    return np.array(force)


def main(folder: Path) -> str:
    """Write result.json and figures/nodule.png; the answer in a sentence."""
    (folder / "figures").mkdir(exist_ok=True)
    found, fine = {}, np.linspace(SITES[0], SITES[-1], 481)
    figure = Figure(figsize=(6, 3.4), layout="constrained")
    ax = figure.subplots()
    with for_terminal().stage("sites", len(SITES) * (len(CASES) + 1)) as stage:
        bare = line(matter(None), stage)
        for (name, (stiffer, deep)), shade in zip(
            CASES.items(), ["#08306b", "#2171b5", "#9ecae1", "#c0392b", "#e8a49c"]
        ):
            added = make_interp_spline(SITES, line(matter(stiffer, deep), stage) - bare)(fine)
            peak = float(added.max())
            found[name] = {
                "added_force_N": peak, "peak_off_m": float(fine[added.argmax()] - PLACE),
                "over_a_just_noticeable": peak / NOTICED,
                "over_sensor_noise": peak / NOISE,
            }  # fmt: skip
            ax.plot(1e3 * fine, 1e3 * added, color=shade, linewidth=1.4, label=name)
            write_json(folder / "result.json", {"without": bare, "sites_m": SITES, "nodules": found})
    ax.axvline(1e3 * PLACE, color="#999", linewidth=0.8, linestyle=":")
    ax.set_xlabel("place of the ball along the line (mm); the nodule's middle is dotted")
    ax.set_ylabel("force added by the nodule (mN)")
    ax.legend(fontsize=7)
    ax.spines[["top", "right"]].set_visible(False)
    figure.savefig(folder / "figures" / "nodule.png", dpi=110)
    first = found[next(iter(CASES))]
    return (
        f"{next(iter(CASES))}: {1e3 * first['added_force_N']:.0f} mN more, peak {1e3 * first['peak_off_m']:+.1f} mm off"
    )


if __name__ == "__main__":
    print(main(Path(__file__).parent))

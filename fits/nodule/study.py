"""Is a stiff nodule felt while the probe is dragged over it, where, and how soft or deep may it be?

tissuejax study fits/nodule            some minutes

The ball is drawn along a line at one depth over a slab with one nodule; the force of a slab without it is taken off.
Then the ball is pressed right above nodules of many stiffnesses and depths, and between them the stiffness is sought
at which the added force falls to what a sensor or a hand can tell; three of these are simulated to check.
"""

from pathlib import Path

import jax
import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import PchipInterpolator, make_interp_spline

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
STIFFER, DEEP = np.array([1.25, 1.5, 2, 3, 10]), np.array([6, 8, 10, 12, 14, 16]) * 1e-3  # nodules of the map
PRESSED = np.array([4e-3, 7e-3])
SEEN = {
    "sensor, pressed 4 mm": (3 * NOISE, 0),
    "sensor, pressed 7 mm": (3 * NOISE, 1),
    "hand, pressed 4 mm": (NOTICED, 0),
    "hand, pressed 7 mm": (NOTICED, 1),
}  # N, which of PRESSED
CHECKED = [("sensor, pressed 4 mm", 6e-3), ("sensor, pressed 4 mm", 11e-3), ("hand, pressed 7 mm", 7e-3)]


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


def above(tissue: Matter) -> np.ndarray:
    """Vertical force of a ball right above the nodule at the depths PRESSED, N."""
    return ramp(tissue, Grid((16, 16, 6), RADIUS), np.array([PLACE, 0.0]), TOP + RADIUS, PRESSED).force[:, 2]


class Map:
    """Added force over stiffness and depth of the nodule: (depth, stiffness) at one press depth, N."""

    def __init__(self, added: np.ndarray):
        stiff = np.append(0.0, np.log(STIFFER))
        self.fine = np.linspace(0, stiff[-1], 400)
        through = np.array([PchipInterpolator(stiff, np.append(0.0, row))(self.fine) for row in added])
        self.over_depth = PchipInterpolator(DEEP, np.log(np.maximum(through[:, 1:], 1e-9)))

    def softest(self, deep: float, wanted: float) -> float | None:
        """How many times as stiff as its surroundings a nodule has to be to add so much; None: not even 10 times."""
        added = np.append(0.0, np.exp(self.over_depth(deep)))
        return float(np.exp(np.interp(wanted, added, self.fine))) if added[-1] >= wanted else None

    def deepest(self, stiffer: float, wanted: float) -> float | None:
        """Depth of the middle, m, below which a nodule adds less; None: at no depth of the map as much."""
        found = [d for d in np.linspace(DEEP[0], DEEP[-1], 1001) if (self.softest(d, wanted) or np.inf) <= stiffer]
        return float(max(found)) if found else None


def limits(stage) -> dict:
    """Where a nodule is lost, between those of the map; and what the full model says there."""
    bare = above(matter(None))
    stage.advance()
    added = np.zeros((len(PRESSED), len(DEEP), len(STIFFER)))
    for i, deep in enumerate(DEEP):
        for j, stiffer in enumerate(STIFFER):
            added[:, i, j] = above(matter(stiffer, deep)) - bare
            stage.advance()
    maps = [Map(a) for a in added]
    lost = {}
    for name, (wanted, which) in SEEN.items():
        lost[name] = {
            "criterion_N": wanted,
            "softest_at_depth_m": {f"{d:g}": maps[which].softest(d, wanted) for d in DEEP},
            "deepest_at_stiffness_m": {f"{c:g}": maps[which].deepest(c, wanted) for c in STIFFER},
        }
    checked = []
    for name, deep in CHECKED:
        wanted, which = SEEN[name]
        stiffer = maps[which].softest(deep, wanted)
        if stiffer is not None:
            there = float((above(matter(stiffer, deep)) - bare)[which])
            checked.append(
                {"of": name, "depth_m": deep, "stiffness": stiffer, "wanted_N": wanted, "simulated_N": there}
            )
        stage.advance()
    return {
        "pressed_m": PRESSED, "without_N": bare, "depths_m": DEEP, "stiffnesses": STIFFER, "added_N": added,
        "lost": lost, "checked": checked,
    }  # fmt: skip


def draw_limits(ax, found: dict) -> None:
    """The softest nodule that can be told, over its depth."""
    depths = np.linspace(DEEP[0], DEEP[-1], 201)
    lines = [Map(a) for a in np.asarray(found["added_N"])]
    for (name, (wanted, which)), style in zip(SEEN.items(), ["#1f7fd8", "#08306b", "#e8a49c", "#c0392b"]):
        softest = [lines[which].softest(d, wanted) for d in depths]
        if any(softest):
            words = f"{name}: {1e3 * wanted:.0f} mN"
            ax.plot(1e3 * depths, [s or np.nan for s in softest], color=style, linewidth=1.6, label=words)
    ax.set_yscale("log")
    ax.set_ylim(1, 10)
    ax.set_yticks([1, 1.5, 2, 3, 5, 10], ["1", "1.5", "2", "3", "5", "10"])
    ax.minorticks_off()
    ax.set_xlabel("depth of the nodule's middle (mm)")
    ax.set_ylabel("times as stiff as its surroundings")
    ax.legend(fontsize=7, loc="lower center", bbox_to_anchor=(0.5, 1.0), title="told above a line, lost below it")
    ax.spines[["top", "right"]].set_visible(False)


def main(folder: Path) -> str:
    """Write result.json and figures/nodule.png; the answer in a sentence."""
    (folder / "figures").mkdir(exist_ok=True)
    found, fine = {}, np.linspace(SITES[0], SITES[-1], 481)
    figure = Figure(figsize=(9.6, 3.6), layout="constrained")
    ax, right = figure.subplots(1, 2)
    ramps = len(SITES) * (len(CASES) + 1) + 1 + len(DEEP) * len(STIFFER) + len(CHECKED)
    with for_terminal().stage("ramps", ramps) as stage:
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
        where = limits(stage)
    write_json(folder / "result.json", {"without": bare, "sites_m": SITES, "nodules": found, "limits": where})
    draw_limits(right, where)
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

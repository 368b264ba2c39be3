"""Does the simulator give the published and the independent numbers, and how do the errors fall? A table and a figure.

tissuejax study fits/verification          about ten minutes on a free core
"""

import runpy
import sys
from pathlib import Path

import jax
import numpy as np
from matplotlib.figure import Figure

from tissuejax.storage import write_json

jax.config.update("jax_enable_x64", True)

MESHES = {"12 x 9": (12, 9), "18 x 14": (18, 14), "24 x 18": (24, 18)}
MIDDLE = (18, 14)
SPEEDS = (0.04, 0.02, 0.01)  # m/s
PENALTIES = (0.5, 2.0, 4.0)
DEPTHS = (1, 2, 3, 4, 5)  # mm


def cases(folder: Path) -> dict:
    """The test modules that hold the cases, so that study and tests can't differ."""
    root = folder.resolve().parents[1]
    sys.path.insert(0, str(root))
    tests = root / "tests"
    return {
        "cube": runpy.run_path(str(tests / "reference" / "test_cube.py")),
        "cylinder": runpy.run_path(str(tests / "reference" / "test_cylinder.py")),
        "indentation": runpy.run_path(str(tests / "reference" / "test_indentation.py")),
        "convergence": runpy.run_path(str(tests / "tled" / "test_convergence.py")),
    }


def percent(force: dict, reference: dict) -> list[float]:
    """Error at each depth, per cent."""
    return [100 * (force[d] / reference[d] - 1) for d in DEPTHS]


def indentation(case: dict, keep) -> dict:
    """Errors of the pressed ball, per cent at 1 to 5 mm: by mesh without speed, by speed, by step and by penalty."""
    reference, moving, resting = case["FORCE"], case["moving"], case["resting"]
    out = {"depth_mm": list(DEPTHS), "meshes": {}, "speeds": {}, "penalties": {}}
    for speed in SPEEDS:
        out["speeds"][f"{1e3 * speed:g} mm/s"] = percent(moving(MIDDLE, speed), reference)
    out["speeds"]["at rest"] = percent(resting(MIDDLE), reference)
    half = float(case["scene"](MIDDLE, 0.02).clock.step) / 2
    out["half the step, 20 mm/s"] = percent(moving(MIDDLE, 0.02, step=half), reference)
    keep(out)
    for factor in PENALTIES:
        out["penalties"][str(factor)] = percent(moving(MIDDLE, 0.01, penalty=factor), reference)
    keep(out)
    for name, counts in MESHES.items():
        scene = case["scene"](counts, 0.02)
        out["meshes"][name] = {
            "hexes": len(scene.body.cells),
            "facet_mm": 1e3 * case["RADIUS"] * case["INWARD"] / np.sinh(case["INWARD"]) / counts[0],
            "penalty_Pa_m": float(scene.probe.penalty),
            "errors": percent(case["without_speed"](counts), reference),
        }
        keep(out)
    return out


def draw(found: dict) -> Figure:
    """Error by facet size, by speed, by penalty; one line a depth."""
    figure = Figure(figsize=(10, 3.4), layout="constrained")
    axes = figure.subplots(1, 3, sharey=True)
    shades = ["#9ecae1", "#6baed6", "#4292c6", "#2171b5", "#08306b"]
    meshes = list(found["meshes"].values())
    speeds = {k: v for k, v in found["speeds"].items() if k != "at rest"}
    penalties = {"1.0": found["speeds"]["10 mm/s"]} | found["penalties"]
    order = sorted(penalties, key=float)
    for i, depth in enumerate(DEPTHS):
        look = dict(marker="o", markersize=3.5, linewidth=1.3, color=shades[i], label=f"{depth} mm")
        axes[0].plot([m["facet_mm"] ** 2 for m in meshes], [m["errors"][i] for m in meshes], **look)
        axes[1].plot([float(k.split()[0]) for k in speeds], [v[i] for v in speeds.values()], **look)
        axes[1].plot([0], [found["speeds"]["at rest"][i]], "s", color=shades[i], markersize=5, fillstyle="none")
        axes[2].semilogx([float(k) for k in order], [penalties[k][i] for k in order], **look)
    labels = (
        "facet size under the ball squared (mm²), no speed",
        "speed of the ball (mm/s); squares: static equilibrium",
        "penalty over the automatic one, 10 mm/s",
    )
    for ax, label in zip(axes, labels, strict=True):
        ax.axhspan(-1.5, 1.5, color="#e8f3e8", zorder=0)
        ax.set_xlabel(label, fontsize=8)
        ax.tick_params(labelsize=8)
        ax.spines[["top", "right"]].set_visible(False)
    axes[2].set_xticks([0.5, 1, 2, 4], labels=["1/2", "1", "2", "4"])
    axes[2].minorticks_off()
    axes[0].set_xlim(left=0)
    axes[0].set_ylabel("force error (%)", fontsize=8)
    axes[0].legend(title="depth", fontsize=7, title_fontsize=7)
    return figure


def main(folder: Path) -> str:
    """Run all of it; write result.json and figures/indentation.png; returns the answer in a sentence."""
    case = cases(folder)
    result = {}

    def keep(part, name="indentation"):
        result[name] = part
        write_json(folder / "result.json", result)

    _, sunk = case["cube"]["cube"](10, case["cube"]["STEP"])
    keep(
        {
            "centre_mm": float(sunk[-1, 5, 5]),
            "mean_mm": float(case["cube"]["mean"](sunk[-1])),
            "peak_mm": float(sunk[:, 5, 5].max()),
        },
        "cube",
    )
    force, theory, bulge = case["cylinder"]["compressed"]()
    keep({"force_N": force, "theory_N": theory, "bulge_mm": 1e3 * bulge}, "cylinder")
    sags = {n: 100 * case["convergence"]["duct"](n) for n in (4, 8, 16)}
    keep({str(n): e for n, e in sags.items()}, "duct, error in % by elements a side")
    hertz = {}
    for depth in (5e-4, 1e-3):
        for counts in ((12, 8), (16, 12), (24, 18)):
            ratio = case["convergence"]["pressed"](depth, counts) / case["convergence"]["bonded"](depth) - 1
            hertz[f"{1e3 * depth:g} mm, {counts[0]} x {counts[1]}"] = 100 * ratio
    keep(hertz, "hertz on a bonded layer, error in %")
    found = indentation(case["indentation"], keep)
    (folder / "figures").mkdir(exist_ok=True)
    draw(found).savefig(folder / "figures" / "indentation.png", dpi=100)
    finest = list(found["meshes"].values())[-1]
    return f"indentation on {finest['hexes']} hexes: {', '.join(f'{e:+.2f}' for e in finest['errors'])} % at 1 to 5 mm"


if __name__ == "__main__":
    print(main(Path(__file__).parent))

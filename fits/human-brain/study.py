"""Human brain: one mode fitted, the other predicted; tension-compression asymmetry; a joint fit for each region.

tissuejax study fits/human-brain
"""

from pathlib import Path

import numpy as np

import tissuejax as tj
from tissuejax.report.fit_overlay import draw_curve
from tissuejax.report.page import png
from tissuejax.report.plot import grid
from tissuejax.report.series import curves
from tissuejax.storage import write_bytes, write_json

WIDE = tj.Search(multistart=6)

UNIFORM = tj.Objective(weights="uniform")

REGIONS = {"CX": "cortex", "CR": "corona radiata", "BG": "basal ganglia", "CC": "corpus callosum"}
MODES = ("tension-compression", "shear")
FORM = "2mu/alpha^2"
ENERGIES = (("neo-hookean", None), ("mooney-rivlin", None), ("demiray", None), ("ogden-1", FORM), ("ogden-2", FORM))


def errors(scores) -> dict[str, float]:
    """RMSE by recording, Pa."""
    return {key.split("/")[0]: s.rmse for key, s in scores.items()}


def asymmetry(sample) -> dict[str, float]:
    """Compressive over tensile stress at 10 % strain, as measured."""
    recording = sample.recordings["tension-compression"]
    stretch = np.asarray(recording.inputs["stretch"])
    stress = np.asarray(recording.channels["nominal_stress"].values)
    order = np.argsort(stretch)
    low, high = np.interp([0.9, 1.1], stretch[order], stress[order])
    return {"compression_Pa": float(low), "tension_Pa": float(high), "ratio": float(-low / high)}


def main(folder: Path) -> str:
    """Fit, predict, write; returns the answer in one sentence."""
    record, joint = {}, {}
    for region, words in REGIONS.items():
        sample = tj.read(f"{folder / 'brain.toml'}#{region}")
        entry = {"region": words, "measured_asymmetry": asymmetry(sample), "joint": {}, "one_mode": {}}
        for energy, form in ENERGIES:
            both = tj.fit(
                sample,
                energy,
                ogden_form=form,
                objective=UNIFORM,
                search=WIDE,
            )
            entry["joint"][energy] = {
                "rmse_Pa": errors(both.channels),
                "values": {path: [both.values[path], both.std[path]] for path in both.free},
                "stable": both.stability.stable,
            }
            for mode in MODES:
                held = next(m for m in MODES if m != mode)
                found = tj.fit(
                    sample,
                    energy,
                    ogden_form=form,
                    holdout=[held],
                    objective=UNIFORM,
                    search=WIDE,
                )
                entry["one_mode"].setdefault(energy, {})[f"{mode} fitted, {held} predicted"] = {
                    "fitted_Pa": errors(found.channels)[mode],
                    "predicted_Pa": errors(found.holdout)[held],
                }
            if energy == "ogden-1":
                joint[region] = both
        record[region] = entry
    panels = [curve for found in joint.values() for curve in curves(found)]
    figure, axes = grid(len(panels), columns=4, width=12)
    for ax, curve, title in zip(axes, panels, [REGIONS[r] for r in REGIONS for _ in MODES], strict=True):
        draw_curve(ax, curve, by_time=False)
        ax.set_title(title, loc="left", fontsize=9)
    write_bytes(folder / "figures" / "regions.png", png(figure))
    tj.write(joint["CX"], folder / "figures" / "cortex")
    write_json(folder / "result.json", record)
    alphas = {REGIONS[r]: found.values["energy.alpha1"] for r, found in joint.items()}
    return "exponents of the joint one-term Ogden fits: " + ", ".join(f"{r} {a:.1f}" for r, a in alphas.items())


if __name__ == "__main__":
    print(main(Path(__file__).parent))

"""A cause found on some specimens predicts one of another shape; a nameless correction fitted to the same doesn't.

Cylinders of soft tissue (a closed form in plain numpy) are pulled and pressed. In the first case the plates rub (slab
analysis of a cylinder between rough plates), in the second the rig gives way (a spring in series that stiffens). Flat,
or thick, specimens are held out. Three models are fitted to the others: the base law, the base law and what the
diagnosis names, the base law and a smooth function of stretch that has no cause (Gaussian process).

tissuejax study fits/held-out-geometry
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import brentq

import tissuejax as tj
from tissuejax.progress import for_terminal
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.storage import write_figure, write_json

C10, C20, NOISE = 620.0, 540.0, 5.0  # Pa
RUBBING = 0.35  # coefficient of friction
GIVE, STIFFER = 4e-3, 2.0  # m/N at rest, 1/N: the rig gives asinh(STIFFER F)/STIFFER GIVE way
SEEDS = range(5)
SHAPES = {  # of the case: name of a specimen, (diameter, height) in m; the last one is held out
    "platen-friction": {"tall": (0.010, 0.016), "even": (0.012, 0.012), "flat": (0.024, 0.006)},
    "machine-compliance": {"thin": (0.008, 0.012), "even": (0.012, 0.012), "thick": (0.030, 0.012)},
}


def elastic(stretch: np.ndarray) -> np.ndarray:
    """Nominal stress of an incompressible block of W = C10 (I1 - 3) + C20 (I1 - 3)^2 along its axis, Pa."""
    i1 = stretch**2 + 2 / stretch - 3
    return 2 * (stretch - stretch**-2) * (C10 + 2 * C20 * i1)


def rubbed(stretch: np.ndarray, diameter: float, height: float) -> np.ndarray:
    """Mean pressure of a cylinder between rough plates over that between smooth ones, by the slab method: with
    x = friction d/h of the present shape, 2 (e^x - 1 - x) / x^2 (Hosford and Caddell, Metal Forming, ch. 7)."""
    x = np.where(stretch < 1, RUBBING * diameter / height * stretch**-1.5, 1e-6)
    return elastic(stretch) * 2 * (np.expm1(x) - x) / x**2


def given_way(stretch: np.ndarray, diameter: float, height: float) -> np.ndarray:
    """Stress of a specimen in series with the rig: l + give(F(l))/h = what the crosshead says."""
    area = np.pi / 4 * diameter**2

    def way(l: float) -> float:
        return GIVE * np.arcsinh(STIFFER * area * elastic(np.array(l))) / STIFFER / height

    return elastic(np.array([brentq(lambda l, said=s: l + way(l) - said, 0.4, 2.0, xtol=1e-12) for s in stretch]))


CASES = {"platen-friction": rubbed, "machine-compliance": given_way}


def sample(case: str, seed: int) -> Sample:
    """Every specimen pulled to 1.25 and pressed to 0.75, 80 samples each way."""
    rng, made = np.random.default_rng(seed), {}
    time = np.linspace(0, 16, 160)
    stretch = 1 + 0.25 * np.interp(time, [0, 4, 8, 12, 16], [0, 1, 0, -1, 0])
    for name, (diameter, height) in SHAPES[case].items():
        stress = CASES[case](stretch, diameter, height) + NOISE * rng.standard_normal(len(time))
        told = {"area": np.pi / 4 * diameter**2, "height": height, "diameter": diameter}
        channel = {"nominal_stress": Channel(time, stress, "Pa", NOISE)}
        made[name] = Recording(name, "uniaxial", {"time": time, "stretch": stretch}, channel, told)
    return Sample(case, made)


def misses(found: tj.Diagnosis, held: str, when: str) -> float:
    """Root mean square error on the specimen held out, Pa."""
    return found.as_dict()[when][held]["nominal_stress"]["rmse"]


def run(case: str, seed: int) -> dict:
    """One sample: what is named, and how far each model misses the specimen held out."""
    data, held = sample(case, seed), list(SHAPES[case])[-1]
    named = tj.diagnose(data, "reduced-polynomial-2", holdout=(held,))
    smooth = tj.diagnose(data, "reduced-polynomial-2", holdout=(held,), effects=("energy-form", "specimen-scatter"))
    return {
        "case": case,
        "seed": seed,
        "named": [e["name"] for e in named.as_dict()["effects"]],
        "base": misses(named, held, "before"),
        "cause": misses(named, held, "after"),
        "nameless": misses(smooth, held, "after"),
        "nameless_effects": [f"{e['name']}/{e['form']}" for e in smooth.as_dict()["effects"]],
    }


def drawn(rows: list[dict]) -> Figure:
    """Errors on the specimen held out, by model."""
    figure = Figure(figsize=(8.6, 3.4), layout="constrained")
    for ax, case in zip(figure.subplots(1, 2, sharey=True), CASES, strict=True):
        own = [r for r in rows if r["case"] == case]
        for k, model in enumerate(("base", "nameless", "cause")):
            ax.plot(k + np.linspace(-0.1, 0.1, len(own)), [r[model] for r in own], "o", markersize=4)
        ax.axhline(NOISE, color="0.5", linewidth=0.8, linestyle="--")
        ax.text(-0.3, NOISE * 1.08, "noise", fontsize=8, color="0.4")
        ax.set_xticks(range(3), ["base law", "correction\nwithout a cause", "named cause"])
        ax.set(yscale="log", xlim=(-0.4, 2.4))
        ax.set_title(f"{case}: {list(SHAPES[case])[-1]} specimen", fontsize=10)
    figure.supylabel("rms error on the specimen held out (Pa)", fontsize=10)
    return figure


def main(folder: Path) -> str:
    """Run, write, and say in a line what came out."""
    rows = []
    with for_terminal().stage("held-out geometry", total=len(CASES) * len(SEEDS)) as stage:
        for case in CASES:
            for seed in SEEDS:
                rows.append(run(case, seed))
                stage.advance(1)
    write_json(folder / "result.json", {"noise_Pa": NOISE, "samples": rows})
    write_figure(folder / "held-out.png", drawn(rows), dpi=130)
    medians = {
        case: {m: float(np.median([r[m] for r in rows if r["case"] == case])) for m in ("base", "nameless", "cause")}
        for case in CASES
    }
    return "; ".join(
        f"{case}: {m['base']:.0f} Pa by the base law, {m['nameless']:.0f} by a nameless correction, "
        f"{m['cause']:.0f} by the cause"
        for case, m in medians.items()
    )


if __name__ == "__main__":
    print(main(Path(__file__).resolve().parent))

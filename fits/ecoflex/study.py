"""Ecoflex phantoms: the published standard errors of fit for EF10, then all 190 tests, and the spread between
specimens.

tissuejax study fits/ecoflex
"""

from pathlib import Path

import numpy as np

import tissuejax as tj
from tissuejax.progress import for_terminal
from tissuejax.recordings.files import read_all
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.report.page import png
from tissuejax.report.plot import FAINT, INK, SERIES, grid
from tissuejax.storage import write_bytes, write_json, write_text

WIDE = tj.Search(multistart=6)

UNIFORM = tj.Objective(weights="uniform")

ONCE = tj.Search(multistart=1)

PUBLISHED = {  # standard error of fit for EF10, kPa (Dawood et al. 2026)
    "neo-hookean": 13.04,
    "reduced-polynomial-2": 2.94,
    "reduced-polynomial-3": 0.658,
    "ogden-1": 2.107,
    "ogden-2": 0.827,
}
ALL = "reduced-polynomial-3"
FORM = "2mu/alpha^2"


def form_of(energy: str) -> str | None:
    """Only Ogden takes one."""
    return FORM if energy.startswith("ogden") else None


def mean_curve(sample: Sample, points: int = 1201) -> Sample:
    """The mean stress of all tests at even compressions from 0 to 20 mm, as many as the raw recordings have samples."""
    stretch = np.linspace(1.0, 1.0 - 20.0 / 30.0, points)
    stress = np.mean(
        [
            np.interp(-stretch, -np.asarray(r.inputs["stretch"]), np.asarray(r.channels["nominal_stress"].values))
            for r in sample.recordings.values()
        ],
        axis=0,
    )
    time = np.linspace(0.0, 120.0, points)
    inputs, channels = {"time": time, "stretch": stretch}, {"nominal_stress": Channel(time, stress, "Pa")}
    return Sample(f"{sample.name} mean", {"mean": Recording("mean", "uniaxial", inputs, channels)})


def standard_error(found) -> float:
    """sqrt(SSE / (n - p)), kPa."""
    n = sum(s.n for s in found.channels.values())
    sse = sum(s.n * s.rmse**2 for s in found.channels.values())
    return float(np.sqrt(sse / (n - len(found.free)))) / 1e3


def published_errors(folder: Path) -> dict:
    """The five energies on EF10: on the mean curve, and test by test."""
    ef10 = tj.read(f"{folder / 'ecoflex.toml'}#EF10_0T")
    mean, rows = mean_curve(ef10), {}
    for energy, theirs in PUBLISHED.items():
        found = tj.fit(
            mean,
            energy,
            ogden_form=form_of(energy),
            objective=UNIFORM,
            search=WIDE,
        )
        single = [
            standard_error(
                tj.fit(
                    Sample(name, {name: r}),
                    energy,
                    ogden_form=form_of(energy),
                    objective=UNIFORM,
                )
            )
            for name, r in ef10.recordings.items()
        ]
        rows[energy] = {
            "published_kPa": theirs,
            "mean_curve_kPa": standard_error(found),
            "test_by_test_kPa": {"mean": float(np.mean(single)), "min": min(single), "max": max(single)},
            "values": {path: found.values[path] for path in found.free},
            "stable": found.stability.stable,
        }
        tj.write(found, folder / "figures" / energy)
    return rows


def every_test(folder: Path) -> dict:
    """Yeoh's energy on each of the 190 tests, by test."""
    samples, rows = read_all(folder / "ecoflex-each.toml"), {}
    with for_terminal().stage(f"{ALL} on {len(samples)} tests", len(samples)) as stage:
        for name, sample in samples.items():
            found = tj.fit(sample, ALL, objective=UNIFORM, search=ONCE)
            rows[name] = {
                "shear_modulus_Pa": 2 * found.values["energy.C10"],
                "standard_error_kPa": standard_error(found),
                "status": found.status,
            } | {p: found.values[p] for p in found.free}
            stage.advance(note=name)
    return rows


def spread(rows: dict) -> dict:
    """By material: mean shear modulus, spread within a specimen and between its two specimens."""
    materials = sorted({name.rsplit("_", 1)[0] for name in rows})
    found = {}
    for material in materials:
        by = {s: [r["shear_modulus_Pa"] for n, r in rows.items() if n.startswith(f"{material}_{s}")] for s in "AB"}
        means = {s: float(np.mean(v)) for s, v in by.items() if v}
        centre = float(np.mean(list(means.values())))
        repeat = float(np.sqrt(np.mean([np.var(v, ddof=1) for v in by.values() if len(v) > 1])))
        found[material] = {
            "shear_modulus_Pa": centre,
            "repeat_cv": repeat / centre,
            "between_specimens": abs(means["A"] - means["B"]) / centre if len(means) == 2 else None,
        }
    return found


def draw(folder: Path, rows: dict, materials: dict) -> None:
    """Shear modulus of every test, material by material."""
    order = sorted(materials, key=lambda m: materials[m]["shear_modulus_Pa"])
    figure, (ax,) = grid(1, columns=1, height=4.2)
    for k, material in enumerate(order):
        for specimen, colour in zip("AB", SERIES, strict=False):
            values = [r["shear_modulus_Pa"] / 1e3 for n, r in rows.items() if n.startswith(f"{material}_{specimen}")]
            ax.plot(
                np.full(len(values), k) + (-0.12 if specimen == "A" else 0.12),
                values,
                ".",
                color=colour,
                label=f"specimen {specimen}" if k == 0 else None,
            )
    ax.set_yscale("log")
    ax.set_yticks([2, 5, 10, 20, 50], ["2", "5", "10", "20", "50"])
    ax.minorticks_off()
    ax.set_xticks(range(len(order)), order, rotation=60, ha="right", fontsize=8, color=INK)
    ax.set_ylabel("initial shear modulus, 2 C10 (kPa)")
    ax.grid(color=FAINT, alpha=0.2)
    ax.legend(frameon=False, fontsize=9)
    write_bytes(folder / "figures" / "spread.png", png(figure))


def main(folder: Path) -> str:
    """Both parts; returns the answer in one sentence."""
    errors = published_errors(folder)
    rows = every_test(folder)
    materials = spread(rows)
    draw(folder, rows, materials)
    columns = list(next(iter(rows.values())))
    lines = [",".join(["test", *columns]), *(",".join([n, *(f"{r[c]}" for c in columns)]) for n, r in rows.items())]
    write_text(folder / "per_test.csv", "\n".join(lines) + "\n")
    write_json(folder / "result.json", {"ef10": errors, "materials": materials, "tests": len(rows)})
    shown = ", ".join(f"{e} {r['mean_curve_kPa']:.3f} ({r['published_kPa']})" for e, r in errors.items())
    return f"EF10 standard errors of fit in kPa, ours (published): {shown}; {len(rows)} tests fitted"


if __name__ == "__main__":
    print(main(Path(__file__).parent))

"""Robot palpation of ex vivo pig liver: a stiffness for each site, what is shared by a region, and what can't be told.

tissuejax study fits/pig-liver-probing
"""

import csv
import os
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import least_squares

from tissuejax.errors import InputError
from tissuejax.experiments.layer_indentation import force
from tissuejax.report.page import png
from tissuejax.report.plot import grid
from tissuejax.storage import write_bytes, write_json

jax.config.update("jax_enable_x64", True)

RADIUS = 4.0e-3  # m, of the ball
NOISE = 0.01  # N: scatter of neighbouring steps; no sensor noise is recorded
THICKNESS = (0.01, 0.02, 0.04, float("inf"))  # m, assumed: nobody measured it; infinity is Hertz
OFFSET = (0.0, 2.5e-4, 5e-4)  # m below the recorded contact point that first touch may lie, assumed
STIFFEST = 40.0  # bound of the stiffening b
HELD_OUT = 5  # every fifth site takes no part in what a region shares
PLACE = 1.0e-3  # m: depth at which stiffness is reported
FEW = 7  # steps from which a held-out site's modulus is found; the deeper three are predicted


def read(folder: Path) -> dict[str, dict]:
    """Depth (m) and axial force (N) at ten steps of each site of the pig liver regions."""
    path = folder / "probing_points.csv"
    if not path.exists():
        raise InputError(f"{path} is not here: set TISSUEJAX_SHARED to the folder that holds recordings/")
    rows: dict[str, dict[int, list]] = {}
    with path.open() as file:
        for r in csv.DictReader(file):
            if r["region"].startswith("pig_liver"):
                sites = rows.setdefault(r["region"].removeprefix("pig_liver_20150826_"), {})
                values = (r["depth_mm"], r["force_axial_N"], r["x_mm"], r["y_mm"])
                sites.setdefault(int(r["site"]), []).append([float(v) for v in values])
    found = {}
    for region, sites in rows.items():
        block = np.array([s for s in sites.values() if len(s) == 10])
        found[region] = {"depth": 1e-3 * block[..., 0], "force": block[..., 1], "place": block[:, 0, 2:]}
    return found


def best_modulus(unit, measured):
    """Modulus of each site that is best for a unit-modulus force, (s,): the law is linear in it."""
    return np.maximum((unit * measured).sum(1) / np.maximum((unit**2).sum(1), 1e-30), 0.0)


def unit(depth, offset, thickness, stiffening):
    """Force of a unit modulus."""
    return np.asarray(force(depth + offset, RADIUS, jnp.asarray(1.0), thickness, stiffening))


def shared_stiffening(depth, measured, offset, thickness):
    """Stiffening of a region and its standard error, the modulus of each site solved for inside."""

    def residual(p):
        u = unit(depth, offset, thickness, p[0])
        return ((best_modulus(u, measured)[:, None] * u - measured) / NOISE).ravel()

    out = least_squares(residual, [5.0], bounds=([0.0], [STIFFEST]))
    dof = max(1, measured.size - len(measured) - 1)
    return float(out.x[0]), float(np.sqrt(2 * out.cost / dof / float(np.sum(out.jac**2))))


def neighbour_prediction(place, E):
    """Median relative error of a site's stiffness from its three nearest neighbours, and from the region's median."""
    d = np.linalg.norm(place[:, None] - place[None], axis=2)
    np.fill_diagonal(d, np.inf)
    near = np.exp(np.mean(np.log(np.maximum(E, 1e-3))[np.argsort(d, 1)[:, :3]], axis=1))
    relative = lambda guess: float(np.median(np.abs(guess - E) / np.maximum(E, 1e-3)))  # noqa: E731
    return relative(near), relative(np.median(E))


def region_answer(data) -> dict:
    """All assumptions tried on one region."""
    depth, measured = data["depth"], data["force"]
    held = np.arange(len(depth)) % HELD_OUT == 0
    models = {}
    for offset in OFFSET:
        for h in THICKNESS:
            b, std = shared_stiffening(depth[~held], measured[~held], offset, h)
            u = unit(depth, offset, h, b)
            E = best_modulus(u, measured)
            error = E[:, None] * u - measured
            shallow = best_modulus(u[held][:, :FEW], measured[held][:, :FEW])
            later = (shallow[:, None] * u[held] - measured[held])[:, FEW:]
            one = np.array([[PLACE, PLACE + 1e-6]])
            slope = E * np.diff(unit(one, offset, h, b), axis=1)[0] / 1e-6 / 1e3  # N/mm
            models[f"offset {1e3 * offset:.2f} mm, {'Hertz' if np.isinf(h) else f'{1e3 * h:.0f} mm thick'}"] = {
                "stiffening": [b, std],
                "rmse_N": float(np.sqrt(np.mean(error[~held] ** 2))),
                "held_out_rmse_N": float(np.sqrt(np.mean(error[held] ** 2))),
                "held_out_deep_steps_from_shallow_N": float(np.sqrt(np.mean(later**2))),
                "modulus_median_Pa": float(np.median(E)),
                "stiffness_at_1mm_median_N_per_mm": float(np.median(slope)),
                "stiffness_at_1mm_N_per_mm": [round(float(v), 5) for v in slope],
            }
    best = min(models, key=lambda k: models[k]["held_out_deep_steps_from_shallow_N"])
    near, median = neighbour_prediction(data["place"], np.array(models[best]["stiffness_at_1mm_N_per_mm"]))
    return {
        "sites": int(len(held)),
        "held_out": int(held.sum()),
        "best": best,
        "modulus_range_over_assumptions_Pa": span(models, "modulus_median_Pa"),
        "stiffness_range_over_assumptions_N_per_mm": span(models, "stiffness_at_1mm_median_N_per_mm"),
        "relative_error_from_neighbours": near,
        "relative_error_from_median": median,
        "place_mm": data["place"].tolist(),
        "models": models,
    }


def span(models: dict, key: str) -> list[float]:
    """Smallest and largest over the assumptions that predict within 10 % of the best."""
    least = min(m["held_out_rmse_N"] for m in models.values())
    values = [m[key] for m in models.values() if m["held_out_rmse_N"] < 1.1 * least]
    return [min(values), max(values)]


def picture(answers: dict) -> bytes:
    """The map of stiffness at 1 mm depth."""
    figure, axes = grid(len(answers), 3)
    for ax, (region, a) in zip(axes, answers.items()):
        place, k = np.array(a["place_mm"]), np.array(a["models"][a["best"]]["stiffness_at_1mm_N_per_mm"])
        low, high = np.percentile(k, [3, 97])
        dots = ax.scatter(*place.T, c=k, s=22, cmap="viridis", vmin=low, vmax=high)
        figure.colorbar(dots, ax=ax, label="dF/dd at 1 mm, N/mm")
        ax.set(title=region, xlabel="x, mm", ylabel="y, mm", aspect="equal")
    return png(figure)


def main(folder: Path) -> str:
    """Write result.json and the map; returns the answer in a sentence."""
    default = folder.resolve().parents[2] / "shared"
    data = read(Path(os.environ.get("TISSUEJAX_SHARED", default)) / "recordings" / "pig_liver_robot_probing")
    answers = {region: region_answer(d) for region, d in data.items()}
    write_json(folder / "result.json", answers)
    (folder / "figures").mkdir(exist_ok=True)
    write_bytes(folder / "figures" / "map.png", picture(answers))

    def factor(key):
        return max(a[key][1] / a[key][0] for a in answers.values())

    k = [a["models"][a["best"]]["stiffness_at_1mm_median_N_per_mm"] for a in answers.values()]
    return (
        f"stiffness at 1 mm {min(k):.2f} to {max(k):.2f} N/mm by region, known whatever is assumed (within a factor of "
        f"{factor('stiffness_range_over_assumptions_N_per_mm'):.2f}); the modulus at rest moves by up to a factor of "
        f"{factor('modulus_range_over_assumptions_Pa'):.1f} with assumptions that fit equally well"
    )


if __name__ == "__main__":
    print(main(Path(__file__).parent))

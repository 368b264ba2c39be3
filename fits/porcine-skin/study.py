"""Porcine skin: isotropic energies against one with a fibre family, on five biaxial paths.

tissuejax study fits/porcine-skin
"""

from dataclasses import replace
from pathlib import Path

import tissuejax as tj
from tissuejax.storage import write_json

ONCE = tj.Search(multistart=1)

PATHS = ("off_x", "off_y", "equibiaxial", "strip_x", "strip_y")
ISOTROPIC = ("neo-hookean", "reduced-polynomial-3", "demiray")
FIBRE = ("neo-hookean+fibre", "demiray+fibre")
START = {"energy.angle": 1.3}  # a start along an axis of the test has no slope to leave it by
BOUNDS = {"energy.angle": (-0.2, 1.77)}  # from x to y: the tests can't tell an angle from its mirror image

UNIFORM = tj.Objective(weights="uniform")


def errors(scores) -> dict[str, float]:
    """RMSE by path over both directions, kPa."""
    return {key.split("/")[0]: s.rmse / 1e3 for key, s in scores.items()}


def main(folder: Path) -> str:
    """Fit all paths, then each path predicted from the other four; returns the answer in one sentence."""
    sample = tj.read(folder / "skin.toml")
    record = {"joint": {}, "predicted": {}}
    for energy in (*ISOTROPIC, *FIBRE):
        fibre = "+" in energy
        unknowns = tj.Unknowns(bounds=BOUNDS, start=START) if fibre else tj.Unknowns()
        found = tj.fit(sample, energy, unknowns=unknowns, objective=UNIFORM)
        n = sum(s.n for s in found.channels.values())
        record["joint"][energy] = {
            "rmse_kPa": errors(found.channels),
            "rmse_all_kPa": (sum(s.n * s.rmse**2 for s in found.channels.values()) / n) ** 0.5 / 1e3,
            "values": {path: [found.values[path], found.std[path]] for path in found.free},
            "warnings": found.warnings,
        }
        tj.write(found, folder / "figures" / energy.replace("+", "-"))
        for path in PATHS:
            near = replace(unknowns, start={p: found.values[p] for p in found.free})
            once = ONCE
            other = tj.fit(sample, energy, holdout=[path], unknowns=near, objective=UNIFORM, search=once)
            record["predicted"].setdefault(energy, {})[path] = errors(other.holdout)[path]
    write_json(folder / "result.json", record)
    shown = ", ".join(f"{e} {r['rmse_all_kPa']:.1f}" for e, r in record["joint"].items())
    return f"RMSE over all five paths in kPa: {shown}"


if __name__ == "__main__":
    print(main(Path(__file__).parent))

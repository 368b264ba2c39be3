"""Rubber and silicone: three modes at once, and a mode predicted from the other two.

tissuejax study fits/rubber
"""

from pathlib import Path

import tissuejax as tj
from tissuejax.errors import TissueError
from tissuejax.storage import write_json

MODES = ("uniaxial", "equibiaxial", "planar")
SOURCES = ("Treloar_1944", "Kawabata_1981", "Meunier_2008")
ENERGIES = (
    ("neo-hookean", None),
    ("mooney-rivlin", None),
    ("reduced-polynomial-3", None),
    ("gent", None),
    ("arruda-boyce", None),
    ("ogden-2", "mu/alpha"),
    ("ogden-3", "mu/alpha"),
)
PUBLISHED = {"sse_MPa2": 0.209, "uniaxial": 0.083, "equibiaxial": 0.044, "planar": 0.031}


def rmse(scores) -> dict[str, float]:
    """RMSE by mode, MPa."""
    return {key.split("/")[0]: s.rmse / 1e6 for key, s in scores.items()}


def main(folder: Path) -> str:
    """Fit, predict, write; returns the answer in one sentence."""
    record = {"published": PUBLISHED, "joint": {}, "predicted": {}}
    for source in SOURCES:
        sample = tj.read(f"{folder / 'rubber.toml'}#{source}")
        for energy, form in ENERGIES:
            found = tj.fit(sample, energy, ogden_form=form, search=tj.Search(multistart=6))
            sse = sum(s.n * (s.rmse / 1e6) ** 2 for s in found.channels.values())
            entry = {
                "sse_MPa2": sse,
                "rmse_MPa": rmse(found.channels),
                "n_evaluations": found.n_evaluations,
                "values": {path: found.values[path] for path in found.free},
                "status": found.status,
            }
            record["joint"].setdefault(source, {})[energy] = entry
            if energy == "ogden-3":
                tj.write(found, folder / "figures" / source)
            for mode in MODES:
                record["predicted"].setdefault(source, {}).setdefault(energy, {})[mode] = predicted(
                    sample, energy, form, mode
                )
    write_json(folder / "result.json", record)
    treloar = record["joint"]["Treloar_1944"]["ogden-3"]
    return f"Treloar, 3-term Ogden on all modes: sum of squares {treloar['sse_MPa2']:.4f} MPa^2 (published 0.209)"


def predicted(sample, energy: str, form: str | None, mode: str) -> float | None:
    """RMSE (MPa) of one mode predicted from a fit of the other two."""
    try:
        found = tj.fit(sample, energy, ogden_form=form, holdout=[mode], search=tj.Search(multistart=6))
    except TissueError:
        return None
    return rmse(found.holdout)[mode]


if __name__ == "__main__":
    print(main(Path(__file__).parent))

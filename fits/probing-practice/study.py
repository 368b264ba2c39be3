"""p01, a probing from another simulator with nothing concealed: are its constants found, inside the stated intervals?

tissuejax study fits/probing-practice
"""

import json
import os
from pathlib import Path

import tissuejax as tj
from tissuejax.errors import InputError
from tissuejax.experiments.predictor import predictor
from tissuejax.fitting.options import Unknowns
from tissuejax.fitting.probed import fit_probed
from tissuejax.fitting.setup import problem
from tissuejax.progress import for_terminal
from tissuejax.storage import write_json
from tissuejax.verbs import material

START = {"energy.C10": 950.0, "energy.C20": 250.0, "volumetric.K": 30e3}  # about 50 % off


def main(folder: Path) -> str:
    """Fit r1 and r2, predict r3, compare with the key; write result.json."""
    practice = Path(os.environ.get("TISSUEJAX_SHARED", folder.resolve().parents[2] / "shared")) / "practice"
    if not (practice / "p01.h5").exists():
        raise InputError(f"{practice / 'p01.h5'} is not here: set TISSUEJAX_SHARED to the folder that holds practice/")
    sample = tj.read(practice / "p01.h5")
    model = material("reduced-polynomial-2", volumetric="quadratic")
    posed = problem(predictor(model, sample, ["r1", "r2"]), unknowns=Unknowns(start=START))
    found = fit_probed(posed, holdout=("r3",), checkpoint=folder / "checkpoint.json", progress=for_terminal())
    write_json(folder / "result.json", found.record() | against_key(found, practice / "keys-probing.json"))
    said = [
        f"{p.split('.')[-1]} {found.fit.values[p]:.0f} +- {found.fit.std[p]:.0f} Pa ({100 * e:+.1f} %)"
        for p, e in relative_errors(found, practice / "keys-probing.json").items()
    ]
    return f"{', '.join(said)}; chi-square per sample {found.fit.chi2 / posed.n_samples:.3f}"


def relative_errors(found, key: Path) -> dict[str, float]:
    """Estimate over truth, less 1."""
    base = json.loads(key.read_text())["p01"]["base"]
    return {path: found.fit.values[path] / base[path.split(".")[-1]] - 1 for path in START}


def against_key(found, key: Path) -> dict:
    """Relative error and error over the stated standard error of each constant."""
    base = json.loads(key.read_text())["p01"]["base"]
    relative = relative_errors(found, key)
    stated = {p: (found.fit.values[p] - base[p.split(".")[-1]]) / found.fit.std[p] for p in START}
    return {"against_key": {"relative": relative, "in_standard_errors": stated}}


if __name__ == "__main__":
    print(main(Path(__file__).parent))

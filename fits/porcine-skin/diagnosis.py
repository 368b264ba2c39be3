"""Porcine skin, diagnosed: the base model is isotropic; each of the five biaxial paths is held out in turn.

The tables hold no time, so that nothing that acts in time is tried.

tissuejax study fits/porcine-skin
"""

from pathlib import Path

import tissuejax as tj
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.specimens import Specimens, brief
from tissuejax.report.diagnosis_page import write_diagnosis
from tissuejax.report.page import write_figures
from tissuejax.storage import write_json

ENERGIES = ("demiray",)
SHOWN = ("demiray", "off_y")
TRIED = ("anisotropy", "energy-form", "slack", "drift", "permanent-set")
EFFORT = Effort(most=2)


def main(folder: Path) -> str:
    """Every path held out once, for two base energies; returns the answer in a sentence."""
    sample, records = tj.read(folder / "skin.toml"), {}
    for energy in ENERGIES:
        for path in sample.recordings:
            found = tj.diagnose(sample, energy, holdout=path, effects=TRIED, effort=EFFORT)
            records[f"{energy}, without {path}"] = brief(found)
            if (energy, path) == SHOWN:
                write_diagnosis(found, folder / "figures" / "diagnosis", remainders=False)
    many = Specimens(records)
    write_figures(many, folder / "figures")
    write_json(folder / "diagnosis.json", many.as_dict())
    return f"{many.verdicts}; found in {many.counts} of {len(records)}"


if __name__ == "__main__":
    print(main(Path(__file__).parent))

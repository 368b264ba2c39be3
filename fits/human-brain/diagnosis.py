"""Human brain, diagnosed: is what a neo-Hookean law misses in tension and compression a matter of the energy's form?

The tables are means on a regular grid, without time and without a path: effects that need either are not tried.

tissuejax study fits/human-brain
"""

from pathlib import Path

import tissuejax as tj
from tissuejax.diagnosis.specimens import Specimens, brief
from tissuejax.progress import for_terminal
from tissuejax.report.diagnosis_page import write_diagnosis
from tissuejax.report.page import write_figures
from tissuejax.storage import write_json

REGIONS = {"CX": "cortex", "CR": "corona radiata", "BG": "basal ganglia", "CC": "corpus callosum"}
ENERGY, HELD = "neo-hookean", "shear"
TRIED = ("energy-form", "platen-friction", "slack", "machine-compliance", "compressibility", "anisotropy", "drift")


def main(folder: Path) -> str:
    """Each region with shear held out; returns the answer in a sentence."""
    records = {}
    for region, words in REGIONS.items():
        sample = tj.read(f"{folder / 'brain.toml'}#{region}")
        found = tj.diagnose(sample, ENERGY, holdout=HELD, effects=TRIED, progress=for_terminal())
        records[words] = brief(found)
        if region == "CX":
            write_diagnosis(found, folder / "figures" / "diagnosis", remainders=False)
    many = Specimens(records)
    write_figures(many, folder / "figures")
    write_json(folder / "diagnosis.json", {"tried": list(TRIED), "held_out": HELD, **many.as_dict()})
    return many.sentence()


if __name__ == "__main__":
    print(main(Path(__file__).parent))

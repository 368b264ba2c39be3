"""Ecoflex cylinders, diagnosed: is there platen friction or a contact offset in 19 materials, and do they agree?

Each material with a neo-Hookean base: two tests of its first specimen fitted, one of its second held out. The noise is
what repeats of one specimen scatter by: no model can be held to less.

tissuejax study fits/ecoflex
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

import tissuejax as tj
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.specimens import Specimens, brief
from tissuejax.progress import for_terminal
from tissuejax.recordings.files import read_all
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.report.diagnosis_page import write_diagnosis
from tissuejax.report.page import write_figures
from tissuejax.storage import write_json

ENERGY, EVERY, SHOWN = "neo-hookean", 3, "EF10_0T"
# One rate and no unloading: nothing that happens in time can be seen, so it is not asked for.
TRIED = ("energy-form", "platen-friction", "slack", "machine-compliance", "permanent-set", "drift")
LEVELS = np.linspace(1.0, 0.35, 200)
EFFORT = Effort(most=2)


def repeats(recordings: list[Recording]) -> float:
    """Root mean square scatter of repeats about their mean at the same stretch, Pa."""
    curves = []
    for r in recordings:
        l, y = np.asarray(r.inputs["stretch"]), np.asarray(r.channels["nominal_stress"].values)
        curves.append(np.interp(-LEVELS, -l, y))
    return float(np.sqrt(np.mean(np.var(curves, axis=0, ddof=1))))


def picked(sample: Sample) -> tuple[Sample, float]:
    """Two tests of specimen A and the first of specimen B, every third sample, with the repeats' scatter as noise."""
    by = {s: [r for n, r in sample.recordings.items() if n.split("_")[-1].startswith(s)] for s in "AB"}
    noise = float(np.sqrt(np.mean([repeats(v) ** 2 for v in by.values() if len(v) > 1])))
    recordings = {}
    for r in (*by["A"][:2], (by["B"] or by["A"][2:])[0]):
        keep = slice(None, None, EVERY)
        inputs = {k: np.asarray(v)[keep] for k, v in r.inputs.items()}
        stress = np.asarray(r.channels["nominal_stress"].values)[keep]
        channels = {"nominal_stress": Channel(inputs["time"], stress, "Pa", noise)}
        recordings[r.name] = replace(r, inputs=inputs, channels=channels)
    return replace(sample, recordings=recordings), noise


def main(folder: Path) -> str:
    """Diagnose every material; returns the answer in a sentence."""
    records = {}
    for name, whole in read_all(folder / "ecoflex.toml").items():
        sample, noise = picked(whole)
        found = tj.diagnose(sample, ENERGY, effects=TRIED, effort=EFFORT, progress=for_terminal())
        records[name] = brief(found) | {"noise_Pa": noise, "recordings": list(sample.recordings)}
        if name == SHOWN:
            write_diagnosis(found, folder / "figures" / "diagnosis", remainders=False)
    many = Specimens(records)
    write_figures(many, folder / "figures")
    write_json(folder / "diagnosis.json", many.as_dict())
    return f"{many.verdicts}; found in {many.counts} of {len(records)}"


if __name__ == "__main__":
    print(main(Path(__file__).parent))

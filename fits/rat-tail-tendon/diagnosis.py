"""Rat tail tendons, diagnosed: fascicles held at 5 % strain, and pulled until they broke.

Four fascicles are diagnosed. A fascicle is one recording, so nothing is held out within it; the relaxation of the first
is carried to the others.
Pulls to failure are read up to their largest load: what comes after is rupture, which no effect here describes.

tissuejax study fits/rat-tail-tendon
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

import tissuejax as tj
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.specimens import Specimens, brief
from tissuejax.diagnosis.transfer import transfer
from tissuejax.energies.catalogue import energy
from tissuejax.progress import for_terminal
from tissuejax.recordings.files import read_all
from tissuejax.recordings.recording import Channel, Sample
from tissuejax.report.diagnosis_page import write_diagnosis
from tissuejax.report.page import write_figures
from tissuejax.storage import write_json

ENERGY, EVERY = "reduced-polynomial-2", 4
SHOWN = "relax_fresh_1"
DIAGNOSED = (SHOWN, "relax_incubated_1", "failure_incubated_1", "failure_incubated_2")
EFFORT = Effort(most=2)


def thinned(sample: Sample) -> Sample:
    """Every fourth sample of a hold of 180 s; a pull up to its largest load."""
    recordings = {}
    for name, r in sample.recordings.items():
        c = r.channels["nominal_stress"]
        y = np.asarray(c.values)
        keep = slice(None, None, EVERY) if len(y) > 1000 else slice(0, int(np.argmax(y)) + 1)
        keep = keep if sample.name.startswith("failure") or len(y) > 1000 else slice(None)
        inputs = {k: np.asarray(v)[keep] for k, v in r.inputs.items()}
        channel = Channel(inputs["time"], y[keep], c.unit)
        recordings[name] = replace(r, inputs=inputs, channels={"nominal_stress": channel})
    return replace(sample, recordings=recordings)


def main(folder: Path) -> str:
    """Diagnose each fascicle, carry the relaxation of one over; returns the answer in a sentence."""
    samples = {n: thinned(s) for n, s in read_all(folder / "tendon.toml").items()}
    records, relaxation = {}, {}
    for name in DIAGNOSED:
        sample = samples[name]
        found = tj.diagnose(sample, ENERGY, effort=EFFORT, progress=for_terminal())
        records[name] = brief(found)
        if name == SHOWN:
            write_diagnosis(found, folder / "figures" / "diagnosis", remainders=False)
            relaxation = {p: v for p, v in found.verdict.chosen.values.items() if ".viscoelasticity." in p}
    many = Specimens(records)
    write_figures(many, folder / "figures")
    law, others = energy(ENERGY), [n for n in samples if n.startswith("relax") and n != SHOWN]
    carried = {n: transfer(samples[n], law, ["viscoelasticity"], relaxation).as_dict() for n in others if relaxation}
    write_json(folder / "diagnosis.json", {"fascicles": many.as_dict(), "relaxation": relaxation, "carried": carried})
    return many.sentence()


if __name__ == "__main__":
    print(main(Path(__file__).parent))

"""Muscle fibres, diagnosed: one stretch reached in 0.1 to 100 s; the base model knows no rate. One ramp is held out.

The noise is estimated from the curves: the recorded standard deviation is the spread between fibres, not the noise of
their mean.

tissuejax study fits/muscle-fibre
"""

from dataclasses import replace
from pathlib import Path

import tissuejax as tj
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.specimens import Specimens, brief
from tissuejax.diagnosis.transfer import transfer
from tissuejax.energies.catalogue import energy
from tissuejax.progress import for_terminal
from tissuejax.recordings.recording import Channel, Sample
from tissuejax.report.diagnosis_page import write_diagnosis
from tissuejax.report.page import write_figures
from tissuejax.storage import write_json

ENERGY, HELD = "reduced-polynomial-2", "ramp 10 s"
STATES = ("Relaxed", "RelaxedMavaSet", "pCa4.4", "Mava_pCa4.4")
EFFORT = Effort(most=2)


def unsaid(sample: Sample) -> Sample:
    """The sample without its noise levels, so that they are estimated."""
    recordings = {}
    for name, r in sample.recordings.items():
        channels = {k: Channel(c.time, c.values, c.unit) for k, c in r.channels.items()}
        recordings[name] = replace(r, channels=channels)
    return replace(sample, recordings=recordings)


def main(folder: Path) -> str:
    """Diagnose each state, carry the relaxation of the first to the others; returns the answer in a sentence."""
    records, found = {}, {}
    for state in STATES:
        sample = unsaid(tj.read(f"{folder / 'fibre.toml'}#{state}"))
        found[state] = (sample, tj.diagnose(sample, ENERGY, holdout=HELD, effort=EFFORT, progress=for_terminal()))
        records[state] = brief(found[state][1])
        if state == STATES[0]:
            write_diagnosis(found[state][1], folder / "figures" / "diagnosis", remainders=False)
    many = Specimens(records)
    write_figures(many, folder / "figures")
    first = found[STATES[0]][1].verdict.chosen.values
    relaxation = {p: v for p, v in first.items() if p.startswith("effects.viscoelasticity.")}
    carried = {}
    for state in STATES[1:]:
        law, effects = energy(ENERGY), ["viscoelasticity"]
        carried[state] = transfer(found[state][0], law, effects, relaxation).as_dict() if relaxation else None
    write_json(folder / "diagnosis.json", {"held_out": HELD, "states": many.as_dict(), "carried": carried})
    return many.sentence()


if __name__ == "__main__":
    print(main(Path(__file__).parent))

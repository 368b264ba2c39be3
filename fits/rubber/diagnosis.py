"""Rubber and silicone, diagnosed: the control. With an energy that suits it nothing may be found.

Two noise levels are tried. 0.01 MPa, by which the fits are weighted, is about the reading error of the published
points. But the three modes were measured on three sheets, and sheets of one batch differ: `SPREAD` of the largest
stress of a mode is what a model of "the rubber" can at best be held to.

tissuejax study fits/rubber
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

import tissuejax as tj
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.specimens import Specimens, brief
from tissuejax.recordings.recording import Channel, Sample
from tissuejax.report.diagnosis_page import write_diagnosis
from tissuejax.report.page import write_figures
from tissuejax.storage import write_json

# the best of all energies on each source; Gent's two constants are nearly as good on the silicone, and neo-Hooke is not
SUITED, NEARLY = ("ogden-3", "mu/alpha"), ("gent", None)
SOURCES = ("Kawabata_1981", "Treloar_1944", "Meunier_2008")
UNSUITED = ("neo-hookean", None)
SPREAD = 0.03
HELD, STRICT = "planar", "Meunier_2008"
TRIED = ("energy-form", "slack", "platen-friction", "drift")  # what can act in a curve without time or direction
EFFORT = Effort(most=2)


def spread(sample: Sample) -> Sample:
    """With a noise of SPREAD times the largest stress of each mode."""
    recordings = {}
    for name, r in sample.recordings.items():
        c = r.channels["nominal_stress"]
        noise = SPREAD * float(np.max(np.abs(np.asarray(c.values))))
        recordings[name] = replace(r, channels={"nominal_stress": Channel(c.time, c.values, c.unit, noise)})
    return replace(sample, recordings=recordings)


def main(folder: Path) -> str:
    """Each source with an energy that suits it, one also with one that does not."""
    records = {}
    for source in SOURCES:
        strict = tj.read(f"{folder / 'rubber.toml'}#{source}")
        loose = spread(strict)
        for words, sample, (energy, form) in (
            ("suited, spread of sheets", loose, SUITED),
            ("nearly suited, spread of sheets", loose, NEARLY),
            ("unsuited, spread of sheets", loose, UNSUITED),
            ("suited, reading error", strict, SUITED),
        )[: 4 if source == STRICT else 1]:
            name = f"{source}, {energy}, {words.split(', ')[1]}"
            found = tj.diagnose(sample, energy, holdout=HELD, ogden_form=form, effects=TRIED, effort=EFFORT)
            records[name] = brief(found) | {"energy": words.split(",")[0]}
            if source == STRICT:
                place = folder / "figures" / f"diagnosis-{words.replace(', ', '-').replace(' ', '-')}"
                write_diagnosis(found, place, remainders=False)
            write_json(folder / "diagnosis.json", {"held_out": HELD, "spread": SPREAD, **Specimens(records).as_dict()})
    many = Specimens(records)
    write_figures(many, folder / "figures")
    return many.sentence()


if __name__ == "__main__":
    print(main(Path(__file__).parent))

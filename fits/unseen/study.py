"""Real recordings of public repositories that nobody here had seen: is the cause named, and what else?

The tables are not part of the project: `TISSUEJAX_UNSEEN` names the folder that holds them, as README.md says. One file
a sample under `results/`; a stopped study goes on.

tissuejax study fits/unseen
"""

import csv
import json
import os
import sys
import time
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import tissuejax as tj
from tissuejax.challenge.panel import answered, read_causes, summary
from tissuejax.errors import InputError
from tissuejax.progress import for_terminal
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.recordings.specimens import NO_TIME
from tissuejax.report.plot import INK, PAPER, tidy
from tissuejax.storage import write_between, write_figure, write_json

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "real-panel"))

from panel_samples import Entry, entries, thin, uniaxial  # noqa: E402
from study import KEPT, file_of  # noqa: E402

BEGIN, END = "<!-- answers: written by the study -->", "<!-- end of answers -->"
GAUGE, SECTION = 80.0, 22e-6  # mm, m^2: the elastomer's strip
STRIP = (200.0, 24.75e-3 * 3.12e-3)  # mm, m^2: the silicone's
CYLINDERS = {  # diameter and height in mm
    "Li_silicone_1": (18.8, 23.4),
    "Li_silicone_2": (18.1, 22.8),
    "Li_muscle_1": (14.0, 21.0),
    "Li_muscle_2": (14.0, 22.0),
}
BEGUN = {
    "Li_muscle_2": 0.43
}  # s: position is set to zero there; of the others the first row is a reading before the test


def folder() -> Path:
    """Where the tables lie.

    Raises:
        InputError: not there.
    """
    here = Path(os.environ.get("TISSUEJAX_UNSEEN", HERE / "tables"))
    if not here.is_dir():
        raise InputError(f"{here} is not here: set TISSUEJAX_UNSEEN to the folder of the tables that README.md names")
    return here


def columns(path: str) -> np.ndarray:
    """A table's columns as numbers, without its line of names."""
    with (folder() / path).open() as file:
        return np.array([[float(x) for x in row] for row in list(csv.reader(file))[1:] if row]).T


def elastomer(tests: tuple[str, ...]) -> Sample:
    """Strips by their crosshead; where they hang slack on the way back is left out."""
    found = {}
    for test in tests:
        t, x, force = columns(f"vhb/{test}.csv")
        taut = (np.arange(len(t)) <= np.argmax(x)) | (force > 0.01 * force.max())
        found[test] = uniaxial(
            test, t[taut], 1 + x[taut] / GAUGE, force[taut] / SECTION, area=SECTION, height=1e-3 * GAUGE
        )
    return Sample(tests[0], found)


def digitised(tests: tuple[str, ...]) -> Sample:
    """Stress in kPa; rows at which the time that the source made steps back are left out."""
    found = {}
    for test in tests:
        t, stretch, stress = columns(f"vhb-digitised/{test}.csv")
        on = t > np.concatenate([[-1.0], np.maximum.accumulate(t)[:-1]])
        found[test] = uniaxial(test, t[on], stretch[on], 1e3 * stress[on])
    return Sample(tests[0], found)


def cylinder(tests: tuple[str, ...]) -> Sample:
    """Pressed and held."""
    (test,) = tests
    diameter, height = CYLINDERS[test]
    t, force, x = columns(f"annemil/{test}.csv")
    on = t > BEGUN.get(test, 0.0)
    area = np.pi * (1e-3 * diameter) ** 2 / 4
    stretch = 1 - (x[on] - x[on][0]) / height
    size = {"area": area, "diameter": 1e-3 * diameter, "height": 1e-3 * height}
    return Sample(test, {test: uniaxial(test, t[on], stretch, -force[on] / area, **size)})


def strip(tests: tuple[str, ...]) -> Sample:
    """Two cycles of a silicone."""
    (test,) = tests
    gauge, area = STRIP
    t, x, force = columns(f"annemil/{test}.csv")
    return Sample(test, {test: uniaxial(test, t, 1 + x / gauge, 1e3 * force / area, area=area, height=1e-3 * gauge)})


def sheet(tests: tuple[str, ...]) -> Sample:
    """Green strain and second Piola-Kirchhoff stress of two axes, paired at the ratio of their last stresses."""
    place, *ratios = tests
    found = {}
    for name in ratios:
        (e1, s1), (e2, s2) = (curve(f"{place}/{axis}_{name}.csv") for axis in ("E11", "E22"))
        share = np.linspace(0, 1, 25)
        green = np.stack([np.interp(share * s1[-1], s1, e1), np.interp(share * s2[-1], s2, e2)], -1)
        stretch = np.sqrt(1 + 2 * green)
        stress = 1e3 * stretch * np.stack([share * s1[-1], share * s2[-1]], -1)
        time = np.arange(len(share), dtype=float)
        inputs = {"time": time, "stretch": stretch}
        found[name] = Recording(name, "biaxial", inputs, {"nominal_stress": Channel(time, stress, "Pa", None)}, {})
    return Sample(place, found, notes=NO_TIME)


def curve(path: str) -> tuple[np.ndarray, np.ndarray]:
    """Strain and stress from rest, in the order of the stress."""
    strain, stress = columns(path)
    order = np.argsort(stress, kind="stable")
    return np.concatenate([[0.0], strain[order]]), np.concatenate([[0.0], stress[order]])


MAKERS: dict[str, Callable[[tuple[str, ...]], Sample]] = {
    "vhb-cycles": elastomer,
    "vhb-relaxation": elastomer,
    "vhb-digitised": digitised,
    "silicone-hold": cylinder,
    "muscle-hold": cylinder,
    "silicone-strip": strip,
    "biaxial": sheet,
}


def build(entry: Entry) -> tuple[Sample, tuple[str, ...] | None]:
    """The sample, and the recordings held out (None: there is one recording)."""
    whole = MAKERS[entry.key](entry.tests)
    sample = replace(whole, name=entry.id, recordings={n: thin(r, entry.samples) for n, r in whole.recordings.items()})
    return sample, None if entry.held is None else (entry.held,)


def diagnosed(entry: Entry) -> dict:
    """What is said of one sample."""
    begun = time.perf_counter()
    sample, held = build(entry)
    found = tj.diagnose(sample, entry.energy, holdout=held, ogden_form=entry.ogden_form).as_dict()
    return {"id": entry.id, **{k: found[k] for k in KEPT if k in found}, "seconds": time.perf_counter() - begun}


def table(answers: list) -> str:
    """A line a sample."""
    lines = ["| sample | cause | verdict, stated | named | right | s |", "|---|---|---|---|---|---|"]
    for a in answers:
        named, said = " + ".join(a.named) or "-", f"{a.verdict}, {a.confidence:.2f}"
        right = "yes" if a.right else f"no ({', '.join(a.wrong)})" if a.wrong else "no"
        lines.append(f"| {a.cause.id} | {a.truth} | {said} | {named} | {right} | {a.seconds:.0f} |")
    return "\n".join(lines)


def drawn(listed: list[Entry], answers: list) -> Figure:
    """Every sample as it was recorded: stress over time where something is held, over stretch elsewhere."""
    figure = Figure(figsize=(11, 11), layout="constrained", facecolor=PAPER)
    axes = figure.subplots(4, 3).ravel()
    for ax, entry, answer in zip(axes, listed, answers):
        tidy(ax)
        held = entry.key in ("vhb-relaxation", "silicone-hold", "muscle-hold")
        for name, r in build(entry)[0].recordings.items():
            c = r.channels["nominal_stress"]
            x, y = np.asarray(r.inputs["time" if held else "stretch"]), 1e-3 * np.asarray(c.values)
            ax.plot(x, y, ".-", ms=3, lw=0.8, label=name)
        ax.set_title(f"{entry.id}: {' + '.join(answer.named)}", fontsize=8, color=INK)
        ax.set_xlabel("time, s" if held else "stretch, 1", fontsize=8)
        ax.set_ylabel("nominal stress, kPa", fontsize=8)
        if held:
            ax.set_xscale("symlog", linthresh=1.0)
    for ax in axes[len(listed) :]:
        ax.set_visible(False)
    return figure


def main(where: Path) -> str:
    """Diagnose what has no result yet, grade; returns the answer in a sentence."""
    causes, words = read_causes(where / "causes.toml")
    listed = entries(tomllib.loads((where / "causes.toml").read_text()))
    left = [e for e in listed if not file_of(where, e.id).exists()]
    if left:
        folder()
    with for_terminal().stage(f"diagnosing {len(left)} samples", len(left)) as stage:
        for entry in left:
            write_json(file_of(where, entry.id), diagnosed(entry))
            stage.advance(note=entry.id)
    answers = [answered(c, json.loads(file_of(where, c.id).read_text()), words) for c in causes]
    found = {"listed": len(causes), "answered": len(answers), **summary(answers)}
    write_json(where / "result.json", found)
    write_between(where / "README.md", BEGIN, END, table(answers))
    if "TISSUEJAX_UNSEEN" in os.environ:
        write_figure(where / "samples.png", drawn(listed, answers), dpi=90)
    right = found["rates"]["cause named and no wrong name"]
    return f"{len(answers)} samples; cause named without a wrong name in {right['share']:.0%} of {right['of']}"


if __name__ == "__main__":
    print(main(HERE))

"""What the studies of recordings that nobody had seen share: tables, one diagnosis a sample, grading, page, picture."""

import csv
import json
import os
import sys
import time
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import tissuejax as tj
from tissuejax.challenge.panel import answered, read_causes, summary
from tissuejax.errors import InputError
from tissuejax.progress import for_terminal
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.report.plot import INK, PAPER, tidy
from tissuejax.storage import write_between, write_figure, write_json

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "real-panel"))

from panel_samples import KEPT, Entry, entries, file_of, thin  # noqa: E402

BEGIN, END = "<!-- answers: written by the study -->", "<!-- end of answers -->"
Makers = Mapping[str, Callable[[tuple[str, ...]], Sample]]


def folder() -> Path:
    """Where the tables lie.

    Raises:
        InputError: not there.
    """
    here = os.environ.get("TISSUEJAX_UNSEEN", "")
    if not here or not Path(here).is_dir():
        raise InputError(
            f"no tables at {here!r}: set TISSUEJAX_UNSEEN to the folder of the tables that README.md names"
        )
    return Path(here)


def columns(path: str) -> np.ndarray:
    """A table's columns as numbers, without its line of names."""
    with (folder() / path).open() as file:
        return np.array([[float(x) for x in row] for row in list(csv.reader(file))[1:] if row]).T


def untimed(name: str, kind: str, motion: np.ndarray, stress: np.ndarray, **axes: np.ndarray) -> Recording:
    """A recording whose samples are counted, motion as stretch or as shear."""
    time = np.arange(len(motion), dtype=float)
    inputs = {"time": time, "shear" if kind == "simple-shear" else "stretch": motion}
    return Recording(name, kind, inputs, {"nominal_stress": Channel(time, stress, "Pa", None)}, axes)


def build(entry: Entry, makers: Makers) -> tuple[Sample, tuple[str, ...] | None]:
    """The sample, and the recordings held out (None: there is one recording)."""
    whole = makers[entry.key](entry.tests)
    sample = replace(whole, name=entry.id, recordings={n: thin(r, entry.samples) for n, r in whole.recordings.items()})
    return sample, {None: None, "none": ()}.get(entry.held, (entry.held,))


def diagnosed(entry: Entry, makers: Makers) -> dict:
    """What is said of one sample."""
    begun = time.perf_counter()
    sample, held = build(entry, makers)
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


def drawn(listed: list[Entry], answers: list, makers: Makers) -> Figure:
    """Every sample as it was recorded: stress over time where something is held, over stretch or shear elsewhere."""
    rows = -(-len(listed) // 3)
    figure = Figure(figsize=(11, 2.75 * rows), layout="constrained", facecolor=PAPER)
    axes = figure.subplots(rows, 3).ravel()
    for ax, entry, answer in zip(axes, listed, answers):
        tidy(ax)
        held = entry.key.endswith(("-relaxation", "-hold"))
        recordings = build(entry, makers)[0].recordings
        for name, r in recordings.items():
            along = "time" if held else "shear" if "shear" in r.inputs else "stretch"
            x, y = np.asarray(r.inputs[along]), 1e-3 * np.asarray(r.channels["nominal_stress"].values)
            ax.plot(x + (along == "shear"), y, ".-", ms=3, lw=0.8, label=name)
        sheared = any("shear" in r.inputs for r in recordings.values())
        ax.set_title(f"{entry.id}: {' + '.join(answer.named) or answer.verdict}", fontsize=8, color=INK)
        ax.set_xlabel("time, s" if held else "stretch, or one and shear" if sheared else "stretch, 1", fontsize=8)
        ax.set_ylabel("nominal stress, kPa", fontsize=8)
        if held:
            ax.set_xscale("symlog", linthresh=1.0)
    for ax in axes[len(listed) :]:
        ax.set_visible(False)
    return figure


def main(where: Path, makers: Makers) -> str:
    """Diagnose what has no result yet, grade; returns the answer in a sentence."""
    causes, words = read_causes(where / "causes.toml")
    listed = entries(tomllib.loads((where / "causes.toml").read_text()))
    left = [e for e in listed if not file_of(where, e.id).exists()]
    if left:
        folder()
    with for_terminal().stage(f"diagnosing {len(left)} samples", len(left)) as stage:
        for entry in left:
            write_json(file_of(where, entry.id), diagnosed(entry, makers))
            stage.advance(note=entry.id)
    answers = [answered(c, json.loads(file_of(where, c.id).read_text()), words) for c in causes]
    found = {"listed": len(causes), "answered": len(answers), **summary(answers)}
    write_json(where / "result.json", found)
    write_between(where / "README.md", BEGIN, END, table(answers))
    if "TISSUEJAX_UNSEEN" in os.environ:
        write_figure(where / "samples.png", drawn(listed, answers, makers), dpi=90)
    right = found["rates"]["cause named and no wrong name"]
    return f"{len(answers)} samples; cause named without a wrong name in {right['share']:.0%} of {right['of']}"

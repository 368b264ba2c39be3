"""`tissuejax inspect`: what is in a recording file."""

import argparse
from pathlib import Path
from typing import ClassVar

import numpy as np

from tissuejax.commands.command import Command, Reply
from tissuejax.commands.outputs import folder_named, listed
from tissuejax.recordings.files import names, read
from tissuejax.recordings.layouts import LAYOUTS
from tissuejax.recordings.recording import Recording, Sample
from tissuejax.recordings.remarks import remarks
from tissuejax.report.scales import display


class Inspect(Command):
    """Say and show what a file holds."""

    name: ClassVar[str] = "inspect"
    order: ClassVar[int] = 20
    summary: ClassVar[str] = "what is in a recording file, with a figure"
    teaches: ClassVar[str] = """
What a recording file holds: recordings, their kind, duration and sampling, ranges of what was done and measured, noise,
lost samples, geometry; and a figure of every channel. Everything is checked on the way, so this is also how to find out
what is wrong with a file.

  tissuejax inspect liver.h5
  tissuejax inspect rubber.toml#Treloar_1944 --out out/rubber
  tissuejax inspect specimens.toml                 names of the samples, where a file holds several
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """FILE and --out."""
        parser.add_argument(
            "file", metavar="FILE", help="recording file or side file; FILE#NAME for one sample of many"
        )
        parser.add_argument(
            "--out", "-o", type=folder_named, metavar="FOLDER", help="write the figure here (default: no figure)"
        )

    def run(self, given: argparse.Namespace) -> Reply:
        """Describe and draw."""
        known = names(given.file)
        if len(known) > 1:
            text = (
                f"{given.file} holds {len(known)} samples; inspect one as {given.file}#{known[0]}:\n  "
                + "\n  ".join(known)
            )
            return Reply({"samples": known}, text)
        sample = read(given.file)
        record = described(sample)
        written = {}
        if given.out:
            from tissuejax.report.page import write_figures  # it brings every plot along; the text comes without

            written = dict(write_figures(sample, given.out))
            if (cut := _cut(given.file, sample.name)) is not None:
                written |= write_figures(cut, given.out)
        record["files"] = {name: str(path) for name, path in written.items()}
        return Reply(record, "\n".join([*text_of(record), *(f"figure {p}" for p in listed(written))]))


def _cut(file: str, name: str):
    """What a side file's selection kept of a sample's tests; None where it cuts nothing."""
    from tissuejax.recordings.table import selections
    from tissuejax.report.kept_rows import Selections

    side = Path(file.partition("#")[0] if not Path(file).exists() else file)
    side = side if side.suffix.lower() == ".toml" else side.with_suffix(".toml")
    if not side.is_file() or file.lower().endswith((".h5", ".hdf5")):
        return None
    return Selections(selections(side, name)) or None


def remarked(sample: Sample) -> list[str]:
    """What is unusual, and the slips of probings, whose checks are brought along where there are some."""
    said = remarks(sample)
    if any(r.experiment == "probing" for r in sample.recordings.values()):
        from tissuejax.experiments.probing_slips import probing_slips

        said += probing_slips(sample)
    return said


def described(sample: Sample) -> dict:
    """A sample as plain data."""
    geometry = sample.geometry
    return {
        "sample": sample.name,
        "density": sample.density,
        "gravity": sample.gravity,
        "source": sample.source,
        "notes": sample.notes,
        "geometry": None
        if geometry is None
        else {
            "points": len(geometry.points),
            "cells": len(geometry.cells),
            "cell_type": geometry.cell_type,
            "fixed": len(geometry.fixed),
            "size": np.ptp(geometry.points, axis=0).tolist(),
        },
        "recordings": {name: _recording(r) for name, r in sample.recordings.items()},
        "remarks": remarked(sample),
    }


def _recording(recording: Recording) -> dict:
    units = {item.path: item.unit for item in LAYOUTS.get(recording.experiment, ())}
    inputs = {
        name: {"n": len(v), "min": float(np.nanmin(v)), "max": float(np.nanmax(v)), "unit": units.get(name, "1")}
        for name, v in ((n, np.asarray(v, float)) for n, v in recording.inputs.items())
        if v.size
    }
    for name in [n for n in inputs if np.shape(recording.inputs[n])[1:] == (3,)]:
        columns = np.asarray(recording.inputs[name], float).T
        inputs[name]["axes"] = {
            a: [float(np.nanmin(v)), float(np.nanmax(v))] for a, v in zip("xyz", columns, strict=True)
        }
        if name == "probe/position":
            inputs[name]["down"] = float(columns[2, 0] - np.nanmin(columns[2]))
    channels = {}
    for name, channel in recording.channels.items():
        values, time = np.asarray(channel.values, float), np.asarray(channel.time, float)
        finite = np.isfinite(values)
        channels[name] = {
            "n": len(values),
            "shape": list(values.shape),
            "unit": channel.unit,
            "min": float(values[finite].min()) if finite.any() else None,
            "max": float(values[finite].max()) if finite.any() else None,
            "noise_std": channel.noise_std,
            "lost": int((~finite).sum()),
            "duration": float(np.ptp(time)) if len(time) else 0.0,
            "rate": float(1 / np.median(np.diff(time))) if len(time) > 1 else None,
        }
    attributes = {k: v for k, v in recording.attributes.items() if isinstance(v, int | float | str)}
    return {"experiment": recording.experiment, "inputs": inputs, "channels": channels, "attributes": attributes}


def text_of(record: dict) -> list[str]:
    """The description as lines."""
    lines = [f"sample {record['sample']}" + (f", {record['source']}" if record["source"] else "")]
    if record["geometry"]:
        g = record["geometry"]
        size = " x ".join(f"{1e3 * s:.1f}" for s in g["size"])
        lines.append(
            f"  geometry: {g['cells']} {g['cell_type']} cells, {g['points']} nodes ({g['fixed']} fixed), {size} mm"
        )
    if record["notes"]:
        lines.append(f"  {record['notes']}")
    for name, r in record["recordings"].items():
        lines.append(f"  {name}: {r['experiment']}")
        for key, i in r["inputs"].items():
            if "time" not in key:
                factor, unit = display(i["unit"], max(abs(i["min"]), abs(i["max"])))
                unit = "" if unit == "1" else f" {unit}"
                ends = {"": (i["min"], i["max"])} if "axes" not in i else {f"{a} ": e for a, e in i["axes"].items()}
                span = ", ".join(f"{a}{low / factor:.4g} to {high / factor:.4g}" for a, (low, high) in ends.items())
                span += unit + (f"; {i['down'] / factor:.4g}{unit} down" if "down" in i else "")
                lines.append(f"    did       {key:<18} {span}, {i['n']} samples")
        for key, c in r["channels"].items():
            factor, unit = display(c["unit"], max(abs(c["min"] or 0), abs(c["max"] or 0)))
            span = (
                "nothing but lost samples"
                if c["min"] is None
                else f"{c['min'] / factor:.4g} to {c['max'] / factor:.4g} {unit}"
            )
            noise = f"noise {c['noise_std'] / factor:.2g} {unit}" if c["noise_std"] else "noise not recorded"
            lost = f", {c['lost']} values lost" if c["lost"] else ""
            rate = f" at {c['rate']:.3g} Hz" if c["rate"] else ""
            lines.append(
                f"    measured  {key:<18} {span}, {c['n']} samples{rate} over {c['duration']:.4g} s, {noise}{lost}"
            )
    return lines + [f"  note: {remark}" for remark in record["remarks"]]

"""`tissuejax sensitivity`: what each parameter does to each channel, and what can't be told apart."""

import argparse
from pathlib import Path
from typing import ClassVar

import numpy as np

from tissuejax.commands.arguments import positive, ranges
from tissuejax.commands.command import Command, Reply
from tissuejax.commands.outputs import add_out, folder, made
from tissuejax.commands.results import read_result
from tissuejax.energies.catalogue import name_of
from tissuejax.energies.published import published
from tissuejax.errors import InputError
from tissuejax.estimation.weights import Weights, noise
from tissuejax.experiments.predictor import predictor
from tissuejax.fitting.sensitivity import local
from tissuejax.fitting.sobol import sobol
from tissuejax.model import Model
from tissuejax.parameters import checked
from tissuejax.recordings.files import read
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.report.page import write_figures
from tissuejax.storage import write_json

MODES = ("uniaxial", "planar", "equibiaxial")


class SensitivityCommand(Command):
    """Local sensitivities, Fisher information in words, Sobol indices, with figures."""

    name: ClassVar[str] = "sensitivity"
    order: ClassVar[int] = 40
    summary: ClassVar[str] = "what each parameter does to each channel, and what can't be told apart"
    teaches: ClassVar[str] = """
What each parameter does over stretch or time (local derivatives and elasticities), which combinations of parameters
the data see (eigenvectors of the Fisher information, in words), and how much each explains over whole ranges (Sobol
indices).

Of a fitted result, on the recordings it was fitted to:
  tissuejax sensitivity rubber.toml#Treloar_1944 --result out/rubber/result.json

Of a material published by Lister 2012 (`tissuejax energies` lists them), in virtual tests with 2 % noise:
  tissuejax sensitivity --published in-vivo-2 --mode uniaxial --stretch 0.7:1.3

Ranges of the Sobol indices are 20 % either side of each value unless given: --range "energy.mu1=1kPa:3kPa".
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """FILE with --result, or --published."""
        parser.add_argument("file", nargs="?", metavar="FILE", help="recordings the result was fitted to")
        parser.add_argument("--result", type=Path, metavar="RESULT.json", help="a result of `tissuejax fit`")
        parser.add_argument("--published", metavar="NAME", help="a published material, e.g. in-vivo-1")
        parser.add_argument(
            "--mode", action="append", metavar="MODE", help=f"virtual test: {', '.join(MODES)} (default uniaxial)"
        )
        parser.add_argument(
            "--stretch", default="0.7:1.3", metavar="LOW:HIGH", help="of the virtual tests (default 0.7:1.3)"
        )
        parser.add_argument(
            "--noise", type=float, default=0.02, metavar="SHARE", help="noise over peak stress of virtual tests (0.02)"
        )
        parser.add_argument(
            "--range", action="append", default=[], metavar="PATH=LOW:HIGH", help="range for the Sobol indices"
        )
        parser.add_argument(
            "--spread", type=float, default=0.2, metavar="SHARE", help="other ranges: value -/+ this share (0.2)"
        )
        parser.add_argument(
            "--samples", type=int, default=256, metavar="N", help="base samples of Sobol, a power of two (256)"
        )
        add_out(parser, "out/NAME-sensitivity-ENERGY")

    def run(self, given: argparse.Namespace) -> Reply:
        """Local, Fisher, Sobol; figures and sensitivity.json."""
        if (given.published is None) == (given.result is None):
            raise InputError("say what to look at: FILE --result RESULT.json, or --published NAME")
        for option, share in (("--noise", given.noise), ("--spread", given.spread)):
            if not 0 < share < float("inf"):
                raise InputError(f"{option} {share}: it must be a share above zero, such as 0.02")
        model, values, posed, level, paths = _published(given) if given.published else _fitted(given)
        of = posed.sample.name if given.published is None else given.published
        energy = [] if given.published else [name_of(model.energy), *(e.name for e in model.effects)]
        out = folder(given.out, "sensitivity", of, energy, given.force)
        found = local(posed, values, paths, level)
        declared = posed.model.parameters
        bounds = {p: _around(values[p], given.spread, declared[p]) for p in paths} | ranges(
            given.range, declared, "--range"
        )
        written = write_figures(found, out)
        record = {"made": made("sensitivity", of, energy), "local": found.record()}
        if len(bounds) > 1:
            indices = sobol(
                posed, values, bounds, n=positive(given.samples, "--samples"), batched=posed.name == "homogeneous"
            )
            record["sobol"] = indices.record()
            written = written | write_figures(indices, out)
        written = dict(written) | {"numbers": write_json(out / "sensitivity.json", record)}
        record["files"] = {name: str(path) for name, path in written.items()}
        return Reply(record, text_of(record))


def text_of(record: dict) -> str:
    """Directions, what is not seen, Sobol indices."""
    lines = ["What the data see, sharpest first:"]
    lines += [f"  {i}. {d['sentence']}" for i, d in enumerate(record["local"]["directions"], start=1)]
    lines += [f"  ! {sentence}" for sentence in record["local"]["not_identified"]]
    for key, total in record.get("sobol", {}).get("total", {}).items():
        first = record["sobol"]["first"][key]
        shares = sorted(total, key=total.get, reverse=True)
        lines.append(
            f"Variance of {key} over the ranges: " + ", ".join(f"{p} {first[p]:.2f} ({total[p]:.2f})" for p in shares)
        )
    if record.get("sobol"):
        lines.append("  (first-order index, in brackets with interactions)")
    return "\n".join([*lines, "", *record["files"].values()])


def virtual(
    model: Model, values: dict, modes: tuple[str, ...], within: tuple[float, float], share: float, points: int = 121
):
    """A sample of noise-free virtual tests, and noise as a share of each peak."""
    time = np.linspace(0.0, 1.0, points)
    inputs = {"time": time, "stretch": np.linspace(*within, points)}
    empty = {"nominal_stress": Channel(time, np.zeros(points), "Pa")}
    sample = Sample("virtual tests", {mode: Recording(mode, mode, inputs, empty) for mode in modes})
    made = predictor(model, sample)
    predicted = made.predict(values)
    std = {
        f"{mode}/nominal_stress": share * float(np.abs(np.asarray(r.channels["nominal_stress"].values)).max())
        for mode, r in predicted.items()
    }
    return made, Weights(std)


def _published(given):
    material = published(given.published)
    model = Model(material.energy)
    values = {p: v for p, v in material.values.items() if p in model.parameters}
    low, _, high = given.stretch.partition(":")
    try:
        within = (float(low), float(high))
    except ValueError:
        raise InputError(f"--stretch {given.stretch}: wanted is LOW:HIGH, e.g. 0.7:1.3") from None
    if not 0 < within[0] < within[1]:
        raise InputError(f"--stretch {given.stretch}: stretches are positive, the lower one first")
    made, level = virtual(model, values, tuple(given.mode or ["uniaxial"]), within, given.noise)
    return model, values, made, level, tuple(values)


def _fitted(given):
    if given.file is None:
        raise InputError("--result needs the FILE that it was fitted to, before it")
    known = read_result(given.result)
    record, parameters = known.record, known.record["parameters"]
    sample = read(given.file)
    missing = [name for name in record["recordings"] if name not in sample.recordings]
    if missing:
        raise InputError(f"{given.file} has no recording {', '.join(missing)}, to which {given.result} was fitted")
    names = tuple(record["recordings"])
    made = predictor(known.model, sample, names)
    values = checked(known.values, made.model.parameters)
    paths = tuple(path for path, p in parameters.items() if p["free"])
    std = {key: n["std"] for key, n in record["noise"].items()}
    return made.model, values, made, noise(sample, names, std), paths


def _around(value: float, share: float, parameter) -> tuple[float, float]:
    size = abs(value) or parameter.typical
    return max(value - share * size, parameter.lower), min(value + share * size, parameter.upper)

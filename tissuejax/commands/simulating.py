"""`tissuejax simulate` and what it shares with `predict`: a material and a path give a recording."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

import numpy as np

from tissuejax.commands.arguments import seed
from tissuejax.commands.command import Command, Reply
from tissuejax.commands.outputs import add_out
from tissuejax.commands.results import Known, add_source, known
from tissuejax.energies.catalogue import volumetric
from tissuejax.errors import InputError
from tissuejax.experiments.predictor import predictor
from tissuejax.experiments.soundness import numerics, sentences
from tissuejax.experiments.virtual import as_measured, corners, material_test, probing
from tissuejax.fitting.scores import Score, scores
from tissuejax.model import Model
from tissuejax.progress import for_terminal
from tissuejax.recordings.delimited import load
from tissuejax.recordings.exports.meanings import split_unit
from tissuejax.recordings.exports.text import is_number
from tissuejax.recordings.files import read, write
from tissuejax.recordings.recording import Recording, Sample
from tissuejax.report.recording_tables import write_table
from tissuejax.report.scales import display
from tissuejax.units import factor, quantity

BULK = 20  # bulk over shear modulus of a body fitted as incompressible, where it has to be simulated


class Simulate(Command):
    """A recording from a model."""

    name: ClassVar[str] = "simulate"
    order: ClassVar[int] = 37
    summary: ClassVar[str] = "a recording that a model would give, for a rig or probe path; states for ParaView"
    teaches: ClassVar[str] = """
What a material would show in a test: a recording file (HDF5), CSV tables, a figure (PNG; SVG and PDF in print/), and
for probings the deformed states.

  tissuejax simulate --published in-vivo-1 --mode uniaxial --path "0:1 10:1.3 40:1.3 50:1"
  tissuejax simulate out/liver/result.json --mode planar --path path.csv --noise "20 Pa"
  tissuejax simulate --energy neo-hookean --set "energy.mu=3 kPa" --mode equibiaxial --path "0:1 1:1.2 60:1.2"
  tissuejax simulate out/liver/result.json --body liver.h5 --path probe.csv --radius "8 mm" --states
  tissuejax simulate out/liver/result.json --body liver.h5 --path press --states

--path is corners TIME:VALUE in seconds and stretch (or shear; biaxial: TIME:A,B), or a CSV with a line of names and
columns time and stretch (two for biaxial). --body FILE gives the body of a probing; its path is a CSV of time, x, y, z
of the tip's centre in the body's frame, or the name of a recording of that file, whose path and tip are taken. Units
may stand in the names ("x (mm)"); without, it is s and m. With --states: HDF5, XDMF and VTU series for ParaView (the
body, and as points the tip and the markers with their residuals), and, where pyvista is installed, a picture and an
animation. Without --noise nothing is added, and the file states no noise level.
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """A material, a path, and where to write."""
        add_source(parser)
        parser.add_argument(
            "--mode", default="uniaxial", metavar="KIND", help="uniaxial, planar, equibiaxial, biaxial, simple-shear"
        )
        parser.add_argument(
            "--path", required=True, metavar="PATH", help="corners TIME:VALUE, a CSV file, or a probing of --body"
        )
        parser.add_argument("--rate", type=float, default=10.0, metavar="HZ", help="samples a second (default 10)")
        parser.add_argument("--body", metavar="FILE", help="sample with a body: simulate a probing of it")
        parser.add_argument("--radius", metavar="VALUE", help='of the tip, e.g. "8 mm"')
        add_output(parser)
        parser.add_argument("--noise", metavar="VALUE", help='noise to add, e.g. "20 Pa" or "3 mN"')
        parser.add_argument("--seed", type=seed, default=0, help="of the noise (default 0)")

    def run(self, given: argparse.Namespace) -> Reply:
        """Make the recording, predict it, write it."""
        of = known(given)
        if given.body is None:
            if not given.rate > 0:
                raise InputError(f"--rate {given.rate:g}: wanted are samples a second, above 0")
            time, drive = (
                table(given.path, "stretch", "1") if Path(given.path).is_file() else corners(given.path, given.rate)
            )
            sample = Sample(f"{of.name}-simulated", {given.mode: material_test(given.mode, given.mode, time, drive)})
        else:
            body = read(given.body)
            made = _probing(body, given)
            sample = Sample(f"{body.name}-simulated", {"probing": made}, body.geometry, body.density, body.gravity)
        unit = "N" if given.body else "Pa"
        noise = None if given.noise is None else quantity(given.noise, unit, "--noise")
        if noise is not None and noise < 0:
            raise InputError(f"--noise {given.noise}: a standard deviation, 0 or more")
        out = given.out or Path("out") / sample.name
        return simulated(of, sample, tuple(sample.recordings), given, out, noise)


def _probing(body: Sample, given: argparse.Namespace) -> Recording:
    """The probing that --path and --radius describe: a table's, or one that the body's file holds."""
    radius = None if given.radius is None else quantity(given.radius, "m", "--radius")
    known = body.recordings.get(given.path)
    if known is not None and known.experiment == "probing":
        of, time = known.attributes, np.asarray(known.inputs["probe/time"], float)
        path = np.asarray(known.inputs["probe/position"], float)
        made = probing("probing", time, path, float(of["probe/radius"]) if radius is None else radius)
        edge = {"probe/edge": of["probe/edge"]} if "probe/edge" in of and radius is None else {}
        return Recording(made.name, made.experiment, made.inputs, made.channels, {**made.attributes, **edge})
    if radius is None:
        raise InputError('a probing needs the radius of the tip: --radius "8 mm"')
    if not Path(given.path).is_file():
        there = ", ".join(n for n, r in body.recordings.items() if r.experiment == "probing") or "none"
        raise InputError(f"--path {given.path}: no such file, and no probing of {given.body} (there: {there})")
    return probing("probing", *table(given.path, "probe position", "m"), radius)


def add_output(parser: argparse.ArgumentParser) -> None:
    """--states, --no-pictures, --compression, --out."""
    parser.add_argument("--states", action="store_true", help="of a probing: the deformed states too")
    parser.add_argument("--no-pictures", action="store_true", help="no figure, nor picture or animation of the states")
    parser.add_argument("--compression", type=float, metavar="F", help="of a probing: run F times faster than life")
    parser.add_argument("--mesh", choices=["graded", "file"], help="of a probing: the file's mesh or a graded one")
    add_out(parser, "out/NAME-simulated or out/NAME-predicted")


def simulated(
    of: Known, sample: Sample, names: tuple[str, ...], given: argparse.Namespace, out: Path,
    noise: float | None = None, measured: bool = False,
) -> Reply:  # fmt: skip
    """Predict `names` of a sample and write recording file, tables and states; `measured` puts the data beside."""
    target = out / f"{sample.name}.h5"
    if target.exists() and not given.force:
        raise InputError(f"{target}: is there already; name another folder with --out, or give --force to overwrite it")
    assumed = of.said
    probings = [n for n in names if sample.recordings[n].experiment == "probing"]
    options = {}
    model, values = Model(of.model.energy, of.model.volumetric, of.model.effects), of.values
    if probings:
        options = {k: getattr(given, k) for k in ("compression", "mesh") if getattr(given, k) is not None}
        if model.volumetric is None:
            model = Model(model.energy, volumetric("quadratic"), model.effects)
            constants = {n.removeprefix("energy."): v for n, v in values.items() if n.startswith("energy.")}
            K = BULK * float(model.energy.initial_shear_modulus(constants))
            values = values | {"volumetric.K": K}
            assumed += [f"the body was taken as nearly incompressible, K = {K:.4g} Pa ({BULK} shear moduli)"]
    made = predictor(model, sample, names, **options)
    values = {p: v for p, v in values.items() if p in made.model.parameters or p in made.model.declared}
    missing = [p for p, d in made.model.parameters.items() if d.each and p not in values]
    predicted = made.predict(values)
    recorded = as_measured(predicted, noise, getattr(given, "seed", 0))
    kept = Sample(sample.name, recorded, sample.geometry, sample.density, sample.gravity, f"predicted by {of.name}", "")
    files = {"recording": write(kept, target)}
    for name, recording in recorded.items():
        paths = write_table(recording, out, sample.recordings[name] if measured else None)
        files |= {p.stem: p for p in paths}
    notes = assumed
    notes += sentences(numerics(predicted))
    if missing:
        own = ", ".join(missing)
        notes.append(f"{own}: a value of its own for each recording, not known here; taken as neutral")
    files |= _figure(predicted, sample, measured, out) if not given.no_pictures else {}
    if given.states and not probings:
        raise InputError("--states is for probings: a material test has one state of strain everywhere")
    for name in probings if given.states else ():
        files |= _states(
            made, values, name, out, predicted[name], sample.recordings[name] if measured else None, given, notes
        )
    peaks = {n: _peaks(r) for n, r in recorded.items()}
    lines = [f"{n}: " + ", ".join(f"{c} to {v:.4g} {u}" for c, (v, u) in p.items()) for n, p in peaks.items()]
    errors = _errors(sample.recordings, predicted) if measured else {}
    wide = 2 + max(len(k) for k in (*errors, *files))
    for key, s in errors.items():
        scale, unit = display(s.unit, s.rmse)
        lines.append(f"  {key:<{wide}}RMSE {f'{s.rmse / scale:.3g} {unit}':<12}R2 {s.r2:.4f}")
    lines += [f"  ! {note}" for note in notes] + [f"{k:<{wide}} {p}" for k, p in files.items()]
    record = {"recordings": peaks, "notes": notes, "files": {k: str(p) for k, p in files.items()}}
    record |= {"errors": {k: {"rmse": s.rmse, "unit": s.unit, "r2": s.r2} for k, s in errors.items()}} if errors else {}
    return Reply(record, "\n".join(lines))


def _figure(predicted: Mapping[str, Recording], sample: Sample, measured: bool, out: Path) -> dict[str, Path]:
    from tissuejax.report.page import write_figures  # it brings every plot along
    from tissuejax.report.simulated import Simulated

    return dict(write_figures(Simulated(predicted, sample.recordings if measured else None, sample.timed), out))


def _states(made, values, name, out, predicted: Recording, measured, given, notes) -> dict[str, Path]:
    from tissuejax.experiments.probing_states import keep_states
    from tissuejax.report.scene_pictures import film, write_pictures

    found = keep_states(made, values, name, out, for_terminal(), predicted=predicted, measured=measured)
    if not given.no_pictures:
        try:
            found |= write_pictures(film(found["states"], predicted, measured), out)
        except InputError as error:
            notes.append(str(error))
    return {f"{name} {key}": path for key, path in found.items()}


def _peaks(recording: Recording) -> dict[str, tuple[float, str]]:
    return {
        name: (float(np.nanmax(np.abs(np.asarray(c.values, float)))), c.unit) for name, c in recording.channels.items()
    }


def _errors(measured: Mapping[str, Recording], predicted: Mapping[str, Recording]) -> dict[str, Score]:
    """How far the prediction is from what was measured, by recording/channel."""
    channels = [f"{n}/{c}" for n, made in predicted.items() for c in made.channels]
    return scores(measured, predicted, dict.fromkeys(channels, 1.0))


def table(path: str, what: str, si: str) -> tuple[np.ndarray, np.ndarray]:
    """Time (s) and the other columns, in `si`, of a table with a line of names; units may stand in the names.

    Raises:
        InputError: no such file, cells that are no numbers, fewer than two rows or columns, a unit of another kind.
    """
    if not Path(path).is_file():
        raise InputError(f"{path}: no such file; wanted is a CSV of time and {what}")
    columns = load(Path(path))
    names = list(columns.cells)
    wanted = f"wanted are a line of names and rows of numbers, time (s) and {what}"
    if len(columns.lines) < 2 or len(names) < 2 or all(is_number(n) for n in names):
        raise InputError(f"{path}: {wanted}")
    units = [split_unit(n)[1] or default for n, default in zip(names, ["s"] + [si] * len(names), strict=False)]
    rows = np.stack(
        [columns.numbers(n) * factor(u, "s" if k == 0 else si) for k, (n, u) in enumerate(zip(names, units))], 1
    )
    if not np.isfinite(rows).all():
        raise InputError(f"{path}: found an empty cell; {wanted}")
    return rows[:, 0], rows[:, 1] if rows.shape[1] == 2 else rows[:, 1:]

"""`tissuejax import`: a lab's own file understood, as a side file that runs, or as a recording file."""

import argparse
import os
import shlex
from pathlib import Path
from typing import ClassVar

from tissuejax.commands.command import Command, Reply
from tissuejax.commands.inspecting import remarked
from tissuejax.errors import InputError
from tissuejax.mesh import probing_files
from tissuejax.mesh.probing_files import describes_a_body, probing_sample
from tissuejax.recordings import cutting_table
from tissuejax.recordings.files import names, read, write
from tissuejax.recordings.guessing import Guess, guessed
from tissuejax.recordings.layouts import layout
from tissuejax.recordings.places import refuse_no_file
from tissuejax.recordings.remarks import remarks
from tissuejax.recordings.side_writing import side_text, slab_text, template
from tissuejax.storage import printable, shown, write_text
from tissuejax.units import quantity

# The example at the top of mesh/probing_files.py is the template: there is one text to keep right.
PROBE = "\n".join(line[4:] for line in probing_files.__doc__.splitlines() if line.startswith("    ")) + "\n"
# So is that of recordings/cutting_table.py; its profile names a file that may not be there.
CUT = 'file = "my.csv"\nsample = "s1"\nrecording = "pass-1"\n' + "\n".join(
    f"# {line}" if line.startswith("profile") else line
    for line in cutting_table.__doc__[cutting_table.__doc__.index("experiment") :].splitlines()
)
WHOLE = {"probe": PROBE, "cutting": CUT + "\n", "cut": CUT + "\n"}  # templates of files with more than columns
SIZES = ("height", "diameter", "width", "thickness", "area", "radius")


class Import(Command):
    """Look at a lab's own table and write its side file; or write recording files (HDF5) from a side file."""

    name: ClassVar[str] = "import"
    order: ClassVar[int] = 15
    summary: ClassVar[str] = "your own CSV or machine export: guesses what it holds, writes a side file that runs"
    teaches: ClassVar[str] = """
Begin here with your own data.

  tissuejax import my.csv                                  look at a table or raw export, write my.toml beside it
  tissuejax import my.csv --experiment compression --height 10mm --diameter 25mm
  tissuejax inspect my.toml --out look                     then: what is in it, with figures
  tissuejax fit my.toml --energy neo-hookean

The separator, decimal sign, encoding, key lines, row of units, the columns and the specimen sizes in the file are
guessed; what was assumed is said, and stands as comments in the side file, which you can change. Raw exports of test
machines, rheometers and indenters are recognised by their content.

  tissuejax import --template tension                      an empty side file to fill in (also compression, planar,
                                                           equibiaxial, biaxial, simple-shear, probing, probe, cutting)
  tissuejax import probe.toml                              a probing: surface (STL), probe path, force, markers
  tissuejax import my.toml my.h5                           a recording file (HDF5) from a side file
  tissuejax import specimens.toml out/                     one recording file for each sample of it
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """FILE, OUT and what the user knows better than the guess."""
        parser.add_argument("file", metavar="FILE", nargs="?", help="table, raw export, or side file (SIDE.toml#NAME)")
        parser.add_argument(
            "out",
            metavar="OUT",
            type=Path,
            nargs="?",
            help="side file (.toml) or recording file (.h5) to write, or folder",
        )
        parser.add_argument("--template", metavar="KIND", help="print a side file to fill in, or write it to OUT")
        parser.add_argument(
            "--experiment", default="", metavar="KIND", help="tension, compression, biaxial, probing, ..."
        )
        parser.add_argument("--positive", choices=("tension", "compression"), default="", help="which counts positive")
        parser.add_argument(
            "--format", default="", metavar="NAME", help="the raw export's format, if it isn't recognised"
        )
        parser.add_argument(
            "--columns", default="", metavar="LIST", help='what the columns hold: "time s, displacement mm, -, force N"'
        )
        for size in SIZES:
            example = "78.5mm^2" if size == "area" else "25mm"
            parser.add_argument(f"--{size}", metavar="SIZE", help=f'{size} with its unit, e.g. "{example}"')
        parser.add_argument("--slab", metavar="SIZE", help="of an indentation: thickness of the layer pressed")
        parser.add_argument("--force", action="store_true", help="overwrite what is there")

    def run(self, given: argparse.Namespace) -> Reply:
        """Guess, or convert."""
        if given.template is not None:
            return _template(given)
        if given.file is None:
            raise InputError("found no FILE: give a table, a raw export or a side file, or --template KIND")
        if given.file.lower().endswith(".toml") and Path(given.file).is_file() and describes_a_body(Path(given.file)):
            return _probed(given)
        if given.file.partition("#")[0].lower().endswith((".toml", ".h5", ".hdf5", ".yaml", ".yml")):
            return _converted(given)
        return _guessed(given)


def _template(given: argparse.Namespace) -> Reply:
    text = WHOLE.get(given.template) or template(given.template)
    out = given.out or (Path(given.file) if given.file else None)
    if out is None:
        return Reply({"template": text}, text.rstrip())
    _free(out, given.force)
    return Reply({"template": text, "written": str(write_text(out, text))}, f"wrote {out}; fill it in, then inspect it")


def _guessed(given: argparse.Namespace) -> Reply:
    from tissuejax.recordings.side_file import experiment_of

    path = Path(given.file)
    _refuse_nothing(path)
    kind, sense = experiment_of(given.experiment) if given.experiment else ("", "")
    sizes = {size: getattr(given, size) for size in SIZES if getattr(given, size)}
    columns = given.columns.split(",") if given.columns else ()
    if given.slab and quantity(given.slab, "m", "--slab") <= 0:
        raise InputError(f"--slab {given.slab}: the layer's thickness, above zero")
    guess = guessed(path, kind, given.positive or sense, sizes, given.format, columns)
    single = given.out is not None and given.out.suffix in (".h5", ".hdf5")
    side = path.with_name(f"{_stem(path)}.toml") if given.out is None or single else given.out
    if side.suffix != ".toml":
        raise InputError(f"{side}: expected a side file (.toml) or a recording file (.h5) to write")
    _free(side, given.force)
    file = os.path.relpath(path, side.parent) if side.parent != path.parent else path.name
    write_text(side, side_text(guess, file))
    return _said(guess, side, given)


def _said(guess: Guess, side: Path, given: argparse.Namespace) -> Reply:
    quoted, table = _quoted(side), _quoted(guess.path)
    lines = [f"{shown(guess.path)}: {guess.machine or 'a table'}", *(f"  assumed: {s}" for s in guess.said)]
    lines += [f"  not used: {', '.join(guess.unused)}"] if guess.unused else []
    record = {"side_file": str(side), "assumed": list(guess.said), "lacking": list(guess.lacking), "remarks": []}
    record["unused"] = list(guess.unused)
    if guess.lacking:
        options = " ".join(f"--{name} ..." for name in guess.lacking)
        options = options.replace("--area ...", "--area ... (or --diameter ...)")
        needs = f"which still needs: {', '.join(guess.lacking)}. Write them into the lines marked"
        lines += ["", f"wrote {shown(side)}, {needs}"]
        now = f", or give them now: tissuejax import {table} {options} --force"
        lines.append("FILL IN" + (", and look at what each column is." if guess.experiment == "cutting" else now))
        return Reply(record, "\n".join(lines), 2)
    for name in names(side):
        try:
            sample = read(side, name)
        except InputError as fault:
            raise InputError(
                f"{fault} ({side} was written: mend it there, or say it otherwise here, with --force)"
            ) from None
        for key, recording in sample.recordings.items():
            units = {i.path: f" {i.unit}" for i in layout(recording.experiment) if i.unit != "1"}
            spans = {k: (v, units.get(k, "")) for k, v in recording.inputs.items() if "time" not in k}
            spans |= {k: (c.values, f" {c.unit}") for k, c in recording.channels.items()}
            said = ", ".join(f"{k} {v.min():.4g} to {v.max():.4g}{unit}" for k, (v, unit) in spans.items())
            n = len(next(iter(spans.values()))[0])
            lines.append(f"  {name}, {key}: {recording.experiment}, {n} samples, {said}")
        found = remarks(sample)
        record["remarks"] += found
        lines += [f"  note: {remark}" for remark in found]
    lines += ["", f"wrote {shown(side)}"]
    if given.out is not None and given.out.suffix in (".h5", ".hdf5"):
        record |= _written(str(side), given.out, given.force)
        lines.append(f"wrote {shown(given.out)}")
    lines.append(f"look   tissuejax inspect {quoted} --out look")
    if guess.experiment != "probing":
        lines.append(f"fit    tissuejax fit {quoted} --energy neo-hookean")
    elif given.slab:
        body = side.with_name(f"{side.stem}-body.toml")
        _free(body, given.force)
        record["body_file"] = str(write_text(body, slab_text(guess, side.name, given.slab)))
        lines.append(f"body   tissuejax import {_quoted(body)}   (a layer of {given.slab}; then fit its .h5)")
    else:
        told = shlex.join([x for name in SIZES if getattr(given, name) for x in (f"--{name}", getattr(given, name))])
        again = " ".join(filter(None, [f"tissuejax import {table}", told, "--slab 20mm --force"]))
        lines.append(f"fit    needs the body under the tip. If that is a flat layer, say how thick: {again}")
    return Reply(record, "\n".join(lines))


def _probed(given: argparse.Namespace) -> Reply:
    side = Path(given.file)
    out = given.out or side.with_suffix(".h5")
    if out.suffix not in (".h5", ".hdf5"):
        raise InputError(f"{out}: expected a recording file (.h5) to write")
    _free(out, given.force)
    sample = probing_sample(side)
    write(sample, out)
    found = remarked(sample)
    lines = [sample.notes.replace(". ", ".\n"), *(f"note: {remark}" for remark in found), f"wrote {shown(out)}"]
    quoted = _quoted(out)
    lines += [f"look   tissuejax inspect {quoted} --out look"]
    lines += [f"fit    tissuejax fit {quoted} --energy reduced-polynomial-2 --volumetric quadratic"]
    written = {sample.name: {"file": str(out), "recordings": len(sample.recordings)}}
    return Reply({"written": written, "notes": sample.notes, "remarks": found}, "\n".join(lines))


def _converted(given: argparse.Namespace) -> Reply:
    if given.out is None:
        raise InputError(
            f"{given.file}: name what to write: a recording file, e.g. {Path(given.file).stem}.h5, or a folder"
        )
    known = names(given.file)
    if given.out.suffix in (".h5", ".hdf5") and len(known) > 1:
        raise InputError(
            f"{given.file} holds {len(known)} samples, {given.out} is one file: give a folder, or "
            f"{given.file}#{known[0]}"
        )
    if given.out.suffix not in (".h5", ".hdf5", "") and not given.out.is_dir():
        raise InputError(f"{given.out}: expected a recording file (.h5) or a folder to write")
    record = _written(given.file, given.out, given.force)
    text = "\n".join(f"{w['file']}: {name}, {w['recordings']} recordings" for name, w in record["written"].items())
    return Reply(record, text)


def _written(file: str, out: Path, force: bool) -> dict:
    single = out.suffix in (".h5", ".hdf5")
    known = names(file)
    targets = {name: out if single else out / f"{name}.h5" for name in known}
    for path in targets.values():
        _free(path, force)
    written = {}
    for name, path in targets.items():
        sample = read(file, name)
        write(sample, path)
        written[name] = {"file": str(path), "recordings": len(sample.recordings)}
    return {"written": written}


def _free(path: Path, force: bool) -> None:
    if path.exists() and not force:
        raise InputError(f"{path}: is there already; name another file, or give --force to overwrite it")


def _stem(path: Path) -> str:
    name = path.name.removesuffix(".gz")
    return name.rpartition(".")[0] or name


def _quoted(path: Path) -> str:
    """A path for a command line to copy; one with a line break in the way that shells write it."""
    text = str(path)
    return shlex.quote(text) if text.isprintable() else "$'" + printable(text).replace("'", "\\'") + "'"


def _refuse_nothing(path: Path) -> None:
    """Refuse what isn't a readable file with something in it.

    Raises:
        InputError: no such file, a folder, one that can't be read, an empty file.
    """
    refuse_no_file(path, "a table of columns")
    try:
        with open(path, "rb") as file:
            content = file.read(1)
    except OSError as error:
        raise InputError(f"{shown(path)}: can't be read ({error.strerror}); check its rights and its disk") from error
    if not content:
        raise InputError(f"{path}: found an empty file, expected a table of columns")

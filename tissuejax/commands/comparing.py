"""`tissuejax compare`: energies and effects on one sample, in one table and on one page."""

import argparse
from pathlib import Path
from typing import ClassVar

from tissuejax import verbs
from tissuejax.commands.arguments import add_fit, fit_options
from tissuejax.commands.command import Command, Reply
from tissuejax.commands.outputs import add_out, folder, made
from tissuejax.commands.results import FAULTS, no_result, read_record
from tissuejax.errors import InputError, TissueError, unknown
from tissuejax.fitting.comparison import compare, name_of
from tissuejax.progress import for_terminal
from tissuejax.recordings.files import read
from tissuejax.report.comparison_page import write_comparison
from tissuejax.report.comparison_table import lines, verdict

OF_A_PATH = ("fix", "start", "bounds", "prior", "free")


class Compare(Command):
    """Fit every energy with every set of effects, or take fits that are there, and rank them."""

    name: ClassVar[str] = "compare"
    order: ClassVar[int] = 35
    summary: ClassVar[str] = "energies and effects on one sample: AIC, BIC, held-out error, curves over each other"
    teaches: ClassVar[str] = """
Fit several strain energies to the same recordings, each bare and with each set of effects, and say which the data
support: AIC, BIC, Akaike weights, error of what was held out, and all curves over each other.

  tissuejax compare rubber.toml -e neo-hookean -e mooney-rivlin -e reduced-polynomial-3 --holdout planar
  tissuejax compare liver.h5 -e demiray -e neo-hookean --effect viscoelasticity --effect viscoelasticity+slack
  tissuejax compare out/a/result.json out/b/result.json       fits made before; refused if their data differ

--fix, --start, --bounds, --prior and --free act on the models that have the parameter. Into --out go comparison.json,
comparison.csv and .tex (SI), report.html, the figures (PNG; SVG and PDF in print/) and, of fits made here, their curves
as curves.csv; a model that can't be fitted is listed with its reason.
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """FILE or RESULT.json files, --energy and --effect several times, fit options, --out."""
        parser.add_argument(
            "files", nargs="+", metavar="FILE", help="recordings of one sample, or two result.json or more"
        )
        parser.add_argument("--energy", "-e", action="append", default=[], metavar="NAME", help="an energy (repeat)")
        parser.add_argument(
            "--effect", action="append", default=[], metavar="NAME", help="a set of effects, A or A+B (repeat)"
        )
        parser.add_argument("--only-with-effects", action="store_true", help="leave the bare energies out")
        parser.add_argument("--ogden-form", metavar="FORM", help="what Ogden constants mean")
        parser.add_argument("--volumetric", metavar="NAME", help="volumetric energy; left out: incompressible")
        add_fit(parser)
        add_out(parser, "out/SAMPLE-compare")

    def run(self, given: argparse.Namespace) -> Reply:
        """Fit or read, compare, write."""
        if all(name.endswith(".json") for name in given.files):
            records = _records(given.files)
            found, named = compare(records), sorted(records)
            out = folder(
                given.out or Path("out") / f"{found.sample}-compare", "compare", found.sample, named, given.force
            )
        else:
            found, out, named = self._fitted(given)
        written = write_comparison(found, out, made("compare", found.sample, named))
        rows = lines(found)
        width = max(len(r["name"]) for r in rows) + 2
        text = [
            verdict(found),
            "",
            f"{'model':<{width}}{'k':>4}{'dAIC':>12}{'dBIC':>12}{'weight':>8}  RMSE fitted, held out",
        ]
        text += [
            f"{r['name']:<{width}}{r['free']:>4}{r['aic']:>12}{r['bic']:>12}{r['weight']:>8}  "
            + r["fitted"]
            + (f", {r['held']}" if r["held"] else "")
            for r in rows
        ]
        text += [f"  ! {r['name']}: {r['note']}" for r in rows if r["note"]]
        text += [f"  ! {name} gave no answer: {why}" for name, why in found.failed.items()]
        text += ["", f"page     {written['page']}", f"numbers  {written['result']}"]
        record = found.record() | {"files": {name: str(path) for name, path in written.items()}}
        return Reply(record, "\n".join(text))

    def _fitted(self, given: argparse.Namespace):
        if len(given.files) > 1:
            raise InputError(
                "compare takes one FILE of recordings, or only result.json files; give one sample at a time"
            )
        if not given.energy:
            raise InputError("say what to compare: --energy NAME, several times")
        sample = read(given.files[0])
        sets = [tuple(text.split("+")) for text in given.effect]
        sets = sets if given.only_with_effects and sets else [(), *sets]
        models = {}
        for energy in dict.fromkeys(given.energy):
            form = given.ogden_form if energy.startswith("ogden") else None
            for effects in dict.fromkeys(sets):
                model = verbs.material(energy, ogden_form=form, volumetric=given.volumetric, effects=effects)
                models[" + ".join([energy, *effects])] = model.across(tuple(sample.recordings))
        _check_paths(given, models)
        named, records, fits, failed = sorted(models), {}, {}, {}
        place = given.out or Path("out") / f"{sample.name}-compare"
        out = folder(place, "compare", sample.name, named, given.force)
        with for_terminal().stage(f"fitting {len(models)} models to {sample.name}", len(models)) as stage:
            for name, model in models.items():
                try:
                    fits[name] = verbs.fit(sample, model, **fit_options(_own(given, model), model.parameters))
                    records[name] = fits[name].record()
                except TissueError as error:
                    failed[name] = str(error)
                stage.advance(note=name)
        return compare(records, failed, fits), out, named


def _path(text: str) -> str:
    return text.partition("=")[0].strip()


def _check_paths(given: argparse.Namespace, models: dict) -> None:
    known = {path for model in models.values() for path in model.parameters}
    for option in OF_A_PATH:
        for text in getattr(given, option) or ():
            if _path(text) not in known:
                raise unknown("parameter", _path(text), known)


def _own(given: argparse.Namespace, model) -> argparse.Namespace:
    """The options with only those paths that this model has."""
    own = {
        option: [text for text in getattr(given, option) or () if _path(text) in model.parameters] or None
        for option in OF_A_PATH
    }
    return argparse.Namespace(**(vars(given) | {k: v or (None if k == "free" else []) for k, v in own.items()}))


def _records(files: list[str]) -> dict[str, dict]:
    """Records by what was fitted; two of one name are told apart by their folder."""
    found = {}
    for file in files:
        try:
            record = read_record(Path(file))
            name = name_of(record)
            record["channels"], record["noise"], record["parameters"]
        except FAULTS as error:
            raise no_result(Path(file), error) from error
        found[name if name not in found else f"{name} ({Path(file).parent})"] = record
    if len(found) < 2:
        raise InputError("one result alone can't be compared; give two or more, or recordings and --energy")
    return found

"""`tissuejax fit`: parameters of a strain energy from recordings, with uncertainties, figures and a held-out check."""

import argparse
import csv
import io
from pathlib import Path
from typing import ClassVar

from tissuejax import verbs
from tissuejax.commands.arguments import add_fit, add_model, fit_options
from tissuejax.commands.command import SUSPECT, Command, Reply
from tissuejax.commands.outputs import KEPT, add_out, folder, made, refuse_other, refuse_other_data
from tissuejax.errors import InputError
from tissuejax.fitting.advice import suspect
from tissuejax.fitting.first import First
from tissuejax.fitting.result import Fit, described
from tissuejax.fitting.setup import split
from tissuejax.model import Model
from tissuejax.progress import for_terminal
from tissuejax.recordings.files import read, read_all
from tissuejax.report import sentences
from tissuejax.report.page import write_fit
from tissuejax.report.scales import with_unit
from tissuejax.storage import write_text


class FitCommand(Command):
    """Fit a sample and write result.json, report.html and figures."""

    name: ClassVar[str] = "fit"
    order: ClassVar[int] = 30
    summary: ClassVar[str] = "estimate parameters from recordings, with uncertainties and a held-out check"
    teaches: ClassVar[str] = """
Estimate the parameters of a strain energy from the recordings of one sample.

FILE is a recording file (.h5) or a side file (.toml) that says how to read a lab's own table; FILE#NAME picks one
sample of many. All recordings are fitted together, except those held out, which are predicted only. What is written
into --out: result.json (every number), report.html (one page to read and keep) and the figures as PNG.

  tissuejax fit liver.h5 --energy reduced-polynomial-2 --holdout r3 --out out/liver
  tissuejax fit rubber.toml --energy ogden-3 --ogden-form mu/alpha --out out/rubber
  tissuejax fit specimens.toml --each --energy reduced-polynomial-3          every sample of a file, one table
  tissuejax fit probing.h5 --energy reduced-polynomial-2 --holdout r3        force and markers of probings together
  tissuejax fit skin.toml --energy demiray+fibre --fix "energy.kappa=0.1" --bounds "energy.k2=0:50"

  tissuejax fit organ.h5 --energy reduced-polynomial-2 --first organ.play.h5     a surrogate first, then simulations

A fit of probings simulates, so it takes minutes; killed, it goes on from its last iterate when the same command is
given again (--out holds checkpoint.json until it has ended). All recordings share one material; --only NAME fits one
site.
--method stress-curve is the manual iteration of the source made automatic, for comparison.

Exit code 0: done; 2: the input can't be used (the message says why); 3: the search did not converge; 4: it did, and the
numbers should not be used as they are: a parameter at its bound, an energy that is unstable in the recorded range, or a
misfit of several times the noise. With 3 and 4 what was found is written all the same, with the reason on top.
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """FILE, model, fit options and --out."""
        parser.add_argument(
            "file", metavar="FILE", help="recording file or side file; FILE#NAME for one sample of many"
        )
        add_model(parser)
        add_fit(parser)
        parser.add_argument(
            "--first", metavar="FILE", help="for probings: fit this surrogate (`precompute`) first and begin there"
        )
        parser.add_argument("--each", action="store_true", help="fit every sample of FILE for itself, numbers only")
        add_out(parser, "out/SAMPLE-fit-ENERGY, with --each out/FILE-fits-ENERGY")

    def run(self, given: argparse.Namespace) -> Reply:
        """Read, fit, write."""
        if given.each:
            if given.first is not None:
                raise InputError("--first with --each: a surrogate is of one sample; fit its file alone")
            return self._each(given)
        sample = read(given.file)
        model = verbs.material(
            given.energy, ogden_form=given.ogden_form, volumetric=given.volumetric, effects=given.effect
        ).across(tuple(sample.recordings))
        out = folder(given.out, "fit", sample.name, _named(model), given.force)
        if not given.force:
            refuse_other_data(out, *split(sample, tuple(given.only), tuple(given.holdout)))
        options = fit_options(given, model.parameters, out / KEPT)
        found = verbs.fit(sample, model, first=given.first, progress=for_terminal(), **options)
        return reply(found, verbs.write(found, out))

    def _each(self, given: argparse.Namespace) -> Reply:
        """Every sample of a file: result.json for each, one table of all parameters."""
        samples = read_all(given.file)
        plain = verbs.material(
            given.energy, ogden_form=given.ogden_form, volumetric=given.volumetric, effects=given.effect
        )
        out = given.out or Path("out") / "-".join([Path(given.file).stem, "fits", *_named(plain)])
        if not given.force:
            for name in samples:
                refuse_other(out / name, made("fit", name, _named(plain)))
        rows, codes, progress = {}, [], for_terminal()
        with progress.stage(f"{given.energy} on {len(samples)} samples", len(samples)) as stage:
            for name, sample in samples.items():
                model = plain.across(tuple(sample.recordings))
                found = verbs.fit(sample, model, **fit_options(given, model.parameters))
                write_fit(found, out / name, pictures=False)
                doubts = "; ".join(suspect(found))
                rows[name] = {"status": found.status, "suspect": doubts, "chi2_per_dof": found.chi2_per_dof}
                rows[name] |= {path: found.values[path] for path in found.free}
                rows[name] |= {f"std {path}": found.std[path] for path in found.free}
                codes.append(_code(found))
                stage.advance(note=name)
        columns = list(dict.fromkeys(column for row in rows.values() for column in row))
        text = io.StringIO()
        writer = csv.DictWriter(text, ["sample", *columns])
        writer.writeheader()
        writer.writerows({"sample": name} | row for name, row in rows.items())
        table = write_text(out / "fits.csv", text.getvalue())
        outcome = f"{codes.count(0)} of {len(rows)} samples converged to numbers that can be used"
        outcome += f", {codes.count(SUSPECT)} are suspect (column suspect)" if SUSPECT in codes else ""
        outcome += f", {codes.count(3)} did not converge" if 3 in codes else ""
        code = 3 if 3 in codes else max(codes, default=0)
        return Reply({"fits": rows, "table": str(table)}, f"{outcome}; table {table}", code)


def begun(first: First) -> str:
    """Where a surrogate led, in a line."""
    rms = first.force_rms
    said = f"began where a surrogate led: moduli {first.factor:.3g} times the tabulated, force of "
    said += f"{', '.join(first.used)} off by {1e3 * rms['after']:.3g} mN (tabulated {1e3 * rms['before']:.3g})"
    return said + (f"; outside its box {', '.join(first.left_out)}" if first.left_out else "")


def _named(model: Model) -> list[str]:
    """Energy and effects as they are typed, for the name of a folder."""
    terms = {e.name: getattr(e, "terms", 1) for e in model.effects}
    return [described(model)["name"], *(f"{n}-{k}" if isinstance(k, int) and k > 1 else n for n, k in terms.items())]


def _code(found: Fit) -> int:
    return 3 if not found.converged else SUSPECT if suspect(found) else 0


def reply(found: Fit, written: dict[str, Path]) -> Reply:
    """The answer to a fit: the record, and the main numbers as text."""
    doubts = suspect(found)
    lines = [sentences.summary(found), ""]
    lines += [f"DON'T USE THESE NUMBERS AS THEY ARE: {'; '.join(doubts)}.", ""] if doubts else []
    lines += [
        f"  {row['path']:<34} {with_unit(row['value'], row['unit']):>33}  {row['note'] or row['interval']}"
        for row in sentences.table(found)
    ]
    if found.shear_moduli:
        at_once, left = found.shear_moduli.values()
        lines += ["", f"  shear modulus: instantaneous {at_once:.4g} Pa, long-term {left:.4g} Pa"]
    lines += ["", f"  {begun(found.first)}"] if found.first else []
    lines.append("")
    lines += [f"  {e['key']:<40}{e['kind']:<10}RMSE {e['rmse']:<12}R2 {e['r2']}" for e in sentences.errors(found)[:40]]
    lines += ["", *(f"  ! {warning}" for warning in found.warnings)] if found.warnings else []
    lines += ["", f"page     {written['page']}", f"numbers  {written['result']}"]
    lines.append(
        f"figures  {', '.join(str(p) for p in written.values() if p.suffix == '.png')}; print/ has SVG and PDF"
    )
    lines.append(f"data     {written['curves']}, {written['table']}")
    record = found.record() | {"suspect": doubts, "files": {name: str(path) for name, path in written.items()}}
    return Reply(record, "\n".join(lines), _code(found))

"""`tissuejax diagnose`: what is missing in the model of a recording, where, and how sure."""

import argparse
import shlex
from pathlib import Path
from typing import ClassVar

import equinox as eqx

from tissuejax.commands.command import Command, Reply
from tissuejax.commands.outputs import add_out, effects_of, folder
from tissuejax.diagnosis.diagnose import diagnose
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.result import Diagnosis
from tissuejax.effects.catalogue import effect, effects
from tissuejax.errors import InputError, unknown
from tissuejax.experiments.catalogue import experiment
from tissuejax.progress import for_terminal
from tissuejax.recordings.files import read
from tissuejax.recordings.recording import Sample
from tissuejax.report import diagnosis_sentences as sentences
from tissuejax.report import judged_sentences as judged
from tissuejax.report.diagnosis_page import write_diagnosis
from tissuejax.report.headline import headline
from tissuejax.report.scales import with_unit


class DiagnoseCommand(Command):
    """Diagnose a sample and write result.json, report.html and figures."""

    name: ClassVar[str] = "diagnose"
    order: ClassVar[int] = 40
    summary: ClassVar[str] = "find the physics that the model lacks: where it misses, which effect, how sure"
    teaches: ClassVar[str] = """
Ask what a model lacks to predict the recordings of a sample.

The base model is fitted; every effect of the catalogue, of tissue, rig and sensor, is tried, alone and together. Sets
of effects are compared by their evidence beside what any law leaves of real recordings, and what a simulation's mesh
and step leave open. The verdict is one of: nothing-missing; found; found-in-part (names, and a rest that is stated);
ambiguous (one of these, and the experiment that would tell); or unexplained (something is missing that no effect of the
catalogue accounts for). All recordings, those held out too, choose the set of effects; the parameters and the errors
shown come from a fit to the others, with nothing fitted to those held out.

  tissuejax diagnose liver.h5 --energy reduced-polynomial-2 --out out/liver
  tissuejax diagnose muscle.toml --energy neo-hookean --holdout slow --holdout fast
  tissuejax diagnose liver.h5 --energy reduced-polynomial-2 --with gravity --with viscoelasticity.g1=0.3
  tissuejax diagnose rubber.toml --energy ogden-3 --ogden-form mu/alpha --effect viscoelasticity --effect softening
  tissuejax diagnose skin.toml --energy neo-hookean --rig unchecked

What is written into --out: result.json (every number), report.html (one page to read and keep), remainder.json (what is
still left, as smooth functions of drive, rate, time and place), evidence.json (every set weighed), the figures (PNG;
SVG and PDF in print/), curves.csv (the first figure in numbers, SI) and parameters.tex. Probings take minutes; what was
stopped goes on where it was when the same command is given again.
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """FILE, base model, hold-out and --out."""
        parser.add_argument("file", metavar="FILE", help="recording file or side file; FILE#NAME for one of many")
        parser.add_argument("--energy", "-e", required=True, metavar="NAME", help="base model: a strain energy by name")
        parser.add_argument("--ogden-form", metavar="FORM", help="for ogden-N: which form the constants mean")
        parser.add_argument(
            "--holdout", action="append", metavar="NAME", help="recording to predict (repeat); default: the last one"
        )
        parser.add_argument(
            "--only", action="append", default=[], metavar="NAME", help="diagnose this recording (repeat for more)"
        )
        parser.add_argument(
            "--with",
            dest="known",
            action="append",
            default=[],
            metavar="EFFECT",
            help="known physics: gravity, viscoelasticity.g1=0.3; what is not given is fitted (repeat); of a cut also "
            "the tissue's constants, energy.mu=3kPa",
        )
        parser.add_argument(
            "--unread",
            action="append",
            default=[],
            metavar="NAME",
            help="of material tests: a recording that nothing reads until all is done, and that is predicted then "
            "(repeat); held-out recordings choose the effects too",
        )
        parser.add_argument("--effect", action="append", metavar="NAME", help="try only these effects (repeat)")
        parser.add_argument(
            "--rig",
            choices=("usual", *Criteria().rigs),
            default="usual",
            help="of material tests, what is known of the test machine: verified (compliance, clocks and zeros were "
            "measured: a fault is held for 100 times less likely than what a law lacks), usual (10 times), unchecked "
            "(as likely)",
        )
        add_out(parser, "out/SAMPLE-diagnosis-ENERGY")

    def run(self, given: argparse.Namespace) -> Reply:
        """Read, diagnose, write."""
        sample = _only(read(given.file), given.only, [*(given.holdout or []), *given.unread])
        if given.rig != "usual" and (kinds := _kinds(sample) - {"homogeneous"}):
            raise InputError(
                f"--rig {given.rig}: in a recording of {' and '.join(sorted(kinds))} a fault of the rig is as likely "
                "as anything else beforehand; leave it out"
            )
        out = folder(given.out, "diagnosis", sample.name, [given.energy], given.force)
        found = diagnose(
            sample,
            given.energy,
            holdout=given.holdout,
            progress=for_terminal(),
            effects=given.effect,
            ogden_form=given.ogden_form,
            keep=out / "runs",
            known=given.known,
            unread=given.unread,
            criteria=Criteria.of_rig(given.rig),
        )
        again = _fit_with(found, sample, given)
        reply = diagnosed(found, write_diagnosis(found, out, again=again))
        return reply if not again else Reply(reply.record | {"fit": again}, f"{reply.text}\nfit      {again}")


def _only(sample: Sample, only: list[str], holdout: list[str] | None) -> Sample:
    """The sample with the recordings named and those held out; all of them where none is named."""
    for name in only:
        if name not in sample.recordings:
            raise unknown("recording", name, sample.recordings)
    if not only:
        return sample
    kept = {n: r for n, r in sample.recordings.items() if n in only or n in (holdout or ())}
    return eqx.tree_at(lambda s: s.recordings, sample, kept, is_leaf=lambda x: isinstance(x, dict))


def _kinds(sample: Sample) -> set[str]:
    return {experiment(r.experiment).kind for r in sample.recordings.values()}


def _fit_with(found: Diagnosis, sample: Sample, given: argparse.Namespace) -> str:
    """The command that fits with what was named; "" where nothing was, or where `fit` can't be told of it."""
    options: list[str] = []
    for one in found.as_dict()["effects"] if found.verdict.chosen else ():
        name, values = one["name"], {p.rpartition(".")[2]: v["value"] for p, v in one["parameters"].items()}
        typed = effects_of({"effects": [name], "parameters": one["parameters"]})[0]
        if name not in effects() or any(p.rpartition(".")[0] != f"effects.{name}" for p in one["parameters"]):
            return ""
        known = {d.name: d for d in effect(typed).parameters}
        if not values or not values.keys() <= known.keys():
            return ""
        options += ["--effect", typed]
        for p, v in values.items():
            if known[p].frozen and v != known[p].default:
                options += ["--fix", f"effects.{name}.{p}={v:.6g}"]
    if not options or "cutting" in _kinds(sample) or given.known:  # what is known has no option of `fit`
        return ""
    options += [x for name in given.only for x in ("--only", name)]
    held = [x for name in found.as_dict()["held_out"] for x in ("--holdout", name)]
    form = ["--ogden-form", given.ogden_form] if given.ogden_form else []
    return shlex.join(["tissuejax", "fit", str(given.file), "--energy", given.energy, *form, *options, *held])


def diagnosed(found: Diagnosis, written: dict[str, Path]) -> Reply:
    """The verdict as text and as the record of `--json`."""
    lines = [headline(found), "", f"Verdict: {found.verdict.kind}. {judged.lead(found)}", ""]
    lines += [
        f"  {r['path']:<40}{with_unit(r['value'], r['unit']):>31}  {r['note'] or r['interval']}".rstrip()
        for r in sentences.parameters(found)
    ]
    if found.verdict.chosen:
        lines += ["", f"{found.energy}, alone and with what was missing:"]
        rows = sentences.base(found)
        wide = max(24, *(len(r["path"]) + 2 for r in rows))
        lines += [
            f"  {r['path']:<{wide}}{r['before']:>16}{with_unit(r['after'], r['unit']):>31}".rstrip() for r in rows
        ]
    lines += ["", *judged.sure(found), *(f"  ! {w}" for w in found.as_dict()["warnings"]), ""]
    lines += [f"page     {written['page']}", f"numbers  {written['result']}"]
    record = found.as_dict() | {
        "headline": headline(found),
        "files": {name: str(path) for name, path in written.items()},
    }
    return Reply(record, "\n".join(lines))

"""`tissuejax cut`: what a blade's force tells of the tissue it parts."""

import argparse
from typing import ClassVar

import numpy as np

from tissuejax.cohesion.catalogue import law
from tissuejax.commands.arguments import number
from tissuejax.commands.command import Command, Reply
from tissuejax.commands.outputs import KEPT, add_out, folder, made
from tissuejax.errors import InputError, unknown
from tissuejax.estimation.ending import Ending
from tissuejax.experiments.cutting_run import CuttingSettings
from tissuejax.fitting.cut import along, fit_cut
from tissuejax.fitting.cut_resolution import resolution
from tissuejax.fitting.cut_result import FRICTION, CutFit
from tissuejax.fitting.sawtooth import SECTIONS, Sawtooth, Settings, mesh_period, sawtooth
from tissuejax.model import Model
from tissuejax.parameters import Parameter
from tissuejax.progress import for_terminal
from tissuejax.recordings.files import read
from tissuejax.recordings.recording import Sample
from tissuejax.report.cutting import write_cut
from tissuejax.units import quantity
from tissuejax.verbs import material


class Cut(Command):
    """resolve, identify, fit."""

    name: ClassVar[str] = "cut"
    order: ClassVar[int] = 45
    summary: ClassVar[str] = "toughness, strength and friction from the force on a blade"
    teaches: ClassVar[str] = """
A recording of a blade drawn through tissue goes in; toughness (J/m^2), strength (Pa) and friction come out.

  tissuejax cut resolve --strength "4 kPa" --toughness 5 --mu 1564 --bulk "20 kPa" --thickness "0.4 mm" --h "0.2 mm"
      before anything is simulated: cohesive length, separation against element and blade, the strength that the mesh
      can carry (energy kept), step, cost, and what no record of this kind will tell
  tissuejax cut fit cut.h5 --energy neo-hookean --fix "energy.mu=1564" --fix "volumetric.K=20 kPa" --out out/cut
      the whole record, from before contact, by gradients through a simulation: strength from the entry, toughness from
      the mean, friction from the return stroke or a second pass; with intervals, and "not identified" where so.
      --by balance does without the simulation (seconds, no strength), and so does a blade too thin for its elements;
      --along 18 adds toughness along the path. Stopped, a fit goes on from its last values when given again
  tissuejax cut identify cut.h5
      the source's own way, for comparison: filter, teeth, sections of the edge, strength and energy tooth by tooth

The tissue itself must be known from a probing or a material test (--fix): one pass holds toughness and wedging in one
sum. Units can be written ("4 kPa", "0.4 mm"); plain numbers are SI.
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """The three verbs and their options."""
        parser.add_argument("verb", choices=["resolve", "identify", "fit"], help="what to do")
        parser.add_argument("file", nargs="?", metavar="FILE", help="recording file (identify, fit)")
        parser.add_argument("--only", action="append", default=[], metavar="RECORDING", help="these cuts only")
        parser.add_argument("--energy", "-e", default="neo-hookean", metavar="NAME", help="strain energy (fit)")
        parser.add_argument("--ogden-form", metavar="FORM", help="for ogden-N")
        parser.add_argument("--volumetric", default="quadratic", metavar="NAME", help="volumetric energy (fit)")
        parser.add_argument(
            "--law", default="bilinear", metavar="NAME", help="cohesive law: bilinear, trapezoidal, ..."
        )
        parser.add_argument("--effect", action="append", default=[], metavar="NAME", help="switch an effect on (fit)")
        parser.add_argument("--fix", action="append", default=[], metavar="PATH=VALUE", help="what is known (fit)")
        parser.add_argument("--start", action="append", default=[], metavar="PATH=VALUE", help="where to begin (fit)")
        parser.add_argument(
            "--by",
            default="either",
            choices=["simulation", "balance", "either"],
            help="how to predict (fit); either: a simulation unless its elements resolve no strength that this blade "
            "would part",
        )
        parser.add_argument(
            "--along", type=int, default=0, metavar="N", help="toughness along the path, N values (fit)"
        )
        parser.add_argument(
            "--h", metavar="LENGTH", help="size of the elements along the path (fit, resolve, identify)"
        )
        parser.add_argument("--cutoff", type=float, metavar="HZ", help="of the filter (identify; a 20th of the rate)")
        parser.add_argument("--filter-order", type=int, default=4, metavar="N", help="of the filter (identify)")
        parser.add_argument(
            "--prominence", type=float, default=0.05, help="least peak of a tooth, share of the largest"
        )
        for name, unit, default, meaning in _RESOLVED:
            parser.add_argument(f"--{name}", metavar="VALUE", default=default, help=f"{meaning}, {unit} (resolve)")
        add_out(parser, "out/SAMPLE-cut-fit-ENERGY, out/SAMPLE-cut-identify")

    def run(self, given: argparse.Namespace) -> Reply:
        """Do one of the three."""
        if given.verb == "resolve":
            return _resolve(given)
        if not given.file:
            raise InputError(f"tissuejax cut {given.verb} needs a recording file: tissuejax cut {given.verb} cut.h5")
        sample = read(given.file)
        cuts = [n for n, r in sample.recordings.items() if r.experiment == "cutting"]
        if not cuts:
            kinds = ", ".join(sorted({r.experiment for r in sample.recordings.values()}))
            raise InputError(f"{given.file} holds no cutting recording, but {kinds}")
        for name in given.only:
            if name not in cuts:
                raise unknown("cutting recording", name, cuts)
        names = tuple(n for n in cuts if n in given.only or not given.only)
        if given.verb == "identify":
            out = folder(given.out, "cut-identify", sample.name, force=given.force)
            settings = Settings(given.cutoff, given.filter_order, given.prominence)
            found, without = _all_teeth(sample, names, settings)
            period = {n: mesh_period(s, _length(given.h)) for n, s in found.items()} if given.h else {}
            record = {n: _teeth(s) | {"warning": period.get(n)} for n, s in found.items()}
            written = write_cut(out, {"made": made("cut-identify", sample.name, ())} | record, found, sample, None)
            text = [line for n, s in found.items() for line in _told_teeth(n, s, period.get(n))] + without
            return Reply(
                {"identified": record, "without_teeth": without, "files": written},
                "\n".join([*text, f"page     {written['page']}"]),
            )
        tissue = material(given.energy, ogden_form=given.ogden_form, volumetric=given.volumetric, effects=given.effect)
        model = Model(tissue.energy, tissue.volumetric, tissue.effects, cohesion=law(given.law))
        called = [given.energy, *([given.by] if given.by != "either" else []), *given.effect]
        out = folder(given.out, "cut-fit", sample.name, called, given.force)
        if not any(e.name == "blade-friction" for e in model.effects):
            model = model.with_effects(
                *material(given.energy, ogden_form=given.ogden_form, effects=["blade-friction"]).effects
            )
        known, start = (_values(x, model.across(names).parameters) for x in (given.fix, given.start))
        settings = CuttingSettings(h=_length(given.h)) if given.h else CuttingSettings()
        found = fit_cut(
            sample, model, known, start, names, given.by, settings, checkpoint=out / KEPT, progress=for_terminal()
        )
        field = along(found, given.along) if given.along else None
        record = {"made": made("cut-fit", sample.name, called)} | found.record()
        record |= {} if field is None else {"along": field.tolist()}
        written = write_cut(out, record, {}, sample, found, field)
        text = [*_told_fit(found), f"page     {written['page']}", f"numbers  {written['result']}"]
        return Reply(record | {"files": written}, "\n".join(text), 0 if found.status == Ending.CONVERGED else 3)


_RESOLVED = (
    ("strength", "Pa", None, "strength of the tissue"),
    ("toughness", "J/m^2", None, "its toughness"),
    ("mu", "Pa", None, "its shear modulus"),
    ("bulk", "Pa", None, "its bulk modulus"),
    ("thickness", "m", None, "thickness of the blade"),
    ("length", "m", "0.03", "length of the cut"),
    ("half", "m", "0.01", "half the width of the tissue across the cut"),
    ("density", "kg/m^3", "1000", "density of the tissue"),
)


def _resolve(given) -> Reply:
    values = {}
    for name, unit, *_ in (*_RESOLVED, ("h", "m")):
        text = getattr(given, name)
        if text is None:
            raise InputError(f"--{name} is needed, in {unit}: see `tissuejax cut --help` for an example")
        values[name] = number(text, Parameter(name, unit, 1.0), f"--{name}")
    found = resolution(
        values["strength"], values["toughness"], values["mu"], values["bulk"], values["thickness"], values["h"],
        values["length"], values["half"], values["density"],
    )  # fmt: skip
    lines = [
        f"cohesive length   {1e3 * found.cohesive_length:.4g} mm ({found.cohesive_length / values['h']:.3g} elements)",
        f"separation        {1e3 * found.separation:.4g} mm ({found.separation / values['thickness']:.3g} blades)",
        f"strength carried  {found.carried:.4g} Pa by elements of {1e3 * values['h']:.3g} mm",
        f"step              {1e3 * found.step:.3g} ms, {found.steps} steps at 50 mm/s",
        f"cost              {found.elements} hexes a layer, about {found.seconds:.3g} s on one core",
        *(f"  ! {s}" for s in found.sentences),
    ]
    return Reply(found.as_dict(), "\n".join(lines))


def _length(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return quantity(text, "m", "--h")


def _values(given, declared) -> dict[str, float]:
    from tissuejax.commands.arguments import values

    for text in given:
        if text.startswith("cohesion.energy") and text.rstrip().endswith("J"):
            raise InputError(
                f"{text}: an energy in J where J/m^2 is meant. Divide by the area cut: 0.125 mJ over a cut of 1 mm "
                "by 5 mm are 25 J/m^2"
            )
    return values(given, declared, "--fix or --start")


def _all_teeth(sample: Sample, names, settings: Settings) -> tuple[dict[str, Sawtooth], list[str]]:
    """Teeth of each recording, and a sentence on each that has none; raises the first if none has any."""
    found, refused = {}, []
    for name in names:
        try:
            found[name] = sawtooth(sample.recordings[name], sample.geometry, settings)
        except InputError as error:
            refused.append(error)
    if not found:
        raise refused[0]
    return found, [str(e) for e in refused]


def _teeth(found: Sawtooth) -> dict:
    teeth = [
        {
            "at_m": t.at, "critical_x_N": t.critical[0], "critical_z_N": t.critical[1], "depth_m": t.contact[0],
            "width_m": t.contact[1], "energy_J": t.energy, "energy_J_m2": t.per_area,
            "strength_Pa": {f"{1e3 * s:.1f} mm": t.strength[s] for s in SECTIONS},
        }
        for t in found.teeth
    ]  # fmt: skip
    return {"teeth": teeth, "cutoff_Hz": found.cutoff, "settings": found.settings._asdict()}


def _told_teeth(name: str, found: Sawtooth, warning: str | None) -> list[str]:
    lines = [f"{name}: {len(found.teeth)} teeth (filter {found.cutoff:.3g} Hz, order {found.settings.order})"]
    lines.append(
        "   place     F_x      F_z     energy            normal / tangential strength, kPa, by section of the edge"
    )
    lines.append("    mm        N        N    mJ     J/m^2" + "".join(f"{1e3 * s:>16.1f} mm" for s in SECTIONS))
    for t in found.teeth:
        strong = "".join(f"{1e-3 * t.strength[s][0]:>10.3f} /{1e-3 * t.strength[s][1]:>7.3f}" for s in SECTIONS)
        forces = f"{1e3 * t.at:>7.2f}{t.critical[0]:>9.4f}{t.critical[1]:>9.4f}"
        lines.append(f"{forces}{1e3 * t.energy:>8.3f}{t.per_area:>8.2f}{strong}")
    mean = np.mean([t.per_area for t in found.teeth])
    lines.append(
        "  what this measures: strength is force over blade section (F / (depth x thickness)), not that of a law; the "
        f"energy ({mean:.3g} J/m^2) is parting, wedging and friction together. The mean force holds no strength."
    )
    return [*lines, *([f"  ! {warning}"] if warning else [])]


def _told_fit(found: CutFit) -> list[str]:
    lines = [f"{found.status}, by {found.by}, {found.runs} runs; chi-square per sample {found.chi2_per_sample:.3g}"]
    declared = found.predictor.model.parameters
    for path, std in found.std.items():
        low, high = found.interval[path]
        said = (
            f"not identified: {found.unidentified[path]}" if path in found.unidentified else f"{low:.4g} to {high:.4g}"
        )
        part = f", mesh {found.numerical[path]:.2g}" if found.numerical[path] else ""
        unit = declared[path].unit
        lines.append(f"  {path:<36}{found.values[path]:>11.4g} +- {std:<9.3g}{unit:<7}{said}{part}")
    lines += [f"  {p:<36} not identified: {w}" for p, w in found.unidentified.items() if p not in found.std]
    if found.by == "simulation":
        lines.append(f"  blade work not accounted for: {100 * found.balance_error:.2g} % at worst")
    if FRICTION not in found.std:
        lines.append("  friction was fixed")
    return [*lines, *(f"  ! {said}" for said in found.warnings)]

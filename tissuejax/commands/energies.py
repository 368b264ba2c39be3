"""`tissuejax energies`: the catalogue of strain energies, and a picture of one."""

import argparse
from pathlib import Path
from typing import ClassVar

from tissuejax import verbs
from tissuejax.commands.arguments import values
from tissuejax.commands.command import Command, Reply
from tissuejax.commands.outputs import folder_named, listed
from tissuejax.commands.results import refuse_softening
from tissuejax.energies.catalogue import entries, entries_of
from tissuejax.energies.published import PUBLISHED
from tissuejax.errors import InputError
from tissuejax.parameters import checked
from tissuejax.report.energy_curves import Material
from tissuejax.report.page import write_figures


class Energies(Command):
    """List energies and published materials, or plot one."""

    name: ClassVar[str] = "energies"
    order: ClassVar[int] = 10
    summary: ClassVar[str] = "the catalogue of strain energies: formula, parameters, shear modulus, range, source"
    teaches: ClassVar[str] = """
The catalogue of strain energies. Names are typed with their order (ogden-3, reduced-polynomial-2); +fibre adds a
fibre family to any of them. Ogden constants mean nothing without their form, so ogden-N asks for --ogden-form.

  tissuejax energies                                     all of them
  tissuejax energies hgo                                 one of them
  tissuejax energies --plot gent --out out               nominal stress in three modes, and where it is stable
  tissuejax energies --plot ogden-2 --ogden-form 2mu/alpha^2 --set energy.mu1=1kPa
  tissuejax energies --plot in-vivo-3                    a material published by Lister 2012
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """NAME, or --plot and what goes with it."""
        parser.add_argument("energy", metavar="NAME", nargs="?", help="this energy alone")
        parser.add_argument("--plot", metavar="NAME", help="picture of this energy or published material")
        parser.add_argument("--ogden-form", metavar="FORM", help="what Ogden constants mean")
        parser.add_argument(
            "--set", action="append", default=[], metavar="PATH=VALUE", help="a constant other than the default"
        )
        parser.add_argument(
            "--stretch", default="0.6:1.6", metavar="LOW:HIGH", help="range of the picture (default 0.6:1.6)"
        )
        parser.add_argument(
            "--out", "-o", type=folder_named, default=Path("out"), metavar="FOLDER", help="where the picture goes"
        )

    def run(self, given: argparse.Namespace) -> Reply:
        """The list, or the picture."""
        if given.plot:
            return self._plot(given)
        found = entries_of(given.energy) if given.energy else entries()
        ready = {} if given.energy else PUBLISHED
        record = {
            "energies": {
                name: {
                    "formula": e.formula,
                    "parameters": {
                        p.name: {"unit": p.unit, "default": p.default, "meaning": p.meaning} for p in e.parameters
                    },
                    "initial_shear_modulus": e.shear_modulus,
                    "valid": e.valid,
                    "source": e.source,
                }
                for name, e in found.items()
            },
            "published": {
                name: {"energy": m.energy_name, "values": m.values, "where": m.where} for name, m in ready.items()
            },
        }
        lines = []
        for name, e in found.items():
            shown = ", ".join(f"{p.name}{'' if p.unit == '1' else f' ({p.unit})'}" for p in e.parameters)
            lines += [
                name,
                f"    psi = {e.formula}",
                f"    parameters     {shown}",
                f"    shear modulus  {e.shear_modulus}",
                f"    valid          {e.valid}",
                f"    source         {e.source}",
            ]
        lines += ["", "published materials, ready to use:"] * bool(ready)
        lines += [f"  {name:<15} {m.energy_name:<22} {m.where}" for name, m in ready.items()]
        return Reply(record, "\n".join(lines))

    def _plot(self, given: argparse.Namespace) -> Reply:
        if given.plot in PUBLISHED:
            published = PUBLISHED[given.plot]
            model, start = verbs.material(published.energy), published.values
        else:
            model = verbs.material(given.plot, ogden_form=given.ogden_form)
            start = {}
        low, _, high = given.stretch.partition(":")
        try:
            within = (float(low), float(high))
        except ValueError:
            raise InputError(f"--stretch {given.stretch}: wanted is LOW:HIGH, e.g. 0.6:1.6") from None
        given_values = checked(values(given.set, model.parameters, "--set"), model.parameters)
        wanted = {p: v for p, v in start.items() if p in model.parameters} | given_values
        refuse_softening(model, model.defaults | wanted, given_values)
        material = Material(model, model.defaults | wanted, within)
        written = write_figures(material, given.out / given.plot)
        record = {"energy": given.plot, "values": material.values, "files": {n: str(p) for n, p in written.items()}}
        return Reply(record, "\n".join(listed(written)))

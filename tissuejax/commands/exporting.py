"""`tissuejax export`: a fitted or published material as a card for another solver."""

import argparse
from pathlib import Path
from typing import ClassVar

from tissuejax.cards.catalogue import card, cards
from tissuejax.cards.material import UNITS, material, noted
from tissuejax.commands.command import Command, Reply
from tissuejax.commands.results import add_source, known
from tissuejax.errors import InputError
from tissuejax.storage import write_text
from tissuejax.units import quantity


class Export(Command):
    """Write cards."""

    name: ClassVar[str] = "export"
    order: ClassVar[int] = 36
    summary: ClassVar[str] = "a material card for ABAQUS, FEBio, LS-DYNA, ANSYS, CalculiX or SOFA"
    teaches: ClassVar[str] = """
Write a fitted or published material as a card that another solver reads. The Ogden form, the volumetric energy and the
meaning of the Prony series are converted to the solver's own and named in the comments of the card. A law that a solver
has no card for is refused with the reason.

  tissuejax export out/liver/result.json                              a card for every solver that has one
  tissuejax export out/liver/result.json --to abaqus --units mm-t-s
  tissuejax export out/liver/result.json --to abaqus --out liver.inp  the one card into this file
  tissuejax export --published in-vivo-3 --to febio
  tissuejax export --energy neo-hookean --set "energy.mu=3 kPa" --to calculix --bulk "150 kPa" --density "1060 kg/m^3"

Rig and sensor effects of the fit (slack, drift, ...) are left out with a note. An incompressible fit stays so where the
solver can; elsewhere it gets a bulk modulus of 1000 shear moduli, said in the card, or the one of --bulk.
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """A material, --to, units, density, bulk modulus and --out."""
        add_source(parser)
        parser.add_argument("--to", action="append", metavar="SOLVER", help=f"{', '.join(sorted(cards()))} (repeat)")
        parser.add_argument("--units", default="m-kg-s", metavar="SET", help=f"{', '.join(UNITS)} (default m-kg-s)")
        parser.add_argument("--density", metavar="VALUE", help='e.g. "1060 kg/m^3"')
        parser.add_argument("--bulk", metavar="VALUE", help='bulk modulus for an incompressible fit, e.g. "150 kPa"')
        parser.add_argument("--name", metavar="NAME", help="of the material in the card (default: the sample's)")
        parser.add_argument(
            "--out", "-o", type=Path, metavar="FOLDER", help="default: out/NAME-cards; one card: or a file"
        )

    def run(self, given: argparse.Namespace) -> Reply:
        """Convert, write, say what was refused."""
        of = known(given)
        if of.assumed:
            first = of.assumed[0]
            example = f"{first}={of.values[first]:g} {of.model.parameters[first].unit}".removesuffix(" 1")
            raise InputError(
                f'a card needs all constants; missing {", ".join(of.assumed)}: give them, e.g. --set "{example}"'
            )
        density = None if given.density is None else quantity(given.density, "kg/m^3", "--density")
        bulk = None if given.bulk is None else quantity(given.bulk, "Pa", "--bulk")
        name = given.name or of.name
        doubts = ("bound", "unstable", "misfit exceeds")
        warned = [w for w in of.record.get("warnings", ()) if any(d in w.lower() for d in doubts)]
        plain = material(of.model, of.values, name, density, given.units, bulk)
        subject = noted(plain, *(f"of the fit: {w}" for w in warned))
        out, written, refused = given.out or Path("out") / f"{name}-cards", {}, {}
        endings = {Path(f"a{card(solver).suffix}").suffix for solver in cards()}
        single = given.out is not None and given.out.suffix.lower() in endings and not given.out.is_dir()
        if single and len(given.to or cards()) > 1:
            raise InputError(
                f"--out {out}: is a file, and several cards are written; name a folder, or one solver in --to"
            )
        for solver in given.to or cards():
            try:
                text = card(solver).text(subject)
            except InputError as error:
                if given.to and len(given.to) == 1:
                    raise
                refused[solver] = str(error)
                continue
            written[solver] = write_text(out if single else out / f"{subject.name}-{solver}{card(solver).suffix}", text)
        if not written:
            raise InputError("no solver has a card: " + "; ".join(refused.values()))
        lines = [f"{solver:<10}{path}" for solver, path in written.items()]
        lines += [f"  ! {solver}: {why}" for solver, why in refused.items()]
        lines += [f"  ! {note}" for note in subject.notes]
        record = {
            "cards": {s: str(p) for s, p in written.items()},
            "refused": refused,
            "notes": list(subject.notes),
        }
        return Reply(record, "\n".join(lines))

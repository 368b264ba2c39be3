"""ANSYS Mechanical APDL: TB,HYPER with its options, and TB,PRONY."""

from typing import ClassVar

from tissuejax.cards.card import Card, number
from tissuejax.cards.material import POWERS, Material
from tissuejax.errors import InputError

ANSYS_MAX = 5  # terms taken here of a polynomial or Yeoh energy
ANSYS_OGDEN = 6


class Ansys(Card):
    """Neo-Hookean, polynomial, Yeoh, Ogden, Gent and Arruda-Boyce."""

    name: ClassVar[str] = "ansys"
    suffix: ClassVar[str] = ".mac"
    comment: ClassVar[tuple[str, str]] = ("!", "")
    volume: ClassVar[str] = POWERS
    ogden: ClassVar[str] = "mu/alpha"
    relaxes: ClassVar[str] = (
        "TB,PRONY,SHEAR: pairs alpha_i, tau_i, shares of the instantaneous modulus, which TB,HYPER holds"
    )
    source: ClassVar[str] = "Ansys Mechanical APDL Material Reference, Hyperelasticity and Viscoelasticity"

    def volume_of(self, subject: Material) -> str:
        """See `Card.volume_of`: chains have one of their own."""
        return "((J^2-1)/2 - ln J) / d" if subject.energy.name in ("gent", "arruda-boyce") else self.volume

    def lines(self, subject: Material) -> list[str]:
        """TB and TBDATA commands of material 1."""
        body = [] if subject.density is None else [f"MP,DENS,1,{number(subject.density)}"]
        kind, c, terms, pairs = subject.energy.name, subject.constants, subject.polynomial(), subject.ogden(self.ogden)
        order = getattr(subject.energy, "order", 1)
        limit = ANSYS_OGDEN if kind == "ogden" else ANSYS_MAX
        if order > limit:
            raise InputError(f"this card takes {kind} up to order {limit}, this one has {order}; fit fewer terms")
        if kind == "neo-hookean":
            body += _table("TB,HYPER,1,1,2,NEO", [c["mu"], *subject.compressibilities(1)])
        elif terms is not None:
            D = subject.compressibilities(order)
            option = {"mooney-rivlin": "2,MOONEY", "polynomial": f"{order},POLY"}.get(kind, f"{order},YEOH")
            body += _table(f"TB,HYPER,1,1,{option}", [*terms.values(), *D, *[0.0] * (order - len(D))])
        elif pairs is not None:
            D = subject.compressibilities(order)
            flat = [x for pair in pairs for x in pair]
            body += _table(f"TB,HYPER,1,1,{order},OGDEN", [*flat, *D, *[0.0] * (order - len(D))])
        elif kind in ("gent", "arruda-boyce"):
            option, second = ("GENT", c["Jm"]) if kind == "gent" else ("BOYCE", c["lambda_m"])
            body += _table(f"TB,HYPER,1,1,,{option}", [c["mu"], second, *subject.compressibilities(1)])
        else:
            raise self.none(subject)
        if subject.prony:
            flat = [x for pair in subject.prony for x in pair]
            body += _table(f"TB,PRONY,1,1,{len(subject.prony)},SHEAR", flat)
        return body


def _table(opening: str, values: list[float]) -> list[str]:
    """The TB command and its constants, six to a TBDATA line."""
    lines = [opening]
    for i in range(0, len(values), 6):
        lines.append(f"TBDATA,{i + 1}," + ",".join(number(v) for v in values[i : i + 6]))
    return lines

"""SOFA: TetrahedronHyperelasticityFEMForceField as a line of XML.

Its "NeoHookean" is not split into shape and volume (Bonet and Wood: mu/2 (tr C - 3) - mu ln J + lambda/2 ln(J)^2), so a
neo-Hookean fit is written as MooneyRivlin with a second constant of zero, which is.
"""

from typing import ClassVar

from tissuejax.cards.card import Card, number
from tissuejax.cards.material import LOGARITHM, Material
from tissuejax.errors import InputError


class Sofa(Card):
    """Mooney-Rivlin, one Ogden term, Veronda-Westmann."""

    name: ClassVar[str] = "sofa"
    suffix: ClassVar[str] = ".sofa.xml"
    comment: ClassVar[tuple[str, str]] = ("<!--", " -->")
    volume: ClassVar[str] = LOGARITHM
    ogden: ClassVar[str] = "c/m^2"
    source: ClassVar[str] = "SOFA's material headers, v23 and later"

    def lines(self, subject: Material) -> list[str]:
        """One force field."""
        kind, c, terms, pairs = subject.energy.name, subject.constants, subject.polynomial(), subject.ogden(self.ogden)
        K, why = subject.penalty()
        if terms is not None and set(terms) <= {(1, 0), (0, 1)}:
            name, constants = "MooneyRivlin", [terms[1, 0], terms.get((0, 1), 0.0), K]
        elif pairs is not None and len(pairs) == 1:
            name, constants = "Ogden", [*pairs[0], K]
        elif pairs is not None:
            raise InputError(f"sofa takes one Ogden term, this material has {len(pairs)}; fit ogden-1")
        elif kind == "veronda-westmann":
            name, constants = "VerondaWestman", [c["C1"], c["C2"], K]
        else:
            raise self.none(subject)
        return [
            f"<!-- {why} -->",
            f'<TetrahedronHyperelasticityFEMForceField name="{subject.name}" materialName="{name}" '
            f'ParameterSet="{" ".join(map(number, constants))}"/>',
        ]

"""CalculiX: *HYPERELASTIC as in ABAQUS, with fewer terms, no relaxation, and never fully incompressible."""

from dataclasses import replace
from typing import ClassVar

from tissuejax.cards.abaqus import hyperelastic, volume_of
from tissuejax.cards.card import Card, number
from tissuejax.cards.material import POWERS, Material
from tissuejax.energies.catalogue import volumetric

CALCULIX_OGDEN, CALCULIX_MAX = 4, 3
UNUSED = 1e20  # a D_i of 0 is not left out there but replaced by a default: stress 0.8 % off in one element


class Calculix(Card):
    """Polynomial and reduced polynomial to order 3, Ogden to order 4, Arruda-Boyce."""

    name: ClassVar[str] = "calculix"
    suffix: ClassVar[str] = ".inp"
    comment: ClassVar[tuple[str, str]] = ("**", "")
    volume: ClassVar[str] = POWERS
    ogden: ClassVar[str] = "2mu/alpha^2"
    source: ClassVar[str] = "CalculiX CrunchiX User's Manual 2.20, *HYPERELASTIC"

    def volume_of(self, subject: Material) -> str:
        """See `Card.volume_of`."""
        return volume_of(subject)

    def lines(self, subject: Material) -> list[str]:
        """*MATERIAL with what belongs below it; an incompressible fit gets a penalty, as D = 0 is a default there."""
        head = []
        if subject.volumetric is None:
            K, why = subject.penalty()
            head = [f"** {why}"]
            subject = replace(subject, volumetric=volumetric("quadratic"), bulk={"K": K})
        body = [*head, f"*MATERIAL, NAME={subject.name}"]
        if subject.density is not None:
            body += ["*DENSITY", number(subject.density)]
        return body + hyperelastic(self, subject, CALCULIX_OGDEN, CALCULIX_MAX, unused=UNUSED)

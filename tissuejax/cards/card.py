"""What a card is: one solver's way of writing a material, with its conventions named."""

import abc
from typing import ClassVar

from tissuejax.cards.material import Material, described, noted
from tissuejax.energies.catalogue import name_of
from tissuejax.errors import InputError


class Card(abc.ABC):
    """One solver, one file.

    Class data:
        name: as typed after --to.
        suffix: of the file.
        comment: what begins a comment line, and what ends it.
        volume: its volumetric energy as a formula.
        ogden: the form of its Ogden constants.
        relaxes: what its Prony series means; empty where it has none that is the law fitted.
        source: the manual the conventions are taken from.
    """

    name: ClassVar[str]
    suffix: ClassVar[str]
    comment: ClassVar[tuple[str, str]]
    volume: ClassVar[str]
    ogden: ClassVar[str]
    relaxes: ClassVar[str] = ""
    source: ClassVar[str]

    @abc.abstractmethod
    def lines(self, subject: Material) -> list[str]:
        """The card without its head.

        Raises:
            InputError: a law this solver has no card for.
        """

    def volume_of(self, subject: Material) -> str:
        """The volumetric energy that the solver has beside this law."""
        return self.volume

    def text(self, subject: Material) -> str:
        """The whole card.

        Raises:
            InputError: a law this solver has no card for, or relaxation where it has none of this kind.
        """
        if subject.prony and not self.relaxes:
            raise InputError(
                f"{self.name} has no card for relaxation of the stress of {name_of(subject.energy)} at finite strain; "
                "export to one that has (abaqus, febio, ansys), or a fit without viscoelasticity"
            )
        body, volume = self.lines(subject), self.volume_of(subject)
        head = described(noted(subject, subject.volume_note(volume)))
        head.append(f"{self.name} card; conventions from {self.source}; volumetric energy U = {volume}")
        if subject.energy.name == "ogden":
            head.append(f"Ogden constants converted to form {self.ogden}")
        if subject.prony:
            head.append(self.relaxes)
        start, end = self.comment
        return "\n".join([*(f"{start} {line}{end}" for line in head), *body]) + "\n"

    def none(self, subject: Material) -> InputError:
        """The error for an energy without a card."""
        return InputError(
            f"{self.name} has no card for {name_of(subject.energy)} (psi = {subject.energy.formula}); fit an energy it "
            "has (neo-hookean, mooney-rivlin, ogden-N and reduced-polynomial-N are known to most), or write a user "
            "subroutine"
        )


def number(value: float) -> str:
    """Twelve digits: what is read back gives the same stress to rounding of the solver."""
    return f"{float(value):.12g}"


def row(values) -> str:
    """Numbers with commas."""
    return ", ".join(map(number, values))


def rows(values, most: int = 8) -> list[str]:
    """Lines of at most `most` numbers."""
    values = list(values)
    return [row(values[i : i + most]) for i in range(0, len(values), most)]

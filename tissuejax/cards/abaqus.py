"""ABAQUS: *HYPERELASTIC, *ANISOTROPIC HYPERELASTIC and *VISCOELASTIC, TIME=PRONY."""

import math
from typing import ClassVar

from tissuejax.cards.card import Card, number, row, rows
from tissuejax.cards.material import POWERS, Material
from tissuejax.energies.fibre import WithFibre
from tissuejax.errors import InputError

ABAQUS_MAX = 6  # terms of an Ogden or polynomial energy
LOGARITHMIC = "((J^2-1)/2 - ln J) / D"


class Abaqus(Card):
    """Polynomial, reduced polynomial, Ogden, Arruda-Boyce, and neo-Hookean with Holzapfel-Gasser-Ogden fibres."""

    name: ClassVar[str] = "abaqus"
    suffix: ClassVar[str] = ".inp"
    comment: ClassVar[tuple[str, str]] = ("**", "")
    volume: ClassVar[str] = POWERS
    ogden: ClassVar[str] = "2mu/alpha^2"
    relaxes: ClassVar[str] = (
        "MODULI=INSTANTANEOUS: constants are those before relaxation; Prony rows are g_i, k_i, tau_i, shares of them"
    )
    source: ClassVar[str] = "Abaqus Analysis User's Guide, Hyperelastic behavior of rubberlike materials"

    def volume_of(self, subject: Material) -> str:
        """See `Card.volume_of`."""
        return volume_of(subject)

    def lines(self, subject: Material) -> list[str]:
        """*MATERIAL with what belongs below it."""
        body = [f"*MATERIAL, NAME={subject.name}"]
        if subject.density is not None:
            body += ["*DENSITY", number(subject.density)]
        if subject.volumetric is None:
            body.insert(0, "** D = 0, incompressible: hybrid elements (C3D8H, ...); Abaqus/Explicit wants a D")
        return body + hyperelastic(self, subject, ABAQUS_MAX, ABAQUS_MAX, moduli=bool(subject.prony)) + _prony(subject)


def volume_of(subject: Material) -> str:
    """That of ABAQUS, which CalculiX shares: chains and fibres have one of their own."""
    own = subject.energy.name == "arruda-boyce" or subject.energy.families
    return LOGARITHMIC if own else POWERS


def hyperelastic(
    card: Card, subject: Material, most_ogden: int, most: int, moduli: bool = False, unused: float = 0.0
) -> list[str]:
    """The *HYPERELASTIC block, which CalculiX shares (with fewer terms).

    Args:
        unused: what stands for a compressibility D_i that the energy does not have.

    Raises:
        InputError: no card for this energy, or more terms than it takes.
    """
    tail = ", MODULI=INSTANTANEOUS" if moduli else ""
    kind, terms, pairs = subject.energy.name, subject.polynomial(), subject.ogden(card.ogden)
    order = getattr(subject.energy, "order", 1)
    limit = most_ogden if kind == "ogden" else most
    if order > limit:
        raise InputError(f"{card.name} takes {kind} up to order {limit}, this one has {order}; fit fewer terms")
    words = {"neo-hookean": "NEO HOOKE", "mooney-rivlin": "MOONEY-RIVLIN", "polynomial": f"POLYNOMIAL, N={order}"}
    if terms is not None:
        word = words.get(kind, f"REDUCED POLYNOMIAL, N={order}")
        D = subject.compressibilities(order)
        D += [unused] * (order - len(D))
        return [f"*HYPERELASTIC, {word}{tail}", *rows([*terms.values(), *D])]
    if pairs is not None:
        D = subject.compressibilities(order)
        D += [unused] * (order - len(D))
        return [f"*HYPERELASTIC, OGDEN, N={order}{tail}", *rows([*(x for pair in pairs for x in pair), *D])]
    if kind == "arruda-boyce":
        D = subject.compressibilities(1)
        constants = [subject.constants["mu"], subject.constants["lambda_m"], *D]
        return [
            f"*HYPERELASTIC, ARRUDA-BOYCE{tail}",
            row(constants),
        ]
    if subject.energy.families and not moduli and card.name == "abaqus" and neo_hookean(subject):
        return _fibres(subject)
    raise card.none(subject)


def neo_hookean(subject: Material) -> bool:
    """Whether the matrix around the fibres is neo-Hookean."""
    return not isinstance(subject.energy, WithFibre) or subject.energy.matrix.name == "neo-hookean"


def _fibres(subject: Material) -> list[str]:
    """*ANISOTROPIC HYPERELASTIC, HOLZAPFEL: C10, D, k1, k2, kappa; families share k1, k2 and kappa."""
    k1, k2, kappa = (float(subject.constants.get(n, 0.0)) for n in ("k1", "k2", "kappa"))
    angles = [float(a) for a in subject.energy.angles(subject.constants)]
    D = subject.compressibilities(1)
    directions = [f"{number(math.cos(a))}, {number(math.sin(a))}, 0." for a in angles]
    return [
        f"** local directions of the families, for *ORIENTATION, LOCAL DIRECTIONS={len(angles)}:",
        *(f"**   {d}" for d in directions),
        f"*ANISOTROPIC HYPERELASTIC, HOLZAPFEL, LOCAL DIRECTIONS={len(angles)}",
        row([0.5 * subject.constants["mu"], *D, k1, k2, kappa]),
    ]


def _prony(subject: Material) -> list[str]:
    if not subject.prony:
        return []
    return ["*VISCOELASTIC, TIME=PRONY", *(row([g, 0.0, tau]) for g, tau in subject.prony)]

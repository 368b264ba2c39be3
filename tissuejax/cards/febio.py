"""FEBio (format 4.0): uncoupled materials, and `uncoupled viscoelastic` around them."""

import math
from typing import ClassVar

from tissuejax.cards.card import Card, number
from tissuejax.cards.material import LOGARITHM, Material
from tissuejax.errors import InputError

FEBIO_MAX = 6  # terms


class Febio(Card):
    """Mooney-Rivlin, Yeoh, Ogden, Veronda-Westmann, Arruda-Boyce, Gent, two families of Holzapfel-Gasser-Ogden."""

    name: ClassVar[str] = "febio"
    suffix: ClassVar[str] = ".feb.xml"
    comment: ClassVar[tuple[str, str]] = ("<!--", " -->")
    volume: ClassVar[str] = LOGARITHM
    ogden: ClassVar[str] = "c/m^2"
    relaxes: ClassVar[str] = (
        "uncoupled viscoelastic with g0 = 1 - sum g_i: the elastic constants are those before relaxation, G(0) = 1"
    )
    source: ClassVar[str] = "FEBio User Manual 4, Uncoupled Materials, and its source"

    def lines(self, subject: Material) -> list[str]:
        """One <material>."""
        if len(subject.prony) > FEBIO_MAX:
            raise InputError(
                f"febio takes {FEBIO_MAX} relaxation times, this material has {len(subject.prony)}; fit fewer"
            )
        kind, constants = self._elastic(subject)
        K, why = subject.penalty()
        inner = [f"<{tag}>{number(value)}</{tag}>" for tag, value in [*constants, ("k", K)]]
        density = [] if subject.density is None else [f"<density>{number(subject.density)}</density>"]
        head = [f"<!-- {why} -->"]
        if not subject.prony:
            body = [*density, *inner]
            return [*head, f'<material id="1" name="{subject.name}" type="{kind}">', *_indent(body), "</material>"]
        series = [("g0", 1 - sum(g for g, _ in subject.prony))]
        for i, (g, tau) in enumerate(subject.prony, start=1):
            series += [(f"g{i}", g), (f"t{i}", tau)]
        return [
            *head,
            f'<material id="1" name="{subject.name}" type="uncoupled viscoelastic">',
            *_indent([*density, *(f"<{tag}>{number(value)}</{tag}>" for tag, value in series)]),
            f'  <elastic type="{kind}">',
            *_indent(inner, "    "),
            "  </elastic>",
            "</material>",
        ]

    def _elastic(self, subject: Material) -> tuple[str, list[tuple[str, float]]]:
        kind, c, terms, pairs = subject.energy.name, subject.constants, subject.polynomial(), subject.ogden(self.ogden)
        order = getattr(subject.energy, "order", 1)
        if order > FEBIO_MAX:
            raise InputError(f"febio takes {kind} up to order {FEBIO_MAX}, this one has {order}; fit fewer terms")
        if terms is not None and kind == "reduced-polynomial":
            return "Yeoh", [(f"c{i}", terms[i, 0]) for i in range(1, order + 1)]
        if terms is not None and set(terms) <= {(1, 0), (0, 1)}:
            return "Mooney-Rivlin", [("c1", terms[1, 0]), ("c2", terms.get((0, 1), 0.0))]
        if pairs is not None:
            return "Ogden", [
                entry for i, (mu, alpha) in enumerate(pairs, 1) for entry in ((f"c{i}", mu), (f"m{i}", alpha))
            ]
        if kind == "veronda-westmann":
            return "Veronda-Westmann", [("c1", c["C1"]), ("c2", c["C2"])]
        if kind == "arruda-boyce":
            return "Arruda-Boyce", [("mu", c["mu"]), ("N", c["lambda_m"] ** 2)]
        if kind == "gent":
            return "Gent", [("G", c["mu"]), ("Jm", c["Jm"])]
        if subject.energy.families == 2:
            first, second = (float(a) for a in subject.energy.angles(c))
            if not math.isclose(first, -second, abs_tol=1e-9):
                raise InputError(
                    "febio's Holzapfel-Gasser-Ogden has two families at +gamma and -gamma about the first axis; turn "
                    "the material axes so that yours are"
                )
            return "Holzapfel-Gasser-Ogden", [
                ("c", c["mu"]),
                ("k1", c["k1"]),
                ("k2", c["k2"]),
                ("gamma", math.degrees(abs(first))),
                ("kappa", c.get("kappa", 0.0)),
            ]
        raise self.none(subject)


def _indent(body: list[str], by: str = "  ") -> list[str]:
    return [by + line for line in body]

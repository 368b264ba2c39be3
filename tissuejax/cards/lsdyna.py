"""LS-DYNA: *MAT_HYPERELASTIC_RUBBER (077_H) and *MAT_OGDEN_RUBBER (077_O).

Their Prony terms add an overstress that is linear in the rate of strain, in units of stress: another law than shares of
the stress that relax, so a fit with relaxation is refused.
"""

from typing import ClassVar

from tissuejax.cards.card import Card, number
from tissuejax.cards.material import Material
from tissuejax.errors import InputError

SLOTS = ((1, 0), (0, 1), (1, 1), (2, 0), (0, 2), (3, 0))
LSDYNA_MAX = 8


class Lsdyna(Card):
    """Polynomials with terms C10, C01, C11, C20, C02, C30, and Ogden."""

    name: ClassVar[str] = "ls-dyna"
    suffix: ClassVar[str] = ".k"
    comment: ClassVar[tuple[str, str]] = ("$", "")
    volume: ClassVar[str] = "LS-DYNA's own, bulk modulus from Poisson's ratio"
    ogden: ClassVar[str] = "mu/alpha"
    source: ClassVar[str] = "LS-DYNA Keyword Manual, Volume II, MAT_077"

    def lines(self, subject: Material) -> list[str]:
        """One *MAT keyword in free (comma) format."""
        if subject.density is None:
            raise InputError("ls-dyna needs a density: give --density, or a sample that has one")
        K, why = subject.penalty()
        G = subject.shear_modulus
        poisson = (3 * K - 2 * G) / (2 * (3 * K + G))
        head = [f"$ {why}: Poisson's ratio {poisson:.8g}"]
        terms = subject.polynomial()
        if terms is not None:
            left = [f"C{i}{j}" for (i, j), value in terms.items() if (i, j) not in SLOTS and value]
            if left:
                raise InputError(f"ls-dyna has no place for {', '.join(left)}; fit a polynomial of fewer terms")
            return [
                *head,
                "*MAT_HYPERELASTIC_RUBBER_TITLE",
                subject.name,
                "$ mid, ro, pr, n, nv, g, sigf, ref",
                f"1, {number(subject.density)}, {number(poisson)}, 0, 0, 0.0, 0.0, 0.0",
                "$ c10, c01, c11, c20, c02, c30",
                ", ".join(number(terms.get(slot, 0.0)) for slot in SLOTS),
            ]
        pairs = subject.ogden(self.ogden)
        if pairs is not None:
            if len(pairs) > LSDYNA_MAX:
                raise InputError(f"ls-dyna takes {LSDYNA_MAX} Ogden terms, this one has {len(pairs)}; fit fewer")
            pairs += [(0.0, 0.0)] * (LSDYNA_MAX - len(pairs))
            return [
                *head,
                "*MAT_OGDEN_RUBBER_TITLE",
                subject.name,
                "$ mid, ro, pr, n, nv, g, sigf, ref",
                f"1, {number(subject.density)}, {number(poisson)}, 0, 0, 0.0, 0.0, 0.0",
                "$ mu1 ... mu8",
                ", ".join(number(mu) for mu, _ in pairs),
                "$ alpha1 ... alpha8",
                ", ".join(number(alpha) for _, alpha in pairs),
            ]
        raise self.none(subject)

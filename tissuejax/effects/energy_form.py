"""Energy form: the base strain energy lacks terms."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Form, Offer, Probed, Sizes
from tissuejax.energies.barrier import expm1
from tissuejax.energies.strain import Strain
from tissuejax.parameters import Parameter

TERMS = ("C20", "C30", "C01", "C02", "exponential", "ogden")
WIDTH = 0.15  # of the stress: ten times what any law leaves (`Criteria.shares`, `strange`)


class EnergyForm(Effect):
    """psi = C20 x^2 + C30 x^3 + C01 y + C02 y^2 + exponential/b^2 (exp(b x) - 1 - b x) + 2 ogden/a^2 (sum l^a - 3).

    x = I1bar - 3, y = I2bar - 3, b is `exponent`, a is `power`; only `terms` are there. A term that the base has too
    can't be told from it: leave it out of `terms`.

    A diagnosis of material tests tries one form more, without parameters: whatever is smooth in stretch and the same
    for all recordings of one kind is a strain energy, be it of a form that no term here has, and needs no process to
    explain it. Where no strain was passed twice, a law of each recording's own is one that fails to carry from one
    strain to another: that form too.

    Revealed by misfit that is a function of stretch alone, the same on loading and unloading and at all rates. Blind:
    small strains (all isotropic energies agree there); I1 and I2 terms differ only between kinds of test. Source:
    Rivlin and Saunders 1951, Phil. Trans. R. Soc. A 243; Demiray 1972, J. Biomech. 5; Ogden 1972 (2mu/a^2 form).
    """

    name: ClassVar[str] = "energy-form"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous", "probing"})
    group: ClassVar[str] = "law"
    remembers: ClassVar[bool] = False
    reveals: ClassVar[str] = "misfit that depends on stretch alone, not on its past or rate"
    blind: ClassVar[str] = "small strains"
    words: ClassVar[tuple[str, ...]] = (
        "the strain energy has another form",
        "C20 differs by {C20}",
        "C30 by {C30}",
        "C01 by {C01}",
        "C02 by {C02}",
        "an exponential term of {exponential} is added",
        "a power of stretch of {ogden} is added",
    )
    source: ClassVar[str] = "Rivlin and Saunders 1951; Demiray 1972; Ogden 1972"
    terms: tuple[str, ...] = ("C20", "C30", "C01", "C02", "exponential")

    @classmethod
    def in_material_tests(cls, sizes: Sizes) -> Offer:
        """See `Effect.in_material_tests`."""
        exponent = {"exponent": tuple(x / sizes.strain**2 for x in (0.3, 1.5))}
        steepest = {"exponent": 4 / sizes.strain**2}  # e^12 at the largest strain: I1bar - 3 is about 3 strain^2
        power = {"grid": {"power": (-8.0, 10.0)}, "most": {"power": 8 / sizes.strain}}
        alone = ("cubic", "second invariant", "exponential")
        forms = (
            Form("cubic", ("C30",)),
            Form("second invariant", ("C01",)),
            Form("exponential", ("exponential", "exponent"), exponent, most=steepest),
            Form("cubic and second invariant", ("C30", "C01"), nominated=False),
            Form("all", ("C30", "C01", "C02", "exponential", "exponent"), nominated=False, most=steepest),
            Form("stretch power", ("ogden", "power"), nominated=False, beside=alone, **power),
            Form("smooth in stretch", (), widens={"law": WIDTH}, lacking={"repeated": {"gain": WIDTH}}),
        )
        terms = ("C30", "C01", "C02", "exponential")
        return Offer(
            cls((*terms, "ogden")), forms, simple=cls(terms)
        )  # principal stretches cost as much as all the rest

    @classmethod
    def in_probings(cls, sizes: Probed) -> Offer:
        """See `Effect.in_probings`."""
        return Offer(cls(terms=("C30", "C01")), (Form("", ("C30", "C01")),))

    @property
    def amplitudes(self) -> tuple[str, ...]:
        """One for each term."""
        return self.terms

    @property
    def grid(self) -> dict[str, tuple[float, ...]]:
        """Exponents, for the terms that have one."""
        exponent = {"exponent": (2.0, 8.0)} if "exponential" in self.terms else {}
        return exponent | ({"power": (-9.0, -3.0, 6.0, 12.0)} if "ogden" in self.terms else {})

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        shapes = {
            "exponential": Parameter("exponent", "1", 4.0, lower=0.01, upper=100.0, meaning="of the exponential term"),
            "ogden": Parameter(
                "power", "1", -5.0, lower=-60.0, upper=60.0, meaning="of the stretches in the Ogden term"
            ),
        }
        return (
            *(Parameter(t, "Pa", 0.0, scale=100.0, meaning=f"added to the energy: {t} term") for t in self.terms),
            *(shapes[t] for t in self.terms if t in shapes),
        )

    def energy(self, p: Mapping[str, Array], strain: Strain) -> Float[Array, "..."]:
        x, y = strain.I1 - 3, strain.I2 - 3
        formulas = {
            "C20": lambda: x * x,
            "C30": lambda: x * x * x,
            "C01": lambda: y,
            "C02": lambda: y * y,
            "exponential": lambda: (expm1(p["exponent"] * x) - p["exponent"] * x) / p["exponent"] ** 2,
            "ogden": lambda: 2 * (strain.power_sums((p["power"],))[0] - 3) / p["power"] ** 2,
        }
        return sum((p[t] * formulas[t]() for t in self.terms), jnp.zeros_like(x))

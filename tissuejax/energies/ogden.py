"""Ogden in principal stretches, any order, in a named form: its constants mean nothing without one.

Four ways of writing the factor of sum_i lbar_i^alpha - 3 are in use; the same digits give moduli up to tenfold apart.
The source prints two and means a third (docs/conventions.md), so there is no default here.
"""

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.energy import Energy
from tissuejax.energies.strain import Strain
from tissuejax.errors import InputError, unknown
from tissuejax.parameters import Constants, Parameter
from tissuejax.tensors import total


class Form(NamedTuple):
    """One convention for Ogden constants: psi = sum_i factor(alpha_i) mu_i (sum lbar^alpha_i - 3)."""

    factor: Callable[[Any], Any]  # of an exponent, a number or an array
    shear_modulus: str
    used_by: str


FORMS: dict[str, Form] = {
    "mu/alpha": Form(lambda a: 1 / a, "sum mu_i alpha_i / 2", "Ogden 1972"),
    "2mu/alpha": Form(lambda a: 2 / a, "sum mu_i alpha_i", "Lister 2012, text"),
    "2mu/alpha^2": Form(lambda a: 2 / a**2, "sum mu_i", "ABAQUS; the numbers of Lister 2012"),
    "c/m^2": Form(lambda a: 1 / a**2, "sum c_i / 2", "FEBio, c = mu and m = alpha"),
}


def form(name: str | None) -> Form:
    """The form called `name`.

    Raises:
        InputError: None (a form is required) or an unknown name.
    """
    if name is None:
        raise InputError(f"Ogden constants need their form (ogden_form, --ogden-form): one of {', '.join(FORMS)}")
    if name not in FORMS:
        raise unknown("Ogden form", name, FORMS)
    return FORMS[name]


def convert(values: Mapping[str, float], source: str | None, target: str | None) -> dict[str, float]:
    """Ogden constants `mu1, alpha1, mu2, ...` given in form `source`, in form `target`: the same energy.

    Args:
        values: mu_i in Pa and alpha_i; every mu needs its alpha.
        source, target: names in `FORMS`.

    Raises:
        InputError: an unknown form, a mu without its alpha.
    """
    old, new = form(source).factor, form(target).factor
    out = dict(values)
    for name in values:
        if name.startswith("mu"):
            if (exponent := f"alpha{name[2:]}") not in values:
                raise InputError(f"{name} can't be converted without {exponent}: give both")
            out[name] = values[name] * old(values[exponent]) / new(values[exponent])
    return out


class Ogden(Energy):
    """psi = sum_i f_i (lbar_1^alpha_i + lbar_2^alpha_i + lbar_3^alpha_i - 3), f_i by `form`: one of

    mu/alpha (Ogden 1972), 2mu/alpha (text of the source), 2mu/alpha^2 (ABAQUS), c/m^2 (FEBio). Shear modulus at rest
    sum f_i alpha_i^2 / 2; nominal stress in uniaxial tension sum f_i alpha_i (l^(alpha_i - 1) - l^(-alpha_i/2 - 1)).
    Source: Ogden 1972, Proc. R. Soc. A 326; Lister 2012, table 2.3.
    """

    name: ClassVar[str] = "ogden"
    formula: ClassVar[str] = "sum_i f_i (sum_k lbar_k^alpha_i - 3), f_i = mu/alpha, 2mu/alpha, 2mu/alpha^2 or c/m^2"
    shear_modulus: ClassVar[str] = "sum_i f_i alpha_i^2 / 2"
    source: ClassVar[str] = "Ogden 1972; Lister 2012, table 2.3"
    form: str
    order: int = 3

    def __check_init__(self):
        form(self.form)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        # Starts: 1000 Pa in all, exponents 2, -2, 4, -4, ... so that terms are told apart from the first step.
        declared = []
        for i in range(1, self.order + 1):
            alpha = float((i + 1) // 2 * 2 * (1 if i % 2 else -1))
            mu = 1000.0 / self.order * (2 / alpha**2) / FORMS[self.form].factor(alpha)
            declared += [
                Parameter(f"mu{i}", "Pa", mu, meaning=f"constant of term {i}, form {self.form}"),
                Parameter(f"alpha{i}", "1", alpha, lower=-50.0, upper=50.0, meaning=f"exponent of term {i}"),
            ]
        return tuple(declared)

    def isochoric(self, p: Constants, strain: Strain) -> Float[Either, "..."]:
        terms = self._terms(p)
        sums = strain.power_sums(tuple(alpha for _, alpha in terms))
        return total(f * (powers - 3) for (f, _), powers in zip(terms, sums))

    def initial_shear_modulus(self, p: Constants) -> Float[Either, ""]:
        return total(0.5 * f * alpha**2 for f, alpha in self._terms(p))

    def _terms(self, p: Constants) -> list[tuple[Either, Either]]:
        """(f_i, alpha_i); an exponent at 0, where f_i has a pole that the sum cancels, is moved to 1e-6."""
        terms = []
        for i in range(1, self.order + 1):
            alpha = jnp.asarray(p[f"alpha{i}"])
            alpha = jnp.where(jnp.abs(alpha) < 1e-6, 1e-6, alpha)
            terms.append((p[f"mu{i}"] * FORMS[self.form].factor(alpha), alpha))
        return terms

"""The source's materials against stresses and moduli from an independent program, in every Ogden form, to 6 digits."""

import csv
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.energies import stress
from tissuejax.energies.ogden import Ogden, convert
from tissuejax.energies.paths import along
from tissuejax.energies.published import ABAQUS, PUBLISHED

OGDEN = {"ex-vivo-ogden": "exvivo4", "in-vivo-1": "invivo1", "in-vivo-2": "invivo2"}
PRINTED = {"mu/alpha": "[mu/a]", "2mu/alpha": "[2mu/a]", "2mu/alpha^2": "[2mu/a^2]"}
OTHERS = {
    "ex-vivo-log": "exvivo log, with -3",
    "ex-vivo-exp": "exvivo exp, with -3",
    "in-vivo-3": "invivo3 redpoly N4",
}
# (energy, constants, column): the source's digits read in each form, and the other energies.
CASES = {
    f"{column} {printed}": (Ogden(form, PUBLISHED[name].energy.order), PUBLISHED[name].constants)
    for name, column in OGDEN.items()
    for form, printed in PRINTED.items()
} | {column: (PUBLISHED[name].energy, PUBLISHED[name].constants) for name, column in OTHERS.items()}


def rows(name):
    with open(Path(__file__).with_name(name)) as file:
        return list(csv.DictReader(file))


def six_digits(got, want):
    """Equal as printed with 6 significant digits, but for half a unit in the last."""
    digit = 10.0 ** np.floor(np.log10(np.maximum(np.abs(want), 1e-300)) - 5)
    return np.abs(got - want) <= 0.51 * digit + 1e-9


@pytest.mark.parametrize("column", CASES)
def test_uniaxial_nominal_stress(column):
    energy, p = CASES[column]
    table = rows("ogden_uniaxial_nominal.csv")
    l, want = (np.array([float(r[c]) for r in table]) for c in ("stretch", column))
    strain = along("uniaxial", jnp.asarray(l))
    S = jax.jit(lambda p, C: stress.pk2_isochoric(energy, p, C))(p, strain.C)
    got = np.asarray(l * (S.xx - S.zz * strain.C.zz / strain.C.xx))
    defined = np.isfinite(want)
    assert six_digits(got[defined], want[defined]).all()
    # Where the reference has none, the energy has ended, and says so.
    np.testing.assert_array_equal(np.asarray(energy.margin(p, strain)) > 0, defined)


@pytest.mark.parametrize("column", CASES)
def test_small_strain_shear_modulus(column):
    energy, p = CASES[column]
    want = {r["model"]: float(r["G_Pa"]) for r in rows("ogden_small_strain_G.csv")}[column]
    assert six_digits(float(energy.initial_shear_modulus(p)), want).all()


@pytest.mark.parametrize("name", OGDEN)
def test_conversion_gives_the_published_stresses_in_any_form(name):
    material = PUBLISHED[name]
    C = along("uniaxial", jnp.linspace(0.6, 1.6, 21)).C

    def S11(energy, p):
        return jax.jit(lambda p: stress.pk2_isochoric(energy, p, C).xx)(p)

    want = S11(material.energy, material.constants)
    for form in ("mu/alpha", "2mu/alpha", "c/m^2"):
        p = convert(material.constants, ABAQUS, form)
        got = S11(Ogden(form, material.energy.order), p)
        np.testing.assert_allclose(got, want, rtol=1e-9, atol=1e-8)

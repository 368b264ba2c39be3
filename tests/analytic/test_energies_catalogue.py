"""Names, forms, published materials and every refusal with its sentence."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tissuejax.energies import catalogue, ogden, validity
from tissuejax.energies.barrier import LARGEST_EXPONENT, LIMIT, expm1, minus_log
from tissuejax.energies.ogden import FORMS, Ogden
from tissuejax.energies.paths import along
from tissuejax.energies.published import PUBLISHED, published
from tissuejax.errors import InputError


def test_names_give_energies_and_back():
    for name in ("neo-hookean", "reduced-polynomial-4", "polynomial-3", "gent+fibre", "demiray+fibre"):
        assert catalogue.name_of(catalogue.energy(name)) == name
    assert catalogue.energy("yeoh") == catalogue.energy("reduced-polynomial-3")
    assert catalogue.energy("Neo Hooke") == catalogue.energy("neo-hookean")
    assert catalogue.energy("OGDEN-3+Fibre", "mu/alpha") == catalogue.energy("ogden-3+fibre", "mu/alpha")
    assert catalogue.name_of(catalogue.energy("ogden-3+fibre", "c/m^2")) == "ogden-3+fibre"
    assert catalogue.forms_of(catalogue.energy("ogden-3+fibre", "c/m^2")) == {
        "ogden": "c/m^2",
        "volumetric": "incompressible",
    }
    assert catalogue.name_of(catalogue.volumetric("compressibility")) == "compressibility-1"


@pytest.mark.parametrize(
    ("name", "form", "words"),
    [
        ("neo-hokean", None, "Did you mean 'neo-hookean'"),
        ("yeo", None, "'yeoh'"),
        ("ogden-3", None, "need their form"),
        ("ogden", "mu/alpha", "ogden-2"),
        ("ogden-0", "mu/alpha", "ogden-2"),
        ("ogden-2", "mu/alfa", "Did you mean 'mu/alpha'"),
        ("gent", "mu/alpha", "takes no Ogden form"),
        ("gent-2", None, "has no order"),
        ("reduced-polynomial", None, "needs its order"),
        ("gent+fibr", None, "Did you mean '\\+fibre'"),
    ],
)
def test_wrong_names_are_refused_with_advice(name, form, words):
    with pytest.raises(InputError, match=words):
        catalogue.energy(name, form)


def test_no_ogden_without_its_form():
    with pytest.raises(TypeError, match="form"):
        Ogden(order=2)
    with pytest.raises(InputError, match="unknown Ogden form"):
        Ogden(form="mu", order=2)
    with pytest.raises(InputError, match="need their form"):
        ogden.convert({"mu1": 1.0, "alpha1": 2.0}, "mu/alpha", None)
    with pytest.raises(InputError, match="without alpha1"):
        ogden.convert({"mu1": 1.0}, "mu/alpha", "c/m^2")


def test_shear_modulus_of_each_form():
    p = {"mu1": 100.0, "alpha1": 3.0, "mu2": -20.0, "alpha2": -4.0}
    want = {"mu/alpha": 190.0, "2mu/alpha": 380.0, "2mu/alpha^2": 80.0, "c/m^2": 40.0}
    for form, G in want.items():
        assert Ogden(form, 2).initial_shear_modulus(p) == pytest.approx(G)


exponents = st.floats(-12, 12).filter(lambda a: abs(a) > 0.01)


@given(st.sampled_from(sorted(FORMS)), st.sampled_from(sorted(FORMS)), st.floats(-1e4, 1e4), exponents)
def test_conversion_keeps_the_energy_and_returns(source, target, mu, alpha):
    p = {"mu1": mu, "alpha1": alpha}
    q = ogden.convert(p, source, target)
    old, new = (float(Ogden(f, 1).initial_shear_modulus(v)) for f, v in ((source, p), (target, q)))
    assert new == pytest.approx(old, rel=1e-12, abs=1e-12)
    assert ogden.convert(q, target, source) == pytest.approx(p, rel=1e-12)


def test_an_exponent_of_zero_is_finite_and_henckys_energy():
    # (2 mu / a^2)(sum l^a - 3) -> mu sum ln(l)^2 as a -> 0.
    strain = along("uniaxial", jnp.array([0.8, 1.5]))
    energy = catalogue.energy("ogden-1", "2mu/alpha^2")
    psi = lambda a: energy.isochoric({"mu1": 10.0, "alpha1": a}, strain)  # noqa: E731
    np.testing.assert_allclose(psi(0.0), 10 * 1.5 * np.log([0.8, 1.5]) ** 2, rtol=2e-3)  # round-off / 1e-12
    assert np.isfinite(jax.jacfwd(psi)(0.0)).all()


def test_published_materials_by_name():
    assert set(PUBLISHED) == {"ex-vivo-ogden", "ex-vivo-log", "ex-vivo-exp", "in-vivo-1", "in-vivo-2", "in-vivo-3"}
    for material in PUBLISHED.values():
        assert set(material.constants) == {d.name for d in material.energy.parameters}
        assert "Lister 2012" in material.where
    third = published("in-vivo-3")
    assert third.values["energy.C40"] == 122.701
    assert third.volumetric.bulk_modulus(third.volumetric_constants) == 2000.0
    x = 0.07  # sum_i (J - 1)^(2i) / D_i with four equal D (eq. 4.19) is a geometric series
    energy = third.volumetric.energy(third.volumetric_constants, 1 + x)
    assert energy == pytest.approx(1e3 * x**2 * (1 - x**8) / (1 - x**2), rel=1e-12)
    with pytest.raises(InputError, match="Did you mean 'in-vivo-"):
        published("in-vivo-4")


def test_the_catalogue_in_words():
    entries = catalogue.entries()
    assert {"ogden-N", "reduced-polynomial-N", "neo-hookean", "+fibre"} <= set(entries)
    assert [d.name for d in entries["+fibre"].parameters] == ["k1", "k2", "kappa", "angle"]
    assert entries["gent"].valid == "I1bar - 3 < Jm"


def test_strains_beyond_the_end_are_refused_at_the_door():
    log = published("ex-vivo-log")
    low, high = validity.valid_stretches(log.energy, log.constants)
    for l in (low, high):  # the end by the formula, but for the strip of the barrier
        total = l**-2.544 + 2 * l**1.272 - 3
        assert 0.632 * total == pytest.approx(1 - LIMIT, abs=1e-9)
    validity.check_valid(log.energy, log.constants, along("uniaxial", jnp.array([low * 1.001, 1.3])))
    with pytest.raises(InputError, match=r"pull-1: 1 of 2 points .*C2 \(sum_i lbar_i\^alpha - 3\) < 1"):
        validity.check_valid(log.energy, log.constants, along("uniaxial", jnp.array([0.9, 0.6])), "pull-1")
    traced = jax.jit(lambda l: validity.check_valid(log.energy, log.constants, along("uniaxial", l)) or l)
    assert traced(0.6) == 0.6
    neo = catalogue.energy("neo-hookean")
    assert validity.valid_stretches(neo, {"mu": 1.0}, "planar", (0.3, 4.0)) == (0.3, 4.0)


@pytest.mark.parametrize("bad", [0.0, -0.2, np.nan, np.inf])
def test_stretches_must_be_positive(bad):
    validity.check_stretches(np.array([0.5, 1.0]))
    with pytest.raises(InputError, match="1 of 3 are not finite numbers above 0 \\(first: number 2"):
        validity.check_stretches(np.array([1.0, 1.1, bad]))


@pytest.mark.parametrize(
    ("f", "end", "inside"),
    [(minus_log, LIMIT, lambda x: -np.log(x)), (expm1, LARGEST_EXPONENT, np.expm1)],
)
def test_barriers_continue_twice_smoothly(f, end, inside):
    step = abs(end) * 1e-9
    for _ in range(3):
        below, above = float(f(end - step)), float(f(end + step))
        assert below == pytest.approx(above, rel=1e-6)
        f = jax.grad(f)
    f = minus_log if end == LIMIT else expm1
    assert float(f(0.5)) == pytest.approx(inside(0.5))
    for x in (-1e6, 1e6):
        assert np.isfinite([f(x), jax.grad(f)(x), jax.grad(jax.grad(f))(x)]).all()

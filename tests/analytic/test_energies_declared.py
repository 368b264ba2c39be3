"""What every law declares and what the source prints: starts, bounds, constants and orders against tables and sums."""

import math

import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.energies import catalogue
from tissuejax.energies.ogden import FORMS, Ogden, convert
from tissuejax.energies.published import PUBLISHED, Published, published
from tissuejax.errors import InputError

INF = math.inf
# of each constant: where a fit starts, and the open range it may be in
DECLARED = {
    "neo-hookean": {"mu": (1000.0, 0.0, INF)},
    "mooney-rivlin": {"C10": (400.0, -INF, INF), "C01": (100.0, -INF, INF)},
    "polynomial-2": {
        "C10": (400.0, -INF, INF), "C01": (100.0, -INF, INF), "C20": (0.0, -INF, INF), "C11": (0.0, -INF, INF),
        "C02": (0.0, -INF, INF),
    },
    "reduced-polynomial-3": {"C10": (500.0, 0.0, INF), "C20": (0.0, -INF, INF), "C30": (0.0, -INF, INF)},
    "log-ogden": {"C1": (100.0, 0.0, INF), "C2": (0.5, 0.0, INF), "alpha": (-2.5, -50.0, 50.0)},
    "exp-ogden": {"C1": (100.0, 0.0, INF), "C2": (0.5, 0.0, INF), "alpha": (-2.5, -50.0, 50.0)},
    "gent": {"mu": (1000.0, 0.0, INF), "Jm": (30.0, 0.0, INF)},
    "arruda-boyce": {"mu": (1000.0, 0.0, INF), "lambda_m": (3.0, 1.0, 100.0)},
    "demiray": {"mu": (1000.0, 0.0, INF), "b": (1.0, 0.0, 1e3)},
    "veronda-westmann": {"C1": (1000.0, 0.0, INF), "C2": (1.0, 0.0, 1e3)},
    "humphrey": {"C1": (500.0, 0.0, INF), "C2": (1.0, 0.0, 1e3)},
    "hgo": {
        "mu": (1000.0, 0.0, INF), "k1": (1000.0, 0.0, INF), "k2": (1.0, 0.0, 1e3), "spread": (0.6, 0.0, 1.6),
        "angle": (0.0, -3.2, 3.2),
    },
    "goh": {
        "mu": (1000.0, 0.0, INF), "k1": (1000.0, 0.0, INF), "k2": (1.0, 0.0, 1e3), "kappa": (0.1, 0.0, 1 / 3),
        "spread": (0.6, 0.0, 1.6), "angle": (0.0, -3.2, 3.2),
    },
    "neo-hookean+fibre": {
        "mu": (1000.0, 0.0, INF), "k1": (1000.0, 0.0, INF), "k2": (1.0, 0.0, 1e3), "kappa": (0.1, 0.0, 1 / 3),
        "angle": (0.0, -3.2, 3.2),
    },
}  # fmt: skip
SCALES = {"C20": 500.0, "C11": 500.0, "C02": 500.0, "C30": 500.0, "spread": 1.0, "angle": 1.0}
FIBRES = {"hgo": 2, "goh": 2, "neo-hookean+fibre": 1}


@pytest.mark.parametrize("name", DECLARED)
def test_starts_and_bounds_of_constants(name):
    energy = catalogue.energy(name)
    found = {d.name: (d.default, d.lower, d.upper) for d in energy.parameters}
    assert list(found) == list(DECLARED[name])
    assert found == DECLARED[name]
    polynomial = "polynomial" in name
    for d in energy.parameters:
        expected = SCALES.get(d.name) if polynomial or d.name in ("spread", "angle") else None
        assert d.scale == (500.0 if polynomial and d.name in ("C10", "C01") and name == "polynomial-2" else expected)
        assert d.frozen == (d.name == "angle" and "fibre" not in name)
        assert not d.each
    assert (energy.isotropic, energy.families) == (name not in FIBRES, FIBRES.get(name, 0))
    assert len(energy.angles(dict.fromkeys(found, 0.5))) == energy.families


def test_a_fit_starts_at_a_thousand_pascal():
    """Of the laws whose constants are stiffnesses; chains of Arruda and Boyce are a little stiffer."""
    for name in DECLARED:
        energy = catalogue.energy(name)
        start = float(energy.initial_shear_modulus({d.name: d.default for d in energy.parameters}))
        if name in ("log-ogden", "exp-ogden"):
            assert start == 100 * 0.5 * 2.5**2 / 2
        elif name == "arruda-boyce":
            assert 1000 < start < 1100
        else:
            assert start == 1000.0


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("order", [1, 2, 5])
def test_terms_of_ogden_start_apart_and_share_a_thousand_pascal(form, order):
    energy = Ogden(form, order)
    declared = {d.name: d for d in energy.parameters}
    assert list(declared) == [f"{c}{i}" for i in range(1, order + 1) for c in ("mu", "alpha")]
    assert [declared[f"alpha{i}"].default for i in range(1, order + 1)] == [2.0, -2.0, 4.0, -4.0, 6.0][:order]
    start = {d.name: d.default for d in energy.parameters}
    for i in range(1, order + 1):
        alone = start | {f"mu{k}": 0.0 for k in range(1, order + 1) if k != i}
        assert float(energy.initial_shear_modulus(alone)) == pytest.approx(1000 / order, rel=1e-12)
        bounds = [(declared[f"{c}{i}"].lower, declared[f"{c}{i}"].upper) for c in ("mu", "alpha")]
        assert bounds == [(-INF, INF), (-50.0, 50.0)]
    assert Ogden("c/m^2").order == 3
    assert catalogue.energy("reduced-polynomial-3") == type(catalogue.energy("reduced-polynomial-2"))()
    assert catalogue.energy("polynomial-2") == type(catalogue.energy("polynomial-3"))()


def test_constants_of_ogden_from_one_form_to_another_by_hand():
    """4 mu / alpha of Ogden's own is 2 c / alpha^2 of another: c = 2 mu alpha."""
    given = {"mu1": 6.0, "alpha1": 4.0, "mu2": 1.0, "alpha2": -2.0, "K": 7.0}
    expected = {"alpha1": 4.0, "alpha2": -2.0, "K": 7.0}
    assert convert(given, "mu/alpha", "2mu/alpha^2") == {"mu1": 12.0, "mu2": -1.0, **expected}
    assert convert(given, "mu/alpha", "c/m^2") == {"mu1": 24.0, "mu2": -2.0, **expected}
    assert convert(given, "2mu/alpha", "mu/alpha") == {"mu1": 12.0, "mu2": 2.0, **expected}
    with pytest.raises(InputError, match=r"^mu2 can't be converted without alpha2: give both$"):
        convert({"mu2": 1.0, "alpha1": 2.0}, "mu/alpha", "c/m^2")


@pytest.mark.parametrize("form", FORMS)
def test_an_exponent_within_a_millionth_of_nothing_is_a_millionth(form):
    energy = Ogden(form, 1)
    factor = {"mu/alpha": 1e6, "2mu/alpha": 2e6, "2mu/alpha^2": 2e12, "c/m^2": 1e12}[form]
    for alpha in (0.0, 0.9e-6, -0.9e-6):
        found = float(energy.initial_shear_modulus({"mu1": 3.0, "alpha1": alpha}))
        assert found == pytest.approx(3.0 * factor * 0.5e-12, rel=1e-6)
    other = float(energy.initial_shear_modulus({"mu1": 3.0, "alpha1": -1.1e-6}))
    power = {"mu/alpha": -1, "2mu/alpha": -1, "2mu/alpha^2": 2, "c/m^2": 2}[form]
    scale = -1.1 if power == -1 else 1.0
    assert other == pytest.approx(3.0 * factor * 0.5e-12 * scale, rel=1e-6)


# Lister 2012, tables 2.1 and 2.3
PRINTED = {
    "ex-vivo-ogden": ("ogden-4", [7505.68, -2.773, 0.155, 19.668, -13856.8, -3.644, 6421.31, -4.515]),
    "ex-vivo-log": ("log-ogden", [60.0, 0.632, -2.544]),
    "ex-vivo-exp": ("exp-ogden", [10.0, 1.6, -3.068]),
    "in-vivo-1": ("ogden-2", [1818.67, 3.277, 4.752, -10.014]),
    "in-vivo-2": ("ogden-3", [-22740.362, 1.911, 12578.797, 3.181, 10686.170, 0.749]),
    "in-vivo-3": ("reduced-polynomial-4", [781.898, -747.631, 426.135, 122.701]),
}
MODULI = {  # sum of mu; C1 C2 alpha^2 / 2; 2 C10
    "ex-vivo-ogden": 70.345, "ex-vivo-log": 122.708, "ex-vivo-exp": 75.301, "in-vivo-1": 1823.422, "in-vivo-2": 524.605,
    "in-vivo-3": 1563.796,
}  # fmt: skip


@pytest.mark.parametrize("name", PRINTED)
def test_published_materials_as_printed(name):
    material, (energy, constants) = published(name), PRINTED[name]
    assert (material.name, material.energy_name) == (name, energy)
    assert list(material.constants.values()) == constants
    assert list(material.constants) == [d.name for d in material.energy.parameters]
    assert material.ogden_form == ("2mu/alpha^2" if "ogden-" in energy else None)
    assert float(material.energy.initial_shear_modulus(material.constants)) == pytest.approx(MODULI[name], abs=6e-4)
    with_volume = name == "in-vivo-3"
    assert (material.volumetric is not None) == with_volume
    assert material.volumetric_constants == ({f"D{i}": 1e-3 for i in (1, 2, 3, 4)} if with_volume else {})
    assert material.values == {f"energy.{k}": v for k, v in material.constants.items()} | (
        {f"volumetric.D{i}": 1e-3 for i in (1, 2, 3, 4)} if with_volume else {}
    )
    assert bool(material.note) == (name in ("ex-vivo-log", "ex-vivo-exp", "in-vivo-3"))
    assert "Lister 2012, table 2." in material.where


def test_ex_vivo_materials_agree_on_a_modulus_of_70_to_123_pascal():
    ex_vivo = [MODULI[n] for n in PRINTED if n.startswith("ex")]
    assert (round(min(ex_vivo)), round(max(ex_vivo))) == (70, 123)
    assert list(PUBLISHED) == list(PRINTED)
    plain = Published("x", "neo-hookean", {"mu": 1.0}, "here")
    assert (plain.volumetric, plain.values, plain.note) == (None, {"energy.mu": 1.0}, "")


@pytest.mark.parametrize(("name", "p", "energy", "modulus"), [
    ("quadratic", {"K": 3e3}, lambda J: 1.5e3 * (J - 1) ** 2, 3e3),
    ("logarithmic", {"K": 3e3}, lambda J: 1.5e3 * np.log(J) ** 2, 3e3),
    ("compressibility", {"D1": 1e-3}, lambda J: 1e3 * (J - 1) ** 2, 2e3),
    (
        "compressibility-3",
        {"D1": 1e-3, "D2": 1e-2, "D3": 1e-1},
        lambda J: 1e3 * (J - 1) ** 2 + 1e2 * (J - 1) ** 4 + 10 * (J - 1) ** 6,
        2e3,
    ),
])  # fmt: skip
def test_volumetric_energies_by_their_formulas(name, p, energy, modulus):
    found = catalogue.volumetric(name)
    J = np.array([0.5, 0.9, 1.0, 1.7, 3.0])
    np.testing.assert_allclose(found.energy(p, jnp.asarray(J)), energy(J), rtol=1e-13)
    assert float(found.bulk_modulus(p)) == modulus
    start = 20e3 if "K" in p else 1e-4
    assert [(d.name, d.default, d.lower, d.upper) for d in found.parameters] == [(k, start, 0.0, INF) for k in p]
    assert [d.meaning for d in found.parameters if d.name == "D3"] in ([], ["compressibility of (J-1)^6"])


@pytest.mark.parametrize(("name", "words"), [
    ("polynomial-9", None),
    ("polynomial-10", "order 10 has more constants than any test can tell; 1 to 9 can be had"),
    ("polynomial-0", "needs its order, 1 or more: write polynomial-2 for order 2"),
    ("polynomial-1", None),
    ("ogden-9", None),
    ("gent-1", "'gent' has no order; write 'gent'"),
    ("gent-0", "'gent' has no order; write 'gent'"),
    ("+fibre", "energy"),
])  # fmt: skip
def test_orders_from_one_to_nine(name, words):
    form = "mu/alpha" if "ogden" in name else None
    if words is None:
        energy = catalogue.energy(name, form)
        assert catalogue.name_of(energy) == name
        order = int(name[-1])
        terms = order * (order + 3) // 2 if name.startswith("polynomial") else 2 * order
        assert len(energy.parameters) == terms
    else:
        with pytest.raises(InputError, match=words):
            catalogue.energy(name, form)


def test_lines_of_the_catalogue_for_a_name():
    every = catalogue.entries()
    assert set(every) == {
        *(f"{n[:-2]}-N" if n[-2] == "-" else n for n in DECLARED if "+" not in n),
        "ogden-N", "+fibre",
    }  # fmt: skip
    for name, lines in {
        "ogden-3+fibre": ["ogden-N", "+fibre"], " Yeoh ": ["reduced-polynomial-N"], "polynomial-n": ["polynomial-N"],
        "+fibre": ["+fibre"], "gent": ["gent"], "neo hooke": ["neo-hookean"], "polynomial": ["polynomial-N"],
    }.items():  # fmt: skip
        assert list(catalogue.entries_of(name)) == lines
    assert [every["+fibre"].name, every["gent"].name] == ["+fibre", "gent"]
    assert [d.name for d in every["ogden-N"].parameters] == ["mu1", "alpha1", "mu2", "alpha2"]
    for wrong in ("gent+fibr", "gnt", "gent-x"):
        with pytest.raises(InputError):
            catalogue.entries_of(wrong)
    assert not any(n.startswith("+") for n in catalogue.energies())
    examples = catalogue.examples("c/m^2", 3)
    assert {"ogden-3", "polynomial-3", "neo-hookean+fibre", "gent"} <= set(examples)
    assert catalogue.forms_of(examples["ogden-3"])["ogden"] == "c/m^2"


def test_other_names_of_volumetric_energies_are_refused():
    for wrong in ("", "bulk", "compress", "compressibility-0", "quadratic-1", "quadratics", "logarithm"):
        with pytest.raises(InputError):
            catalogue.volumetric(wrong)
    for name in ("compressibility-1", "compressibility-9", "quadratic", "logarithmic"):
        assert catalogue.name_of(catalogue.volumetric(name)) == name
    assert catalogue.name_of(catalogue.energy("polynomial-2+fibre")) == "polynomial-2+fibre"

"""Energies at full strains against their formulas in numpy, and where they end, worked out by hand."""

import math

import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.energies import catalogue
from tissuejax.energies.barrier import expm1, minus_log
from tissuejax.energies.fibre import _positive
from tissuejax.energies.paths import SECOND, along, principal
from tissuejax.energies.strain import Strain
from tissuejax.energies.validity import check_stretches, check_valid, valid_stretches
from tissuejax.errors import InputError
from tissuejax.tensors import Sym

F = np.array([[1.2, 0.3, -0.1], [0.1, 0.9, 0.2], [0.05, -0.2, 1.1]])
C = F.T @ F
J = float(np.linalg.det(F))
BAR = C * J ** (-2 / 3)
STRETCHES = np.sqrt(np.linalg.eigvalsh(BAR))
I1 = float(np.trace(BAR))
I2 = float(0.5 * (np.trace(BAR) ** 2 - np.trace(BAR @ BAR)))
STRAIN = Strain.of(Sym(*(jnp.asarray(C[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))))


def fibre(angle: float, kappa: float, k1: float, k2: float) -> float:
    a = np.array([math.cos(angle), math.sin(angle), 0.0])
    e = kappa * (I1 - 3) + (1 - 3 * kappa) * (a @ BAR @ a - 1)
    return k1 / (2 * k2) * math.expm1(k2 * e**2) if e > 0 else 0.0


def power_sum(alpha: float) -> float:
    return float(np.sum(STRETCHES**alpha)) - 3


X, Y = I1 - 3, I2 - 3
FORMULAS = {
    "neo-hookean": ({"mu": 3.0}, 1.5 * X),
    "mooney-rivlin": ({"C10": 3.0, "C01": 5.0}, 3 * X + 5 * Y),
    "polynomial-1": ({"C10": 3.0, "C01": 5.0}, 3 * X + 5 * Y),
    "polynomial-3": (
        {"C10": 2.0, "C01": 3.0, "C20": 5.0, "C11": 7.0, "C02": 11.0}
        | {"C30": 13.0, "C21": 17.0, "C12": 19.0, "C03": 23.0},
        2 * X + 3 * Y + 5 * X**2 + 7 * X * Y + 11 * Y**2 + 13 * X**3 + 17 * X**2 * Y + 19 * X * Y**2 + 23 * Y**3,
    ),
    "reduced-polynomial-3": ({"C10": 2.0, "C20": 3.0, "C30": 5.0}, 2 * X + 3 * X**2 + 5 * X**3),
    "demiray": ({"mu": 3.0, "b": 2.0}, 0.75 * math.expm1(2 * X)),
    "humphrey": ({"C1": 3.0, "C2": 2.0}, 3 * math.expm1(2 * X)),
    "veronda-westmann": ({"C1": 3.0, "C2": 2.0}, 3 * math.expm1(2 * X) - 3 * Y),
    "gent": ({"mu": 3.0, "Jm": 2.0}, -3 * math.log(1 - X / 2)),
    "arruda-boyce": (
        {"mu": 3.0, "lambda_m": 1.25},
        3 * sum(
            c / 1.25 ** (2 * i - 2) * (I1**i - 3**i)
            for i, c in enumerate((1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750), 1)
        ),
    ),
    "exp-ogden": ({"C1": 3.0, "C2": 0.5, "alpha": -2.5}, 3 * math.expm1(0.5 * power_sum(-2.5))),
    "log-ogden": ({"C1": 3.0, "C2": 0.5, "alpha": -2.5}, -3 * math.log(1 - 0.5 * power_sum(-2.5))),
    "hgo": (
        {"mu": 3.0, "k1": 5.0, "k2": 2.0, "spread": 0.5, "angle": 0.2},
        1.5 * X + fibre(0.7, 0.0, 5.0, 2.0) + fibre(-0.3, 0.0, 5.0, 2.0),
    ),
    "goh": (
        {"mu": 3.0, "k1": 5.0, "k2": 2.0, "kappa": 0.15, "spread": 0.5, "angle": 0.2},
        1.5 * X + fibre(0.7, 0.15, 5.0, 2.0) + fibre(-0.3, 0.15, 5.0, 2.0),
    ),
    "gent+fibre": (
        {"mu": 3.0, "Jm": 2.0, "k1": 5.0, "k2": 2.0, "kappa": 0.15, "angle": 0.2},
        -3 * math.log(1 - X / 2) + fibre(0.2, 0.15, 5.0, 2.0),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FORMULAS)
def test_energies_at_a_full_strain_are_their_formulas(name):
    p, expected = FORMULAS[name]
    energy = catalogue.energy(name)
    assert float(energy.isochoric(p, STRAIN)) == pytest.approx(expected, rel=1e-12)
    ends = {
        "gent": 1 - X / 2 - 1e-3, "gent+fibre": 1 - X / 2 - 1e-3, "log-ogden": 1 - 0.5 * power_sum(-2.5) - 1e-3,
    }  # fmt: skip
    assert float(energy.margin(p, STRAIN)) == pytest.approx(ends.get(name, 1.0), rel=1e-12)


@pytest.mark.parametrize(("form", "factor"), [
    ("mu/alpha", lambda a: 1 / a), ("2mu/alpha", lambda a: 2 / a), ("2mu/alpha^2", lambda a: 2 / a**2),
    ("c/m^2", lambda a: 1 / a**2),
])  # fmt: skip
def test_ogden_at_a_full_strain_in_each_form(form, factor):
    p = {"mu1": 2.0, "alpha1": 3.0, "mu2": -1.0, "alpha2": -4.5}
    expected = 2 * factor(3.0) * power_sum(3.0) - factor(-4.5) * power_sum(-4.5)
    assert float(catalogue.energy("ogden-2", form).isochoric(p, STRAIN)) == pytest.approx(expected, rel=1e-12)


def test_beyond_their_ends_logarithm_and_exponential_are_parabolas():
    assert float(minus_log(jnp.asarray(1e-3))) == pytest.approx(-math.log(1e-3), rel=1e-14)
    assert float(minus_log(jnp.asarray(1.01e-3))) == pytest.approx(-math.log(1.01e-3), rel=1e-14)
    for m in (0.9e-3, 0.0, -2e-3):
        x = m / 1e-3 - 1
        assert float(minus_log(jnp.asarray(m))) == pytest.approx(-math.log(1e-3) - x + x**2 / 2, rel=1e-14)
    assert float(expm1(jnp.asarray(50.0))) == pytest.approx(math.exp(50), rel=1e-14)
    assert float(expm1(jnp.asarray(49.9))) == pytest.approx(math.exp(49.9), rel=1e-14)
    assert float(expm1(jnp.asarray(1e-9))) == pytest.approx(1e-9 + 0.5e-18, rel=1e-15)
    for over in (0.1, 1.0, 4.0):
        assert float(expm1(jnp.asarray(50 + over))) == pytest.approx(math.exp(50) * (1 + over + over**2 / 2), rel=1e-14)


def test_fibres_take_up_load_over_a_thousandth():
    """E (1 - (1 - E / 1e-3)^3): 7/8 of E halfway."""
    e = np.array([-1.0, -1e-9, 0.0, 0.25e-3, 0.5e-3, 0.75e-3, 1e-3, 1.5e-3, 2.0])
    share = np.array([0.0, 0.0, 0.0, 37 / 64, 7 / 8, 63 / 64, 1.0, 1.0, 1.0])
    np.testing.assert_allclose(_positive(jnp.asarray(e)), share * e, rtol=1e-12, atol=0)


@pytest.mark.parametrize(("path", "second"), [("uniaxial", 1.25**-0.5), ("planar", 1.0), ("equibiaxial", 1.25)])
def test_paths_keep_the_volume(path, second):
    assert tuple(SECOND) == ("uniaxial", "planar", "equibiaxial")
    strain = along(path, jnp.asarray(1.25))
    expected = [1.25**2, second**2, (1.25 * second) ** -2, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(strain.C, expected, rtol=1e-14)
    assert float(strain.J) == 1.0
    np.testing.assert_allclose(principal(jnp.asarray(1.25), jnp.asarray(second)).C, expected, rtol=1e-14)


GENT, END = catalogue.energy("gent"), {"mu": 3.0, "Jm": 0.5}


def ends(jm: float) -> tuple[float, float]:
    """Roots of l^2 + 2 / l = 3 + 0.999 Jm."""
    roots = np.roots([1.0, 0.0, -3 - 0.999 * jm, 2.0]).real
    return tuple(sorted(r for r in roots if r > 0))


def test_the_valid_range_ends_where_the_formula_does():
    low, high = ends(0.5)
    assert valid_stretches(GENT, END) == pytest.approx((low, high), rel=1e-12)
    assert valid_stretches(GENT, END, "uniaxial", (0.9, 10.0)) == (0.9, pytest.approx(high, rel=1e-12))
    assert valid_stretches(GENT, END, within=(0.1, 1.1)) == (pytest.approx(low, rel=1e-12), 1.1)
    other = math.sqrt(1 / low), math.sqrt(1 / high)  # equibiaxial is uniaxial of the third axis
    assert valid_stretches(GENT, END, "equibiaxial") == pytest.approx(sorted(other), rel=1e-12)
    far = GENT, {"mu": 3.0, "Jm": 1e6}
    assert valid_stretches(*far) == (0.1, 10.0)
    assert np.all(np.isnan(valid_stretches(GENT, {"mu": 3.0, "Jm": math.nan})))
    one = valid_stretches(GENT, {"mu": 3.0, "Jm": 90.0})  # of 10 the sum is 97.2
    assert one == (0.1, pytest.approx(ends(90.0)[1], rel=1e-12))


@pytest.mark.parametrize("name", ["gent", "gent+fibre"])
def test_strains_beyond_are_counted_and_said_with_constants(name):
    energy = catalogue.energy(name)
    p = END | ({"k1": 1.0, "k2": 1.0, "kappa": 0.1, "angle": 0.0} if "+" in name else {})
    low, high = ends(0.5)
    inside = jnp.array([low + 1e-9, 1.0, high - 1e-9])
    check_valid(energy, p, along("uniaxial", inside))
    with pytest.raises(InputError) as refused:
        check_valid(energy, p, along("uniaxial", jnp.array([low - 1e-9, 1.0, high + 1e-9, math.nan])))
    assert str(refused.value) == (
        "the strain asked for: 3 of 4 points lie outside the range of gent (I1bar - 3 < Jm) with mu = 3, Jm = 0.5; use "
        "smaller strains, change the constants, or choose an energy without an end"
    )
    margin = float(energy.margin(p, along("uniaxial", jnp.asarray(high))))
    assert margin == pytest.approx(0.0, abs=1e-12)


def test_stretches_that_are_none_are_counted_with_the_first():
    check_stretches(np.array([[1e-300, 2.0], [3.0, 1e300]]))
    check_stretches(np.zeros(0))
    with pytest.raises(InputError) as refused:
        check_stretches(np.array([[1.0, 2.0], [0.0, math.inf]]), "pull")
    assert str(refused.value) == (
        "pull: 2 of 4 are not finite numbers above 0 (first: number 2, 0.0); a stretch is length / original length, 1 "
        "at rest (engineering strain is stretch - 1)"
    )
    with pytest.raises(InputError, match=r"^stretch: 1 of 1"):
        check_stretches(np.array(-1.0))

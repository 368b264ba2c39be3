"""Quantities as people read them."""

import math

import numpy as np
import pytest

from tissuejax.estimation.covariance import unseen
from tissuejax.report.scales import common, display, ratio, ratios, with_std, with_unit


@pytest.mark.parametrize(
    ("unit", "size", "shown"),
    [("Pa", 0.117, (1.0, "Pa")), ("Pa", 1e-9, (1.0, "Pa")), ("Pa", 2e3, (1e3, "kPa")), ("N", 2e-3, (1e-3, "mN")),
     ("m", 3e-7, (1e-6, "um")), ("s", 1e4, (1.0, "s")), ("1", 0.01, (1.0, "1"))],
)  # fmt: skip
def test_no_thousandths_of_a_pascal(unit, size, shown):
    assert display(unit, size) == shown


def test_one_unit_a_family_and_spreads_as_a_factor():
    kilo = (1e3, "kPa")
    assert common(["Pa", "1", "Pa", "Pa"], [3900.0, 0.2, 719.0, 2000.0]) == [kilo, (1.0, "1"), kilo, kilo]
    assert common(["Pa"], [0.0]) == [(1.0, "Pa")]
    assert ratio(0.056) == "5.6 %"
    assert ratio(math.log(2.8)) == "a factor of 2.8"
    assert ratios(math.log(2.8), math.log(2.2), math.log(4.5)) == "a factor of 2.8 (2.2 to 4.5)"
    assert ratios(0.2, 0.1, math.log(2)) == "20 % (10 % to a factor of 2)"


def test_a_unit_stands_behind_its_number():
    assert with_unit(with_std(72.0, math.inf), "s") == "72 s (not identified)"
    assert with_unit(with_std(1.5, 0.1), "kPa") == "1.500 ± 0.10 kPa"
    assert with_unit(with_std(0.3, math.inf), "") == "0.3 (not identified)"


def test_no_symbol_is_capitalised():
    names, units, size = ("k1", "effects.scatter.spread", "mu"), ("Pa", "1", "Pa"), np.ones(3)
    assert unseen(np.array([1.0, 0, 0]), size, names, units, 20.0).startswith("k1 is not identified")
    assert unseen(np.array([0.7, 0, -0.7]), size, names, units, 20.0).startswith("Only k1 + mu is seen")
    assert unseen(np.array([0.6, 0.5, 0.6]), size, names, units, 20.0).startswith("One combination")

"""Quantities as people read them."""

import pytest

from tissuejax.report.scales import display


@pytest.mark.parametrize(
    ("unit", "size", "shown"),
    [("Pa", 0.117, (1.0, "Pa")), ("Pa", 1e-9, (1.0, "Pa")), ("Pa", 2e3, (1e3, "kPa")), ("N", 2e-3, (1e-3, "mN")),
     ("m", 3e-7, (1e-6, "um")), ("s", 1e4, (1.0, "s")), ("1", 0.01, (1.0, "1"))],
)  # fmt: skip
def test_no_thousandths_of_a_pascal(unit, size, shown):
    assert display(unit, size) == shown

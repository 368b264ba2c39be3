"""Units at the edge: text units become SI numbers when a file is read, and only there (pint does the work).

to_si(3.2, "kPa", "Pa")          # 3200.0
quantity("30 mm", "m")           # 0.03
"""

import functools

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError, unknown

# Offered in messages; anything pint can read is accepted.
KNOWN = (
    "s",
    "ms",
    "min",
    "m",
    "mm",
    "um",
    "N",
    "mN",
    "gf",
    "kgf",
    "Pa",
    "kPa",
    "MPa",
    "mmHg",
    "1",
    "%",
    "deg",
    "rad",
    "Hz",
    "kg/m^3",
    "mm^2",
)


@functools.cache
def _registry():
    import pint

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True)


@functools.cache
def factor(unit: str, si: str) -> float:
    """The number that turns a value in `unit` into one in `si` (an SI unit, or "1").

    Raises:
        InputError: an unknown unit, or one of another dimension than `si`.
    """
    import pint

    try:
        given = _registry().Quantity(1.0, _registry().parse_units(unit.strip().replace("µ", "u")))
    except Exception as error:  # pint's parser raises many kinds, tokenize's own among them
        raise unknown(f"unit (wanted is one that converts to {si!r})", unit, KNOWN) from error
    try:
        wanted = _registry().parse_units("" if si == "1" else si)
        return float(given.to(wanted).magnitude)
    except pint.DimensionalityError as error:
        raise InputError(
            f"unit {unit!r} is of dimension {given.dimensionality}; wanted is one that converts to {si!r}: "
            "check the unit, or that the column holds what is said"
        ) from error


def to_si(value: Float[np.ndarray, "..."] | float, unit: str, si: str) -> Float[np.ndarray, "..."] | float:
    """`value` given in `unit`, in the SI unit `si`.

    Raises:
        InputError: an unknown unit, or one of another dimension than `si`.
    """
    return value * factor(unit, si)


def quantity(text: str | float, si: str, what: str = "value") -> float:
    """A number with its unit, such as "30 mm", in `si`; a bare number is taken only where `si` is "1".

    Raises:
        InputError: no number, no unit, an unknown unit or one of another dimension.
    """
    number, unit = text, "1"
    if isinstance(text, str):
        number, _, unit = text.strip().partition(" ")
        if not unit and number.endswith("%"):
            number, unit = number[:-1], "%"
    try:
        number = float(number)
    except (TypeError, ValueError):
        raise InputError(f'{what} = {text!r}: wanted is a number and a unit, such as "12.5 {si}"') from None
    if unit.strip() in ("", "1") and si != "1":
        raise InputError(f'{what} = {text!r} has no unit: write a number and a unit, such as "{number:g} {si}"')
    return to_si(number, unit or "1", si)

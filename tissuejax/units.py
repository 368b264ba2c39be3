"""Units at the edge: text units become SI numbers when a file is read, and only there (pint does the work).

to_si(3.2, "kPa", "Pa")          # 3200.0
quantity("30 mm", "m")           # 0.03, and so is "30mm"
"""

import functools
import re

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


_SPELLED = (
    ("µ", "u"),
    ("μ", "u"),
    ("²", "^2"),
    ("³", "^3"),
    ("·", "*"),
    ("⋅", "*"),
    ("°C", "degC"),
    ("°", "deg"),
    ("sec.", "s"),
)
_QUANTITY = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(1(?:\s*/.*)?|[^\d\s,.].*)?")


def spelled(unit: str) -> str:
    """A unit as machines write it ("(mm)", "[N/mm2]", "µN·m") in the spelling that pint reads ("mm", "N/mm^2", ...)."""
    text = unit.strip()
    if text[:1] in ("(", "[") and text[-1:] in (")", "]"):
        text = text[1:-1].strip()
    for machine, plain in _SPELLED:
        text = text.replace(machine, plain)
    text = re.sub(r"(?<=[A-Za-z])\.(?=[A-Za-z])", "*", text)
    return re.sub(r"(?<=[A-Za-z])([23])\b", r"^\1", text)


@functools.cache
def factor(unit: str, si: str) -> float:
    """The number that turns a value in `unit` into one in `si` (an SI unit, or "1").

    Raises:
        InputError: an unknown unit, or one of another dimension than `si`.
    """
    import pint

    try:
        given = _registry().Quantity(1.0, _registry().parse_units(spelled(unit)))
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


def quantity(text: object, si: str, what: str = "value") -> float:
    """A number with its unit, such as "30 mm" or "30mm", in `si`; a bare number is taken only where `si` is "1".

    Args:
        text: the number and its unit, a string, or a bare number.
        si: the unit wanted.
        what: what messages call it, e.g. the option that it was given to.

    Raises:
        InputError: no number, no unit, an unknown unit or one of another dimension.
    """
    if isinstance(text, bool) or not isinstance(text, str | int | float):
        raise InputError(f'{what} = {text!r}: wanted is a number and a unit, such as "12.5 {si}"')
    found = _QUANTITY.fullmatch(text.strip()) if isinstance(text, str) else None
    if isinstance(text, str) and found is None:
        raise InputError(f'{what} = {text!r}: wanted is a number and a unit, such as "12.5 {si}"')
    number, unit = (float(found[1]), found[2] or "1") if found else (float(text), "1")
    if unit.strip() == "1" and si != "1":
        raise InputError(f'{what} = {text!r} has no unit: write a number and a unit, such as "{number:g} {si}"')
    try:
        return float(to_si(number, unit, si))
    except InputError as error:
        raise InputError(f"{what} = {text!r}: {error}") from error

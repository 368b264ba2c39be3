"""Specimen sizes that a file states: in its key lines, in a small table, in columns that stay the same."""

import re
from collections.abc import Mapping

import numpy as np

from tissuejax.errors import InputError
from tissuejax.recordings.exports.meanings import quantity_of, readable, sizes_of, split_unit
from tissuejax.recordings.side_file import SPECIMEN_UNITS
from tissuejax.units import quantity

_VALUE = re.compile(r"\s*([-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)\s*([^\s;]*)")


def stated_sizes(header: Mapping[str, str]) -> dict[str, str]:
    """Specimen sizes among a file's key lines, as texts with units; the first of a kind counts."""
    sizes: dict[str, str] = {}
    for key, value in header.items():
        meant = sizes_of(key)
        found = _VALUE.match(value)
        if not meant or not found:
            continue
        unit = found[2].strip("()[],") or split_unit(key)[1]
        text = f"{found[1].replace(',', '.')} {unit}"
        if not unit or not readable(unit):
            continue
        # A0 is a thickness to some and an area to others: the unit tells.
        size = next((s for s in meant if _is_size(text, s)), None)
        if size is not None and size not in sizes:
            sizes[size] = text.replace("µ", "u")
    return sizes


def column_sizes(
    units: Mapping[str, str], numbers: Mapping[str, np.ndarray], meanings: Mapping[str, str]
) -> tuple[dict[str, str], list[str], list[str]]:
    """Sizes that stand in columns, the same number in every row; the columns' names, and sentences on them.

    Args:
        units: unit by column, "" for none.
        numbers: the columns that hold numbers.
        meanings: names that the format knows; what is a deformation or a load is no size.
    """
    sizes: dict[str, str] = {}
    used: list[str] = []
    said: list[str] = []
    for name, unit in units.items():
        base = split_unit(name)[0]
        meant = sizes_of(name)
        if name not in numbers or not meant or base in meanings or quantity_of(base, unit):
            continue
        values = numbers[name][np.isfinite(numbers[name])]
        unit = unit or ("mm" if meant[0] != "area" else "")
        if not len(values) or not unit:
            continue
        text = f"{values[0]:.6g} {unit}"
        size = next((s for s in meant if _is_size(text, s)), None)
        if size is None or size in sizes:
            continue
        if np.ptp(values):
            said.append(f"{name!r} is not the same in all rows, so it is not taken as the specimen's {size}")
            continue
        sizes[size] = text.replace("µ", "u")
        used.append(name)
        units_said = "" if units[name] else f", which has no unit and is taken as {unit}"
        said.append(f"the {size} is the one number in the column {name!r}{units_said}")
    return sizes, used, said


def _is_size(value: str, size: str) -> bool:
    try:
        return quantity(value, SPECIMEN_UNITS[size]) > 0
    except InputError:
        return False

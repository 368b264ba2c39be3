"""Dates and times of day, as loggers write them, as seconds from the first one."""

import re
from collections.abc import Sequence
from datetime import date

import numpy as np
from jaxtyping import Float, Shaped

_CLOCK = re.compile(
    r"(?:(?P<date>\d{1,4}[-./]\d{1,2}[-./]\d{1,4})[T\s]\s*)?(?P<h>\d{1,2}):(?P<m>\d{2}):(?P<s>\d{2}(?:[.,]\d+)?)"
    r"\s*(?P<half>[AaPp]\.?[Mm]\.?)?\s*(?:Z|[+-]\d{2}:?\d{2})?"
)
DAY = 86400.0  # s


def seconds(cells: Sequence[str] | Shaped[np.ndarray, " n"]) -> Float[np.ndarray, " n"] | None:
    """Seconds from the first of the times of day, with a date before them or without; None where they are none.

    A date that stays the same doesn't matter; one that changes is read as year-month-day or day.month.year, and not
    where it has slashes, whose order nobody knows. Without a date, a time that falls by half a day begins a new one.
    An empty cell is NaN.
    """
    found = [_CLOCK.fullmatch(str(c).strip()) for c in cells]
    filled = [bool(str(c).strip()) for c in cells]
    if not any(filled) or any(f and m is None for f, m in zip(filled, found, strict=True)):
        return None
    dates = {m["date"] for m in found if m}
    days: dict[str | None, int] = {}
    for text in dates:
        day = 0 if len(dates) == 1 else _day(text)
        if day is None:
            return None
        days[text] = day
    values = np.array([DAY * days[m["date"]] + _of_day(m) if m else np.nan for m in found])
    if dates == {None}:
        known = np.flatnonzero(filled)
        values[known] += DAY * np.cumsum(np.concatenate([[0], np.diff(values[known]) < -DAY / 2]))
    return values - values[np.flatnonzero(filled)[0]]


def _of_day(found: re.Match) -> float:
    hour = int(found["h"])
    if found["half"]:
        hour = hour % 12 + (12 if found["half"][0] in "pP" else 0)
    return 3600.0 * hour + 60.0 * int(found["m"]) + float(found["s"].replace(",", "."))


def _day(text: str | None) -> int | None:
    if text is None:
        return None
    iso = re.fullmatch(r"(\d{4})[-./](\d{1,2})[-./](\d{1,2})", text)
    dotted = re.fullmatch(r"(\d{1,2})\.(\d{1,2})\.(\d{4})", text)
    numbers = iso.groups() if iso else dotted.groups()[::-1] if dotted else None
    try:
        return date(*map(int, numbers)).toordinal() if numbers else None
    except ValueError:
        return None

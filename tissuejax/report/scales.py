"""SI numbers as people read them: kPa instead of 1e3 Pa, value and uncertainty with the digits that mean something."""

import math
from collections.abc import Sequence

PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "u"))
UNKNOWN = " (not identified)"
SCALED = {"Pa", "N", "m", "s"}
SMALL = 0.3  # spread of a logarithm up to which it is nearly the relative spread


def display(unit: str, size: float) -> tuple[float, str]:
    """(divisor, unit) that brings a quantity of magnitude `size` near one; Pa, N, m and s take prefixes.

    Nobody counts in thousandths of a pascal: mPa is a slip for MPa.
    """
    if unit not in SCALED or not math.isfinite(size) or size <= 0:
        return 1.0, unit
    for factor, prefix in PREFIXES:
        if (unit != "s" or factor <= 1) and size >= factor:
            return (factor, prefix + unit) if unit != "Pa" or factor >= 1 else (1.0, unit)
    return (1e-6, "u" + unit) if unit != "Pa" else (1.0, unit)


def common(units: Sequence[str], sizes: Sequence[float]) -> list[tuple[float, str]]:
    """`display` of quantities in one table or figure: those of one unit share its prefix, that of their middle size."""
    of = {unit: sorted(abs(s) for u, s in zip(units, sizes, strict=True) if u == unit and s) for unit in set(units)}
    return [display(unit, of[unit][len(of[unit]) // 2] if of[unit] else 0.0) for unit in units]


def ratio(spread: float) -> str:
    """A standard deviation of natural logarithms in words: 0.056 is 5.6 %, 1.04 a factor of 2.8."""
    return f"{100 * spread:.2g} %" if spread <= SMALL else f"a factor of {math.exp(spread):.2g}"


def ratios(spread: float, low: float, high: float) -> str:
    """`ratio` with the ends of its interval."""
    if min(spread, low, high) > SMALL:
        return f"{ratio(spread)} ({math.exp(low):.2g} to {math.exp(high):.2g})"
    return f"{ratio(spread)} ({ratio(low)} to {ratio(high)})"


def with_std(value: float, std: float | None) -> str:
    """`value` with four digits or as many as its error has, and its standard error with two: 1.234 ± 0.056."""
    if std is None:
        return f"{value:.5g}"
    if not math.isfinite(std):
        return f"{value:.4g}{UNKNOWN}"
    if std <= 0 or std < 1e-9 * abs(value):
        return f"{value:.6g} ± 0"
    own = 3 - math.floor(math.log10(abs(value))) if value else 0
    theirs = 1 - math.floor(math.log10(std))
    if max(own, theirs) > 8 or min(own, theirs) < -4:
        return f"{value:.4g} ± {std:.2g}"
    places = max(0, theirs, own if abs(value) > std else min(own, 4))
    error = f"{std:.{places}f}" if places <= max(0, theirs) else f"{std:.{max(0, theirs)}f}"
    return f"{value:.{places}f} ± {error}"


def with_unit(value: str, unit: str) -> str:
    """What `with_std` says, with its unit: 72 s (not identified), 1.2 ± 0.1 kPa; aligned where there is none."""
    number, words = (value.removesuffix(UNKNOWN), UNKNOWN) if value.endswith(UNKNOWN) else (value, "")
    return f"{number} {unit}".strip() + words


def label(unit: str) -> str:
    """A unit for an axis: nothing for the plain number."""
    return "" if unit == "1" else f" ({unit})"

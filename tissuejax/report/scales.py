"""SI numbers as people read them: kPa instead of 1e3 Pa, value and uncertainty with the digits that mean something."""

import math

PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "u"))
SCALED = {"Pa", "N", "m", "s"}


def display(unit: str, size: float) -> tuple[float, str]:
    """(divisor, unit) that brings a quantity of magnitude `size` near one; Pa, N, m and s take prefixes."""
    if unit not in SCALED or not math.isfinite(size) or size <= 0:
        return 1.0, unit
    for factor, prefix in PREFIXES:
        if (unit != "s" or factor <= 1) and size >= factor:
            return factor, prefix + unit
    return 1e-6, "u" + unit


def with_std(value: float, std: float | None) -> str:
    """`value` and its standard error with two digits of the error: 1.234 ± 0.056."""
    if std is None:
        return f"{value:.5g}"
    if not math.isfinite(std):
        return f"{value:.4g} (not identified)"
    if std <= 0 or std < 1e-9 * abs(value):
        return f"{value:.6g} ± 0"
    digits = 1 - math.floor(math.log10(std))
    if -4 <= digits <= 8:
        return f"{value:.{max(0, digits)}f} ± {std:.{max(0, digits)}f}"
    return f"{value:.4g} ± {std:.2g}"


def label(unit: str) -> str:
    """A unit for an axis: nothing for the plain number."""
    return "" if unit == "1" else f" ({unit})"

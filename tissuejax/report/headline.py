"""A diagnosis in one plain sentence with units: "35 % of the stress relaxes with 2.5 s; held-out error 211 -> 7 Pa"."""

import math

from tissuejax.diagnosis.result import Diagnosis
from tissuejax.report.effect_words import clauses
from tissuejax.report.scales import display


def headline(d: Diagnosis) -> str:
    """What is missing in words, and what naming it does to the error in the channel's own unit."""
    record = d.as_dict()
    kind, error = record["verdict"], errors(record)
    named = clauses(record["effects"])
    if kind == "nothing-missing":
        return f"Nothing is missing: {d.energy} predicts with an error of {_after(record)}."
    if kind == "unexplained":
        return f"Something is missing that has no name here: {d.energy} misses by {_before(record)}."
    if kind == "ambiguous":
        return f"Either {named[0] if named else 'one thing'} or another thing that looks alike; {error}."
    rest = " That is not all of it." if kind == "found-in-part" else ""
    text = "; ".join([*named, error])
    return f"{text[:1].upper()}{text[1:]}.{rest}"


def errors(record: dict) -> str:
    """ "held-out error 211 -> 7 Pa", one part for each unit; of the fitted recordings where none was held out."""
    before, after = pooled(record, "before"), pooled(record, "after")
    what = "held-out error" if record["held_out"] else "error"
    return f"{what} " + ", ".join(_arrow(b, after[unit], unit) for unit, b in before.items())


def pooled(record: dict, when: str) -> dict[str, float]:
    """Root mean square error by unit, of the held-out recordings or, where there are none, of all."""
    role = "held out" if record["held_out"] else "fitted"
    squares: dict[str, list[tuple[float, int]]] = {}
    for channels in record[when].values():
        for c in channels.values():
            if c["role"] == role:
                squares.setdefault(c["unit"], []).append((c["rmse"] ** 2, c["n"]))
    return {unit: math.sqrt(sum(e * n for e, n in of) / sum(n for _, n in of)) for unit, of in squares.items()}


def _arrow(before: float, after: float, unit: str) -> str:
    factor, shown = display(unit, before)
    return f"{_digits(before / factor)} -> {_digits(after / factor)}{_unit(shown)}"


def _before(record: dict) -> str:
    return _each(pooled(record, "before"), bool(record["held_out"]))


def _after(record: dict) -> str:
    return _each(pooled(record, "after"), bool(record["held_out"]))


def _each(by_unit: dict[str, float], held: bool) -> str:
    parts = []
    for unit, error in by_unit.items():
        factor, shown = display(unit, error)
        parts.append(f"{_digits(error / factor)}{_unit(shown)}")
    return " and ".join(parts) + (" in what was held out" if held else " in what was fitted")


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


def _digits(x: float) -> str:
    """Three digits from a hundred on, two below, no exponent where people write none."""
    if x == 0 or not math.isfinite(x) or not 1e-4 <= abs(x) < 1e6:
        return f"{x:.2g}"
    places = 1 - math.floor(math.log10(abs(x)))
    return f"{x:.0f}" if abs(x) >= 9.95 else f"{x:.{max(0, places)}f}"

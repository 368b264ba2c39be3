"""What an effect's fitted parameters mean, as one clause with units: "35 % of the stress relaxes with 2.5 s"."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tissuejax.effects.catalogue import effects
from tissuejax.report.scales import display

_FIELD = re.compile(r"\{(\w+)(?::([^}]*))?\}")
READ = {  # units that a reader would not use, and what is read instead
    "rad": (math.pi / 180, "degrees"),
    "1/s": (1.0, "Hz"),
    "1/Pa": (1e-3, "1/kPa"),
    "m/N": (1e-3, "mm/N"),
    "m/Pa": (1e-6, "mm/kPa"),
    "m/(s Pa)": (1e-6, "mm/(s kPa)"),
}


@dataclass(frozen=True)
class Found:
    """A fitted parameter, one value or one for each recording, SI.

    Attributes:
        drowned: its errors are larger than its values: what it leads is no statement.
    """

    values: tuple[float, ...]
    unit: str
    drowned: bool = False

    def __format__(self, how: str) -> str:
        if how == "exp":
            return _between([math.exp(v) for v in self.values])
        if how == "%":
            return f"{_between([100 * v for v in self.values])} %"
        factor, unit = READ.get(self.unit) or display(self.unit, max(map(abs, self.values)))
        return f"{_between([v / factor for v in self.values])}{'' if unit == '1' else f' {unit}'}"


def said(name: str, found: Mapping[str, Found]) -> str:
    """The clauses of an effect's `words` that its fitted parameters fill; "" where it has none.

    Args:
        name: of the effect.
        found: by parameter, without "effects.NAME.".
    """
    kind = effects().get(name)
    spoken = []
    for clause in kind.words if kind else ():
        names = [m[1] for m in _FIELD.finditer(clause)]
        if not all(n in found for n in names):
            continue
        leading = [n for n in names if found[n].unit == found[names[0]].unit]
        if not names or any(any(found[n].values) and not found[n].drowned for n in leading):
            spoken.append(
                (clause if spoken else _opening(clause, kind.words[0])).format(**{n: found[n] for n in names})
            )
    return ", ".join(spoken)


def _opening(clause: str, first: str) -> str:
    """`clause`, or the first one with its numbers: "{g2} with {tau2}" goes on from a first term that is not said."""
    number = re.search(r"\{\w*?(\d)[:}]", clause)
    whole = re.sub(r"(\{\w*?)1(?=[:}])", rf"\g<1>{number[1]}", first) if number else clause
    fields = [{m[1] for m in _FIELD.finditer(text)} for text in (clause, whole)]
    return whole if fields[0] == fields[1] else clause


def clauses(listed: Sequence[dict]) -> list[str]:
    """One clause for every effect of a diagnosis (`Diagnosis.effects`); its name where it has no words, or none that
    its errors bear: a number smaller than its own error is no statement.
    """
    out = []
    for entry in listed:
        by_effect: dict[str, dict[str, list[dict]]] = {}
        for path, p in entry["parameters"].items():
            effect, parameter = path.removeprefix("effects.").split(".")[:2]
            by_effect.setdefault(effect, {}).setdefault(parameter, []).append(p)
        parts = [
            said(effect, {n: _found(of) for n, of in parameters.items()})
            for effect, parameters in (by_effect or {entry["name"]: {}}).items()
        ]
        out.append(", ".join(part for part in parts if part) or entry["name"].replace("-", " "))
    return list(dict.fromkeys(out))


def _found(of: Sequence[dict]) -> Found:
    """A parameter from its records, one or one for each recording; one that was held has no error."""
    lost = all(p.get("std") is not None and not p["std"] <= abs(p["value"]) for p in of)
    return Found(tuple(p["value"] for p in of), of[0]["unit"], lost)


def _between(values: Sequence[float]) -> str:
    """Two digits; of several values the range."""
    low, high = f"{_two(min(values))}", f"{_two(max(values))}"
    return low if low == high else f"{low} to {high}"


def _two(x: float) -> str:
    """Two digits, and no exponent where people write none."""
    if x and 1e-4 <= abs(x) < 1e6:
        rounded = float(f"{x:.2g}")
        return (
            f"{rounded:.0f}"
            if abs(rounded) >= 10
            else f"{rounded:.{max(0, 1 - math.floor(math.log10(abs(rounded))))}f}"
        )
    return f"{x:.2g}"

"""Energies by the names used on the command line.

A name is a member of the family, with its order where it has one: `neo-hookean`, `reduced-polynomial-4`, `ogden-3`
(which also needs `ogden_form`, as constants mean nothing without it); `+fibre` adds a fibre term to any of them.
"""

import re
from typing import Any, NamedTuple, cast

from tissuejax import energies as package
from tissuejax.energies.energy import Energy
from tissuejax.energies.ogden import form
from tissuejax.energies.volumetric import Volumetric
from tissuejax.errors import InputError, unknown
from tissuejax.families import members
from tissuejax.parameters import Parameter

ALIASES = {
    "yeoh": "reduced-polynomial-3",
    "neo-hooke": "neo-hookean",
    "holzapfel-gasser-ogden": "hgo",
    "gasser-ogden-holzapfel": "goh",
}


def energies() -> dict[str, type[Energy]]:
    """All isotropic energies by name, without order; additions like the fibre term are not among them."""
    return {name: kind for name, kind in members(package, Energy).items() if not name.startswith("+")}


def volumetrics() -> dict[str, type[Volumetric]]:
    """All volumetric energies by name, without order."""
    return members(package, Volumetric)


def energy(name: str, ogden_form: str | None = None) -> Energy:
    """The energy called `name`, e.g. "reduced-polynomial-2" or "ogden-3+fibre".

    Args:
        name: as on the command line, in small or large letters; orders are written at the end, `+fibre` after that.
        ogden_form: for `ogden-N` only, and there required: one of `ogden.FORMS`.

    Raises:
        InputError: unknown name (the nearest are offered), an order missing or not wanted, an Ogden form likewise.
    """
    stem, plus, addition = name.strip().lower().replace(" ", "-").partition("+")
    additions = {n: kind for n, kind in members(package, Energy).items() if n.startswith("+")}
    if plus and f"+{addition}" not in additions:
        raise unknown("addition to an energy", f"+{addition}", additions)
    stem = ALIASES.get(stem, stem)
    takes_form = stem == "ogden" or stem.startswith("ogden-")
    if ogden_form is not None and not takes_form:
        raise InputError(f"energy {name!r} takes no Ogden form ({ogden_form!r} came): leave it out, or write ogden-N")
    if takes_form:
        form(ogden_form)
    found = _of(energies(), "energy", stem, **({"form": ogden_form} if takes_form else {}))
    return additions[f"+{addition}"](found) if plus else found


def volumetric(name: str) -> Volumetric:
    """The volumetric energy called `name`: "quadratic", "logarithmic" or "compressibility-N" (without N: 1)."""
    return _of(volumetrics(), "volumetric energy", "compressibility-1" if name == "compressibility" else name)


class Entry(NamedTuple):
    """One line of the catalogue, in words."""

    name: str
    formula: str
    parameters: tuple[Parameter, ...]
    shear_modulus: str
    valid: str
    source: str


def entries() -> dict[str, Entry]:
    """The catalogue as `tissuejax energies` shows it: every energy and addition, under the name to type."""
    lines = {}
    for name, example in examples().items():
        if "+" in name:
            matrix = cast(Any, example).matrix  # an addition is written "+name" and wraps a matrix
            typed, declared = example.name, example.parameters[len(matrix.parameters) :]
        else:
            typed, declared = re.sub(r"-\d+$", "-N", name), example.parameters
        lines[typed] = Entry(typed, example.formula, declared, example.shear_modulus, example.valid, example.source)
    return lines


def entries_of(name: str) -> dict[str, Entry]:
    """The lines of `entries` that an energy's name stands for: its own and that of its addition; orders don't matter.

    Raises:
        InputError: unknown name (the nearest are offered).
    """
    every = entries()
    stem, plus, addition = name.strip().lower().replace(" ", "-").partition("+")
    stem = re.sub(r"-(\d+|n)$", "", ALIASES.get(stem, stem))
    wanted = [f"{stem}-N" if f"{stem}-N" in every else stem] * bool(stem) + [f"+{addition}"] * bool(plus)
    for line in wanted:
        if line not in every:
            raise unknown("energy", line, [*every, *ALIASES])
    return {line: every[line] for line in wanted}


def examples(ogden_form: str = "2mu/alpha^2", order: int = 2) -> dict[str, Energy]:
    """One of each energy, and the neo-Hookean one with each addition, by name: for tables, plots and test batteries."""
    found = {}
    for name, kind in members(package, Energy).items():
        typed = f"neo-hookean{name}" if name.startswith("+") else f"{name}-{order}" if _ordered(kind) else name
        found[typed] = energy(typed, ogden_form if name == "ogden" else None)
    return found


def name_of(energy: Energy | Volumetric) -> str:
    """The name under which the catalogue gives this energy, e.g. "ogden-3+fibre"."""
    matrix, order = getattr(energy, "matrix", None), getattr(energy, "order", None)
    if matrix is not None:
        return name_of(matrix) + energy.name
    return energy.name if order is None else f"{energy.name}-{order}"


def forms_of(energy: Energy, volumetric: Volumetric | None = None) -> dict[str, str]:
    """Every choice of form that the constants depend on, for files and reports: {"ogden": ..., "volumetric": ...}."""
    matrix = getattr(energy, "matrix", energy)
    form = getattr(matrix, "form", None)
    forms = {} if form is None else {"ogden": form}
    return forms | {"volumetric": volumetric.formula if volumetric else "incompressible"}


MOST = 9  # order of a series energy


def _of(found: dict[str, type], kind: str, name: str, **options):
    """The member `name` or `name-N` of a family."""
    stem, order = (m[1], int(m[2])) if (m := re.fullmatch(r"(.*?)-(\d+)", name)) else (name, None)
    if stem not in found:
        raise unknown(kind, name, [*found, *(ALIASES if kind == "energy" else ())])
    cls = found[stem]
    ordered = _ordered(cls)
    if ordered and not order:
        raise InputError(f"{kind} {name!r} needs its order, 1 or more: write {stem}-2 for order 2")
    if ordered and order is not None and order > MOST:
        raise InputError(
            f"{kind} {name!r}: order {order} has more constants than any test can tell; 1 to {MOST} can be had"
        )
    if order is not None and not ordered:
        raise InputError(f"{kind} {name!r}: {stem!r} has no order; write {stem!r}")
    return cls(**options, **({"order": order} if ordered else {}))


def _ordered(kind: type) -> bool:
    return "order" in getattr(kind, "__dataclass_fields__", {})

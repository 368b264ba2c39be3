"""Energies by the names used on the command line.

A name is a member of the family, with its order where it has one: `neo-hookean`, `reduced-polynomial-4`, `ogden-3`
(which also needs `ogden_form`, as constants mean nothing without it); `+fibre` adds a fibre term to any of them.
"""

import re

from tissuejax import energies as package
from tissuejax.energies.energy import Energy
from tissuejax.energies.volumetric import Volumetric
from tissuejax.errors import InputError, unknown
from tissuejax.families import members

ALIASES = {"yeoh": "reduced-polynomial-3"}


def energies() -> dict[str, type[Energy]]:
    """All isotropic energies by name, without order; additions like the fibre term are not among them."""
    return {name: kind for name, kind in members(package, Energy).items() if not name.startswith("+")}


def volumetrics() -> dict[str, type[Volumetric]]:
    """All volumetric energies by name, without order."""
    return members(package, Volumetric)


def energy(name: str, ogden_form: str | None = None) -> Energy:
    """The energy called `name`, e.g. "reduced-polynomial-2".

    Args:
        name: as on the command line; orders are written at the end.
        ogden_form: for `ogden-N` only, and there required.

    Raises:
        InputError: unknown name (the nearest are offered), an order missing or not wanted.
    """
    return _of(energies(), "energy", ALIASES.get(name, name))


def volumetric(name: str) -> Volumetric:
    """The volumetric energy called `name`: "quadratic", "logarithmic" or "compressibility-N" (without N: 1)."""
    return _of(volumetrics(), "volumetric energy", "compressibility-1" if name == "compressibility" else name)


def name_of(energy: Energy | Volumetric) -> str:
    """The name under which the catalogue gives this energy."""
    return f"{energy.name}-{energy.order}" if hasattr(energy, "order") else energy.name


def _of(found: dict[str, type], kind: str, name: str, **options):
    """The member `name` or `name-N` of a family."""
    stem, order = (m[1], int(m[2])) if (m := re.fullmatch(r"(.*?)-(\d+)", name)) else (name, None)
    if stem not in found:
        raise unknown(kind, name, [*found, *(ALIASES if kind == "energy" else ())])
    cls = found[stem]
    ordered = "order" in getattr(cls, "__dataclass_fields__", {})
    if ordered and not order:
        raise InputError(f"{kind} {name!r} needs its order, 1 or more: write {stem}-2 for order 2")
    if order is not None and not ordered:
        raise InputError(f"{kind} {name!r}: {stem!r} has no order; write {stem!r}")
    return cls(**options, **({"order": order} if ordered else {}))

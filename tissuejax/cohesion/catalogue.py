"""Cohesive laws by name."""

from tissuejax import cohesion as package
from tissuejax.cohesion.law import Law
from tissuejax.families import lookup, members


def laws() -> dict[str, type[Law]]:
    """All laws by name."""
    return members(package, Law)


def law(name: str) -> Law:
    """The law called `name`, e.g. "bilinear".

    Raises:
        InputError: no such law; the nearest are offered.
    """
    return lookup("cohesive law", name, laws())()

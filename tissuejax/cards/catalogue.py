"""Cards by the names used on the command line."""

from tissuejax import cards as package
from tissuejax.cards.card import Card
from tissuejax.families import lookup, members


def cards() -> dict[str, Card]:
    """All cards by name."""
    return {name: kind() for name, kind in members(package, Card).items()}


def card(name: str) -> Card:
    """The card called `name`.

    Raises:
        InputError: no such solver; the nearest names are offered.
    """
    return lookup("solver", name, members(package, Card))()

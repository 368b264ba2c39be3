"""Effects by their names."""

from tissuejax import effects as package
from tissuejax.effects.effect import Effect
from tissuejax.families import lookup, members


def effects(kind: str | None = None) -> dict[str, type[Effect]]:
    """All effects by name, or those that act in experiments of `kind` ("homogeneous" or "probing")."""
    return {name: cls for name, cls in members(package, Effect).items() if kind is None or kind in cls.kinds}


def effect(name: str, **options) -> Effect:
    """The effect called `name`, e.g. "softening"; `options` are its fields.

    Raises:
        InputError: no such effect; the nearest names are offered.
    """
    return lookup("effect", name, effects())(**options)

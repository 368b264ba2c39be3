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


def suited(name: str, kind: str, **options) -> Effect:
    """The effect called `name` as it acts in experiments of `kind`: some have other parameters in a probing.

    Raises:
        InputError: no such effect, or one that can't act there.
    """
    member = lookup("effect", name, effects(kind))
    return member(**options, **({"kind": kind} if "kind" in member.__dataclass_fields__ else {}))

"""Effects by their names."""

from tissuejax import effects as package
from tissuejax.effects.effect import Effect
from tissuejax.errors import InputError
from tissuejax.families import lookup, members
from tissuejax.parameters import Parameter

MOST_TERMS = 5


def effects(kind: str | None = None) -> dict[str, type[Effect]]:
    """All effects by name, or those that act in experiments of `kind`, one of `Effect.kinds`."""
    return {name: cls for name, cls in members(package, Effect).items() if kind is None or kind in cls.kinds}


def effect(name: str, **options) -> Effect:
    """The effect called `name`, e.g. "softening"; `options` are its fields.

    A number after the name is that of its terms: "viscoelasticity-3" has three relaxation times, without it one.

    Raises:
        InputError: no such effect; the nearest names are offered.
    """
    found = effects()
    stem, _, number = name.rpartition("-")
    if name not in found and "terms" in getattr(found.get(stem), "__dataclass_fields__", ()) and number.isdigit():
        if not 1 <= int(number) <= MOST_TERMS:
            raise InputError(f"effect {name!r}: 1 to {MOST_TERMS} terms can be told apart at best")
        name, options = stem, {"terms": int(number)} | options
    return lookup("effect", name, found)(**options)


def needs(kind: str) -> dict[str, str]:
    """By name of an effect, the property of a protocol of experiments of `kind` that an answer needs, if any."""
    return {name: effect.needs[kind] for name, effect in effects(kind).items() if kind in effect.needs}


def suited(name: str, kind: str, **options) -> Effect:
    """The effect called `name`, for experiments of `kind`.

    Raises:
        InputError: no such effect, or one that can't act there.
    """
    return lookup("effect", name, effects(kind))(**options)


def declared(name: str) -> dict[str, Parameter]:
    """Parameters that the effect called `name` can have, by name; of a series those of its longest."""
    cls = effects()[name]
    series = isinstance(getattr(cls, "terms", None), int)
    return {d.name: d for d in (effect(f"{name}-{MOST_TERMS}") if series else cls()).parameters}

"""Declared parameters and the values that go with them.

A component (an energy, an effect) declares its parameters as data; a value set is a flat dict from dotted
path (`energy.mu`, `effects.friction.coefficient`) to a scalar, which is a JAX pytree as it stands.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

from jaxtyping import Array, Float

from tissuejax.arrays import Given
from tissuejax.errors import InputError, unknown

Values = Mapping[str, Float[Array, ""] | float]
Number = TypeVar("Number")
Constants = Mapping[str, Given]  # of a law, by name


@dataclass(frozen=True)
class Parameter:
    """One parameter as its component declares it.

    Attributes:
        name: last part of the dotted path.
        unit: SI unit, "1" where there is none.
        default: where a fit starts when nothing better is known.
        lower, upper: the open valid range; infinite where unbounded.
        meaning: one phrase, for tables and help.
        scale: typical magnitude, for steps and transforms (defaults to |default| or 1).
        frozen: True for a value that a fit leaves alone unless it is named.
        each: True for a value of its own in every recording (an offset, a phase): its path ends in the recording.
    """

    name: str
    unit: str
    default: float
    lower: float = -math.inf
    upper: float = math.inf
    meaning: str = ""
    scale: float | None = None
    frozen: bool = False
    each: bool = False

    def __post_init__(self):
        if not self.lower < self.upper:
            raise InputError(f"parameter {self.name}: bounds ({self.lower}, {self.upper}) are empty; lower < upper")

    @property
    def typical(self) -> float:
        """A magnitude to measure steps by."""
        return self.scale or abs(self.default) or 1.0


def prefixed(prefix: str, declared: Mapping[str, Parameter] | tuple[Parameter, ...]) -> dict[str, Parameter]:
    """`declared` under dotted paths below `prefix`."""
    pairs = declared.items() if isinstance(declared, Mapping) else ((d.name, d) for d in declared)
    return {f"{prefix}.{name}": parameter for name, parameter in pairs}


def under(prefix: str, values: Mapping[str, Number]) -> dict[str, Number]:
    """The values below `prefix`, by the rest of their path."""
    start = f"{prefix}."
    return {path[len(start) :]: value for path, value in values.items() if path.startswith(start)}


def checked(values: Mapping[str, float], declared: Mapping[str, Parameter]) -> dict[str, float]:
    """`values` with every path known and inside its range.

    Raises:
        InputError: an unknown path (the nearest are offered), a non-finite value, a value outside its range.
    """
    for path, value in values.items():
        if path not in declared:
            raise unknown("parameter", path, declared)
        p = declared[path]
        if not math.isfinite(value) or not p.lower <= value <= p.upper:
            unit = "" if p.unit == "1" else f" {p.unit}"
            raise InputError(f"{path} = {value}{unit}: allowed is {p.lower} to {p.upper}{unit}; change the value")
    return dict(values)

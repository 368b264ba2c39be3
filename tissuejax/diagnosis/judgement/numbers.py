"""All numbers of a judgement, reached from one place by dotted path, and the same with one of them changed.

`Numbers().all()` lists them: what sets are weighed and judged by (`Criteria`, with the records that are fields of it)
and how much is tried (`Effort`). What only rounds, or where an iteration inside a formula ends, is no number of these.
"""

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.errors import InputError, unknown

SHARES = (
    "criteria.named",
    "criteria.covered",
    "criteria.means.peak",
    "criteria.shown.quick",
)  # below 1 by their meaning


@dataclass(frozen=True)
class Numbers:
    """What a diagnosis is made with: `diagnose(..., criteria=numbers.criteria, effort=numbers.effort)`."""

    criteria: Criteria = field(default_factory=Criteria)
    effort: Effort = field(default_factory=Effort)

    def all(self) -> dict[str, float]:
        """Every number by its path, e.g. "criteria.shares.law", "criteria.sizes.1", "effort.course.rounds"."""
        return numbers_of(self)

    def unusual(self) -> dict[str, float]:
        """Those that are not as usual, by path; of a table of any numbers, those that the usual one lacks too."""
        usual = Numbers().all()
        return {path: value for path, value in self.all().items() if usual.get(path) != value}

    def changed(self, path: str, factor: float) -> "Numbers":
        """The same with the number at `path` times `factor`; a count stays one, and at least 1; a share below 1.

        Raises:
            InputError: no such number, or a factor that is not positive.
        """
        known = self.all()
        if path not in known:
            raise unknown("number", path, known)
        if not (factor > 0 and math.isfinite(factor)):
            raise InputError(f"a factor of {factor:g}: give a positive number, such as 0.5 or 2")
        value = known[path] * factor
        if path in SHARES:
            value = min(value, 0.99)
        elif isinstance(known[path], int):
            value = max(round(value), 1)
        return self.having(path, value)

    def having(self, path: str, value: float) -> "Numbers":
        """The same with this number at `path`.

        Raises:
            InputError: no such number, or part of one where it counts something.
        """
        known = self.all()
        if path not in known:
            raise unknown("number", path, known)
        if isinstance(known[path], int) and value != round(value):
            raise InputError(f"{path} = {value:g}: it counts something; give a whole number")
        return _with(self, path.split("."), round(value) if isinstance(known[path], int) else value)


def numbers_of(record: object) -> dict[str, float]:
    """Every number of a record, and of the records, mappings and tuples in it, by its path."""
    return dict(_numbers(record, ""))


def _numbers(at: object, prefix: str) -> Iterator[tuple[str, float]]:
    if isinstance(at, int | float) and not isinstance(at, bool):
        if math.isfinite(at):
            yield prefix, at
        return
    for name, value in _members(at):
        yield from _numbers(value, f"{prefix}.{name}" if prefix else name)


def _members(at: object) -> list[tuple[str, object]]:
    if dataclasses.is_dataclass(at):
        return [(f.name, getattr(at, f.name)) for f in dataclasses.fields(at)]
    if isinstance(at, Mapping):
        return list(at.items())
    return [(str(i), x) for i, x in enumerate(at)] if isinstance(at, tuple) else []


def _with(at: Any, path: list[str], value: float) -> Any:
    if not path:
        return value
    name, rest = path[0], path[1:]
    inner = _with(dict(_members(at))[name], rest, value)
    if isinstance(at, Mapping):
        return {**at, name: inner}
    if isinstance(at, tuple):
        return tuple(inner if str(i) == name else x for i, x in enumerate(at))
    return dataclasses.replace(at, **{name: inner})

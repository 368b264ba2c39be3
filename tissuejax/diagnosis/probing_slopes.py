"""Derivatives of probings, taken once and used again nearby.

A column costs a simulation of every recording, and moduli that trade against each other are told apart by small
differences of theirs: a column a tenth off leaves a fit where it is, a column some hundredths off serves. So a column
taken at one set of values is used at another as long as the prediction between them has changed by less than a share
(`reach`), and the shapes of its own effect have hardly moved. Columns of logarithms are kept as such: they hold over
the wider range.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.bench import Free


@dataclass(frozen=True)
class Slope:
    """One column: where it was taken, the prediction there, and for which recordings.

    Attributes:
        values: all values.
        calmed: the prediction at these, without what rings (`ProbingBench.calmed`), long vector, SI.
        recordings: whose rows mean anything.
        column: derivative by the parameter, SI.
    """

    values: Mapping[str, float]
    calmed: Float[np.ndarray, " N"]
    recordings: frozenset[str]
    column: Float[np.ndarray, " N"]


@dataclass
class Slopes:
    """All columns taken of one sample, by path."""

    taken: dict[str, list[Slope]] = field(default_factory=dict)

    def keep(self, path: str, slope: Slope) -> None:
        """Remember a column."""
        if np.all(np.isfinite(slope.column)):
            self.taken.setdefault(path, []).append(slope)

    def find(
        self,
        path: str,
        values: Mapping[str, float],
        free: Mapping[str, Free],
        recordings: Sequence[str],
        change,
        reach: float,
        shape: float,
    ) -> Float[np.ndarray, " N"] | None:
        """The column taken nearest to `values`, if one is near enough.

        Args:
            change: of a prediction, calmed, its relative difference from that at `values`.
            reach: largest such difference.
            shape: see `Simulated.shape`.
        """
        near = []
        for slope in self.taken.get(path, ()):
            if slope.recordings.issuperset(recordings) and _alike(path, values, slope.values, free, shape):
                near.append((change(slope.calmed), slope))
        if not near or min(near, key=lambda n: n[0])[0] > reach:
            return None
        slope = min(near, key=lambda n: n[0])[1]
        return slope.column * (slope.values[path] / values[path] if free[path].log else 1.0)


def _alike(
    path: str, one: Mapping[str, float], other: Mapping[str, float], free: Mapping[str, Free], shape: float
) -> bool:
    """Whether what the same effect does is much the same at both; an amplitude's own value doesn't count."""
    if not path.startswith("effects."):
        return True
    family = path.rsplit(".", 1)[0] if path.count(".") == 2 else ".".join(path.split(".")[:2])
    for p in {p for p in (*one, *other) if p.startswith(family + ".")} - {path}:
        a, b, f = one.get(p, 0.0), other.get(p, 0.0), free.get(p)
        if f is None or a == b:
            continue
        moved = abs(np.log(a / b)) if f.log and a > 0 and b > 0 else abs(a - b) / max(f.scale, abs(a), abs(b))
        if moved > shape:
            return False
    return True

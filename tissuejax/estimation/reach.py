"""How far a step of a descent may go: bounds, a longest step, and angles; and the damped step inside such a box."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.optimize import lsq_linear

HEAVY = 1e4  # times the largest column: what a sum must be
TURN = 0.8  # rad: the longest step of an angle, a quarter of it after every step that gained nothing


class Whole(NamedTuple):
    """Which coordinates are parts of it, and how much of it there is."""

    members: tuple[int, ...]
    most: float

    def excess(self, y: Float[np.ndarray, " p"]) -> float:
        """By how much the parts are more than there is."""
        return float(np.sum(y[list(self.members)])) - self.most

    def shrunk(self, y: Float[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
        """y with parts that exceed the whole scaled down to it."""
        if self.excess(y) <= 0:
            return y
        out = y.copy()
        out[list(self.members)] *= self.most / np.sum(y[list(self.members)])
        return out


@dataclass(frozen=True)
class Reach:
    """The box of a step.

    Attributes:
        lower, upper: ends of the coordinates; a value that rests there leaves when the data want it to.
        scale: typical size of each coordinate.
        longest: no coordinate moves farther in one step. In a box, unlike a ball, one coordinate that wants to go far
            does not hold up the others.
        wholes: coordinates that are parts of something, and how much of it there is: together they stay below that.
        turns: which coordinates are angles. Near an axis of the tests an angle has next to no slope and wants several
            turns: the rest must not wait for it.
    """

    lower: Float[np.ndarray, " p"]
    upper: Float[np.ndarray, " p"]
    scale: Float[np.ndarray, " p"]
    longest: float = np.inf
    turns: np.ndarray | bool = False
    wholes: tuple[Whole, ...] = ()

    @classmethod
    def anywhere(cls, p: int, longest: float = np.inf) -> "Reach":
        """Of p coordinates of order one without bounds."""
        return cls(np.full(p, -np.inf), np.full(p, np.inf), np.ones(p), longest)

    def box(self, y: Float[np.ndarray, " p"], attempt: int) -> tuple[np.ndarray, np.ndarray]:
        """Ends of the `attempt`-th step from y."""
        far = np.where(self.turns, TURN / 4**attempt, self.longest)
        return np.maximum(self.lower - y, -far), np.minimum(self.upper - y, far)

    def trial(
        self,
        triangle: Float[np.ndarray, "q p"],
        aim: Float[np.ndarray, " q"],
        damped: Float[np.ndarray, " p"],
        y: Float[np.ndarray, " p"],
        attempt: int,
    ) -> Float[np.ndarray, " p"]:
        """Where the `attempt`-th step from y leads: y + s, min |T s - aim|^2 + |damped s|^2 in the box.

        Args:
            triangle, aim: T of J = Q T, and -Q' r.
            damped: root of the damping times the size of each coordinate's column.
        """
        rows, aims, box = np.vstack([triangle, np.diag(damped)]), np.concatenate([aim, 0 * y]), self.box(y, attempt)
        step = bounded(rows, aims, *box)
        full = [whole for whole in self.wholes if whole.excess(y + step) > 0]
        if full:  # what would be more than there is becomes just that: a row that outweighs all others
            weight = HEAVY * float(np.max(np.linalg.norm(rows, axis=0)))
            sums = np.array([np.isin(np.arange(len(y)), w.members) for w in full], float)
            rows = np.vstack([rows, weight * sums])
            step = bounded(rows, np.concatenate([aims, [-weight * w.excess(y) for w in full]]), *box)
        found = np.clip(y + step, self.lower, self.upper)
        for whole in self.wholes:
            found = whole.shrunk(found)
        return found


def bounded(
    a: Float[np.ndarray, "m p"], b: Float[np.ndarray, " m"], low: Float[np.ndarray, " p"], high: Float[np.ndarray, " p"]
) -> Float[np.ndarray, " p"]:
    """min |a s - b| with low <= s <= high; the free solution where it is allowed."""
    step = np.linalg.lstsq(a, b, rcond=None)[0]
    if np.all(step >= low) and np.all(step <= high):
        return step
    size = np.linalg.norm(a, axis=0)
    answer = lsq_linear(a / size, b, (low * size, np.maximum(high, low + 1e-12) * size), method="bvls", max_iter=50)
    return answer.x / size

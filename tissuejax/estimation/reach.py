"""How far a step of a descent may go: bounds, a longest step, and angles; and the damped step inside such a box."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import lsq_linear

TURN = 0.8  # rad: the longest step of an angle, a quarter of it after every step that gained nothing


@dataclass(frozen=True)
class Reach:
    """The box of a step.

    Attributes:
        lower, upper: ends of the coordinates; a value that rests there leaves when the data want it to.
        scale: typical size of each coordinate.
        longest: no coordinate moves farther in one step. In a box, unlike a ball, one coordinate that wants to go far
            does not hold up the others.
        turns: which coordinates are angles. Near an axis of the tests an angle has next to no slope and wants several
            turns: the rest must not wait for it.
    """

    lower: Float[np.ndarray, " p"]
    upper: Float[np.ndarray, " p"]
    scale: Float[np.ndarray, " p"]
    longest: float = np.inf
    turns: np.ndarray | bool = False

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
        rows = np.vstack([triangle, np.diag(damped)])
        step = bounded(rows, np.concatenate([aim, np.zeros(len(y))]), *self.box(y, attempt))
        return np.clip(y + step, self.lower, self.upper)


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

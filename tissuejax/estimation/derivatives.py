"""Where a descent's Jacobian comes from: computed at every point, or corrected on the way between them."""

import abc
from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from tissuejax.estimation.posed import LeastSquares

NOTHING = 1e-5  # of the largest effect of a parameter, each moved by its scale: what a one-sided difference errs by
KEPT = 0.7  # of its promise that a step must have gained for the Jacobian to be corrected along it
AGE = 3  # corrections in a row


class Derivatives(abc.ABC):
    """The Jacobian of one descent, from point to point.

    Attributes:
        count: how many were computed.
        age: corrections since the last one that was.
        lacking: whether columns may be missing that appear after a step.
    """

    count: int = 0
    age: int = 0
    lacking: bool = False

    @property
    def corrected(self) -> bool:
        """Whether it is not one that was computed at the present point."""
        return self.age > 0

    @property
    def exact(self) -> bool:
        """Whether it tells of all directions at the present point: no other may end a descent."""
        return not self.corrected and not self.lacking

    @abc.abstractmethod
    def at(self, y: Float[np.ndarray, " p"], scale: Float[np.ndarray, " p"]) -> tuple[np.ndarray, np.ndarray]:
        """The Jacobian at y, and the same with columns of zeros where it is nothing but error."""

    @abc.abstractmethod
    def moved(self, step: Float[np.ndarray, " p"], missed: Float[np.ndarray, " n"], kept: bool) -> None:
        """A step was taken; `missed` are the residuals there less those foretold, small if it `kept` its promise."""

    @abc.abstractmethod
    def forget(self) -> None:
        """Compute the next one anew."""

    @abc.abstractmethod
    def renewed(self, attempt: int) -> bool:
        """Whether a better one can be had at this point, where the `attempt`-th step from it gained nothing."""


class Exact(Derivatives):
    """Computed at every point that was accepted."""

    def __init__(self, problem: LeastSquares):
        self.problem = problem

    def at(self, y, scale):
        """See `Derivatives.at`."""
        self.count += 1
        jacobian = self.problem.jacobian(y)
        return jacobian, jacobian

    def moved(self, step, missed, kept):
        """Nothing to correct."""

    def forget(self):
        """Nothing was kept."""

    def renewed(self, attempt):
        """There is no better one."""
        return False


class Corrected(Derivatives):
    """Corrected along steps that keep their promise (Broyden 1965), where a Jacobian costs many predictions.

    A corrected one knows nothing of directions that were not taken, nor that of the start of shapes whose amplitude was
    zero there: neither may end the descent.

    Attributes:
        known: the Jacobian at the start, where it is known already from elsewhere: it may lack what vanishes there
            (shapes at zero amplitude) and is good for one step.
        sharpen: makes the problem's derivatives those of the very place; None where they are so already.
    """

    def __init__(
        self,
        problem: LeastSquares,
        known: Float[np.ndarray, "n p"] | None = None,
        sharpen: Callable[[], None] | None = None,
    ):
        self.problem, self.jacobian, self.sharpen = problem, known, sharpen
        self.given, self.first = known is not None, True

    def at(self, y, scale):
        """See `Derivatives.at`."""
        if self.jacobian is None:
            self.jacobian, self.age = self.problem.jacobian(y), 0
            self.count += 1
        size = np.linalg.norm(self.jacobian, axis=0)
        # a column that is nothing but the error of a difference (a fibre along an axis: no slope in its angle) must not
        # call for a step of its own, or nothing else moves
        nothing = size * scale < NOTHING * np.max(size * scale, initial=0.0)
        self.lacking = self.given or (self.first and not np.all(size))
        self.first = False
        return self.jacobian, np.where(nothing, 0.0, self.jacobian)

    def moved(self, step, missed, kept):
        """See `Derivatives.moved`."""
        following = kept and self.age < AGE and step @ step > 0 and not self.lacking
        if following and self.jacobian is not None:
            self.jacobian, self.age = self.jacobian + np.outer(missed, step) / (step @ step), self.age + 1
        else:
            self.forget()

    def forget(self):
        """See `Derivatives.forget`."""
        self.jacobian, self.given = None, False

    def renewed(self, attempt):
        """See `Derivatives.renewed`."""
        if self.corrected:
            self.forget()
            return True
        if self.sharpen is None or attempt == 0:
            return False
        self.sharpen()
        self.sharpen, self.jacobian = None, None
        return True

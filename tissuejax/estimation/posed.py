"""A least-squares problem as a descent sees it."""

import abc

import numpy as np
from jaxtyping import Float


class LeastSquares(abc.ABC):
    """Residuals and their derivative, in the coordinates y of a descent.

    Residuals that are not finite, or an `UnstableSimulation`, say that nothing can be predicted there.
    """

    @abc.abstractmethod
    def residuals(self, y: Float[np.ndarray, " p"]) -> Float[np.ndarray, " n"]:
        """Predicted less measured in units of the noise, whitened, rows of priors included."""

    @abc.abstractmethod
    def jacobian(self, y: Float[np.ndarray, " p"]) -> Float[np.ndarray, "n p"]:
        """Their derivative by y; asked for where residuals were asked for before."""


def half_square(r: Float[np.ndarray, " n"]) -> float:
    """Half the sum of squares; infinite where something is not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        total = 0.5 * float(r @ r)
    return total if np.isfinite(total) else np.inf

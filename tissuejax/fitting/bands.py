"""How far a prediction may be off: the estimates' uncertainty carried into every channel by the Jacobian."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from tissuejax.fitting.problem import Problem
from tissuejax.fitting.uncertainty import Uncertainty

NORMAL_95 = 1.959964  # standard deviations that hold 95 % of a normal distribution


def prediction_std(
    problem: Problem, values: Mapping[str, float], spread: Uncertainty, names: tuple[str, ...]
) -> dict[str, dict[str, Float[np.ndarray, "n ..."]]]:
    """Standard deviation of the predicted (noise-free) curve, sqrt(diag(J Sigma J')), by recording and channel, SI.

    Linear in the parameters around the estimate. Combinations that the data leave open to rounding have no share: their
    columns of J are zero where they were fitted.
    """
    _, slopes = problem.predictor.of(names).jacobian(dict(values), problem.free)
    sigma = np.where(np.isfinite(spread.covariance), spread.covariance, 0.0)
    found: dict[str, dict[str, np.ndarray]] = {}
    for name in names:
        found[name] = {}
        for channel in slopes[problem.free[0]][name]:
            J = np.stack([np.asarray(slopes[path][name][channel], float) for path in problem.free], axis=-1)
            variance = np.einsum("...i,ij,...j->...", J, sigma, J)
            found[name][channel] = np.sqrt(np.maximum(variance, 0.0))
    return found

"""Prediction bands: where measured values should lie, from the errors of the estimates and the noise.

The covariance of the estimates is carried into every channel by the Jacobian, var(y) = J Sigma J' (linear propagation
of errors). A measured value scatters about that by the noise, widened as the standard errors are; the half-width is
Student's quantile with the residuals' degrees of freedom where the noise's level came from them, the normal one else.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from tissuejax.estimation.covariance import Uncertainty
from tissuejax.estimation.problem import Problem
from tissuejax.recordings.marker_motion import ways
from tissuejax.recordings.recording import Recording

Std = dict[str, dict[str, Float[np.ndarray, "n ..."]]]


def prediction_std(problem: Problem, values: Mapping[str, float], spread: Uncertainty, names: tuple[str, ...]) -> Std:
    """Standard deviation of the predicted (noise-free) curve, sqrt(diag(J Sigma J')), by recording and channel, SI.

    Linear in the parameters around the estimate. Combinations that the data leave open to rounding have no share: their
    columns of J are zero where they were fitted.
    """
    return {
        name: {channel: carried(J, spread) for channel, J in channels.items()}
        for name, channels in _slopes(problem, values, names).items()
    }


def held_out_std(
    problem: Problem, values: Mapping[str, float], spread: Uncertainty, predicted: Mapping[str, Recording]
) -> Std:
    """The same of probings that took no part in the fit, at one further Jacobian; of markers as in `marker_std`.

    Args:
        predicted: these recordings by name, at `values`.
    """
    found: Std = {}
    for name, channels in _slopes(problem, values, tuple(predicted)).items():
        for channel, J in channels.items():
            places = np.asarray(predicted[name].channels[channel].values, float)
            if places.ndim == 3:
                seen = np.isfinite(np.asarray(problem.predictor.sample.recordings[name].channels[channel].values))
                J = _mean_way(np.where(seen[..., None], J, np.nan), places)
            found.setdefault(name, {})[channel] = carried(J, spread)
    return found


def _slopes(problem: Problem, values: Mapping[str, float], names: tuple[str, ...]) -> Std:
    """Derivatives to the free parameters along a last axis, by recording and channel."""
    _, slopes = problem.predictor.of(names).jacobian(dict(values), problem.free)
    return {
        name: {
            channel: np.stack([np.asarray(slopes[p][name][channel], float) for p in problem.free], -1)
            for channel in slopes[problem.free[0]][name]
        }
        for name in names
    }


def fitted_std(problem: Problem, jacobian: Float[np.ndarray, "n p"], spread: Uncertainty) -> Std:
    """The same of the fitted recordings from the Jacobian of the residuals, at no further simulation.

    Args:
        jacobian: of `problem.residuals`, rows of priors included; lost samples have none and are NaN.
    """
    found: Std = {}
    for key, rows in problem.rows.items():
        recording, channel = key
        std = np.full(np.shape(problem.predictor.sample.recordings[recording].channels[channel].values), np.nan)
        std.flat[problem.seen[key]] = carried(jacobian[rows], spread) * problem.sigma(key)
        found.setdefault(recording, {})[channel] = std
    return found


def marker_std(problem: Problem, jacobian: Float[np.ndarray, "n p"], spread: Uncertainty, predicted: Mapping) -> Std:
    """The same of the mean displacement of the markers that a picture shows: each along its own predicted way.

    Args:
        jacobian: of `problem.residuals`, as for `fitted_std`.
        predicted: recordings by name.
    """
    found: Std = {}
    for key, rows in problem.rows.items():
        places = np.asarray(predicted[key[0]].channels[key[1]].values, float)
        if places.ndim < 3:
            continue
        J = np.full((places.size, jacobian.shape[1]), np.nan)
        J[problem.seen[key]] = jacobian[rows] * problem.sigma(key)
        mean = _mean_way(J.reshape(*places.shape, -1), places)
        found.setdefault(key[0], {})[key[1]] = carried(mean, spread)
    return found


def _mean_way(J: Float[np.ndarray, "n m 3 p"], places: Float[np.ndarray, "n m 3"]) -> Float[np.ndarray, "n p"]:
    """Derivatives of the markers' mean way from those of their places, lost ones (NaN) left out."""
    moved = np.einsum("nmip,mi->nmp", J, ways(places))
    seen = np.isfinite(moved).all(-1, keepdims=True)
    return np.where(seen, moved, 0.0).sum(1) / np.maximum(seen.sum(1), 1)


def carried(J: Float[np.ndarray, "... p"], spread: Uncertainty) -> Float[np.ndarray, "..."]:
    """sqrt(diag(J Sigma J'))."""
    sigma = np.where(np.isfinite(spread.covariance), spread.covariance, 0.0)
    return np.sqrt(np.maximum(np.einsum("...i,ij,...j->...", J, sigma, J), 0.0))


def half_width(
    std: Float[np.ndarray, "..."], noise: float | None, spread: Uncertainty, confidence: float = 0.95
) -> Float[np.ndarray, "..."]:
    """Half the width of the band of a measured value: quantile * sqrt(std^2 + (widening * noise)^2)."""
    return spread.quantile(confidence) * np.sqrt(np.square(std) + (spread.widening * (noise or 0.0)) ** 2)

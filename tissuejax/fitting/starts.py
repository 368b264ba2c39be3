"""Where fits start: moduli scaled to the data, then a few seeded variations of everything."""

from collections.abc import Iterator, Mapping

import numpy as np

from tissuejax.fitting.problem import Problem

SPREAD = 0.7  # standard deviation of the logarithm (or share of the scale) by which further starts vary


def scaled_to_data(problem: Problem) -> dict[str, float]:
    """The start with all free moduli (unit Pa) multiplied by the one factor that fits the data best.

    Stress is linear in the moduli of most energies, so one evaluation brings any default to the right order of
    magnitude.
    """
    values = {path: float(v) for path, v in problem.start.items()}
    declared = problem.predictor.model.parameters
    moduli = [path for path in problem.free if declared[path].unit == "Pa" and path not in problem.priors]
    if not moduli:
        return values
    for _ in range(2):
        rest = np.concatenate([problem.measured[key][kept] / problem.sigma(key) for key, kept in problem.seen.items()])
        misfit = problem.residuals(values)[: problem.n_samples]
        predicted = misfit + rest
        norm = float(predicted @ predicted)
        factor = float(predicted @ rest) / norm if norm > 0 and np.isfinite(norm) else 0.0
        if not np.isfinite(factor) or factor <= 0:
            return values
        for path in moduli:
            lower, upper = problem.bound(path)
            values[path] = float(np.clip(values[path] * factor, lower, upper))
        if 0.5 < factor < 2:
            break
    return values


def variations(problem: Problem, first: Mapping[str, float], n: int, seed: int) -> Iterator[dict[str, float]]:
    """`n` starts around `first`: signs kept, magnitudes varied; parameters at zero drawn from their typical range."""
    rng = np.random.default_rng(seed)
    declared = problem.predictor.model.parameters
    for _ in range(n):
        values = dict(first)
        for path in problem.free:
            lower, upper = problem.bound(path)
            value = values[path]
            if abs(value) > 1e-6 * declared[path].typical:
                value = value * float(np.exp(SPREAD * rng.normal()))
            else:
                value = declared[path].typical * SPREAD * float(rng.normal())
            if np.isfinite(upper - lower) and not lower < value < upper:
                value = lower + (upper - lower) * float(rng.uniform(0.02, 0.98))
            values[path] = float(np.clip(value, lower, upper))
        yield values

"""Where fits start: moduli solved for, then a few seeded variations of everything."""

from collections.abc import Iterator, Mapping

import numpy as np
from scipy.optimize import lsq_linear

from tissuejax.estimation.problem import Problem
from tissuejax.fitting.separable import separable

LEAST = 1e-3  # share of the data that a modulus accounts for at least, at the start
SPREAD = 0.7  # standard deviation of the logarithm (or share of the scale) by which further starts vary


def fitted_moduli(problem: Problem, values: Mapping[str, float]) -> dict[str, float]:
    """`values` with the free moduli at the linear least-squares solution for all other parameters as they are.

    Stress is linear in the moduli of most energies, so one evaluation brings any start near. Signs are kept (each
    modulus that comes out as zero stays at a thousandth of its share of the data), which keeps terms apart. The start
    itself is returned if the prediction is not finite or the misfit grows, as it may where stress is not linear.
    """
    values = {path: float(v) for path, v in values.items()}
    moduli = [path for path in problem.moduli if path not in problem.priors]
    if not moduli:
        return values
    r, jacobian = problem.linearised(values)
    columns = jacobian[: problem.n_samples, [problem.free.index(path) for path in moduli]]
    r = r[: problem.n_samples]
    size = np.linalg.norm(columns, axis=0)
    if not (np.isfinite(r).all() and np.isfinite(columns).all() and (size > 0).all()):
        return values
    now = np.array([values[path] for path in moduli])
    target = columns @ now - r
    ends = [problem.bound(path) for path in moduli]
    low = np.array([max(a, 0.0) if x > 0 else a for x, (a, _) in zip(now, ends, strict=True)])
    high = np.array([min(b, 0.0) if x < 0 else b for x, (_, b) in zip(now, ends, strict=True)])
    solved = lsq_linear(columns / size, target, (low * size, high * size)).x / size
    least = LEAST * np.linalg.norm(target) / size
    solved = np.where(np.abs(solved) > least, solved, np.where(now < 0, -least, np.where(now > 0, least, solved)))
    trial = values | {path: float(np.clip(x, *problem.bound(path))) for path, x in zip(moduli, solved, strict=True)}
    after = problem.residuals(trial)[: problem.n_samples]
    return trial if float(after @ after) < float(r @ r) else values


def neutral(problem: Problem) -> list[tuple[str, ...]]:
    """Sets of effects to leave at neutral in a first descent, so that no larger model ends worse than one inside it.

    All of them, then each but one where there are several.
    """
    found = {}
    for effect in problem.predictor.model.effects:
        paths = tuple(p for p in problem.free if p.startswith(f"effects.{effect.name}."))
        if paths and all(problem.start[f"effects.{effect.name}.{a}"] == 0 for a in _amplitudes(problem, effect)):
            found[effect.name] = paths
    every = tuple(p for paths in found.values() for p in paths)
    if not every or len(every) == len(problem.free):
        return []
    singles = [tuple(p for p in every if p not in paths) for paths in found.values()] if len(found) > 1 else []
    return [every, *singles]


def _amplitudes(problem: Problem, effect) -> list[str]:
    known = {path.removeprefix(f"effects.{effect.name}.") for path in problem.start}
    return [a for a in effect.amplitudes if a in known]


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
        yield values if separable(problem) else fitted_moduli(problem, values)

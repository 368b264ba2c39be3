"""Full refits: all base parameters, amplitudes and shapes of a set of candidates together, within bounds.

Levenberg-Marquardt whose every step is a small bounded linear least-squares problem, so that one-sided
amplitudes rest on their bound exactly and leave it when the data want them to. Positive shapes move in logarithm.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import lsq_linear

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.misfit import Misfit


@dataclass(frozen=True)
class Refit:
    """A fit of a set of candidates.

    Attributes:
        keys: candidates in the set, in the order in which they were added.
        values: free paths and their values.
        std: standard errors (natural coordinates); nan on a bound or where nothing is identified.
        at_bound: paths that rest on a bound.
        chi2: whitened chi-square of the fitted recordings (without priors), n its number of samples.
        held: whitened chi-square of the held-out recordings, n_held its number of samples.
        evaluations: predictions and Jacobians spent.
        prediction: the long vector.
    """

    keys: tuple[str, ...]
    values: dict[str, float]
    std: dict[str, float]
    at_bound: tuple[str, ...]
    chi2: float
    n: int
    held: float
    n_held: int
    evaluations: int
    converged: bool
    prediction: Float[np.ndarray, " N"]

    @property
    def k(self) -> int:
        """Number of free parameters."""
        return len(self.values)


def _to(x: float, log: bool) -> float:
    return float(np.log(x)) if log else x


def refit(
    bench: Bench,
    misfit: Misfit,
    keys: Sequence[str],
    start: Mapping[str, float],
    *,
    iterations: int = 30,
    tolerance: float = 0.02,
) -> Refit:
    """Fit base and candidates `keys` from `start` (absent paths start at the bench's neutral values).

    Stops when a step lowers the objective by less than `tolerance` (chi-square units) twice.
    """
    paths = tuple(dict.fromkeys([*bench.base, *(p for key in keys for p in bench.candidates[key].paths)]))
    log = np.array([bench.free[p].log for p in paths])
    low = np.array([_to(bench.free[p].lower, bench.free[p].log) for p in paths])
    high = np.array([_to(bench.free[p].upper, bench.free[p].log) for p in paths])
    scale = np.array([1.0 if bench.free[p].log else bench.free[p].scale for p in paths])
    priors = [(i, *bench.free[p].prior) for i, p in enumerate(paths) if bench.free[p].prior is not None]
    whole = {**bench.start, **start}
    x = np.clip(np.array([_to(whole[p], bench.free[p].log) for p in paths]), low, high)

    def natural(x: np.ndarray) -> np.ndarray:
        return np.where(log, np.exp(np.where(log, x, 0.0)), x)

    def objective(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        prediction = bench.predict(dict(zip(paths, natural(x).tolist())))
        r = misfit.residual(prediction, bench.fitted)
        if not np.all(np.isfinite(r)):
            return np.inf, r, prediction
        extra = [(m - x[i]) / s for i, m, s in priors]
        r = np.concatenate([r, extra]) if extra else r
        return float(r @ r), r, prediction

    cost, r, prediction = objective(x)
    evaluations, damping, small, converged = 1, 1e-3, 0, False
    jac = None
    for _ in range(iterations):
        if not np.isfinite(cost):
            break
        jac = _jacobian(bench, misfit, paths, x, natural, log, priors)
        evaluations += 1
        if not np.all(np.isfinite(jac)):
            break
        q, t = np.linalg.qr(jac)
        qr = q.T @ r
        diagonal = np.maximum(np.linalg.norm(jac, axis=0), 1e-12 * np.max(np.linalg.norm(jac, axis=0)) + 1e-300)
        accepted = False
        for _ in range(8):
            a = np.vstack([t, np.diag(np.sqrt(damping) * np.maximum(diagonal, 1e-6 / scale))])
            step = _bounded(a, np.concatenate([qr, np.zeros(len(x))]), low - x, high - x)
            trial = np.clip(x + step, low, high)
            new, r_new, p_new = objective(trial)
            evaluations += 1
            if new < cost:
                accepted = True
                break
            damping = max(damping * 8, 1e-6)
            if np.max(np.abs(step) / np.maximum(scale, np.abs(x))) < 1e-9:
                break
        if not accepted:
            converged = True
            break
        drop, cost, x, r, prediction = cost - new, new, trial, r_new, p_new
        damping = max(damping / 10, 1e-9)
        small = small + 1 if drop < tolerance else 0
        if small >= 2 or drop < 1e-3 * tolerance:
            converged = True
            break
    return _finish(
        bench, misfit, tuple(keys), paths, x, natural, log, (low, high), cost, prediction, evaluations, converged
    )


def _bounded(a: np.ndarray, b: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """min |a s - b| with low <= s <= high; the free solution where it is allowed."""
    step = np.linalg.lstsq(a, b, rcond=None)[0]
    if np.all(step >= low) and np.all(step <= high):
        return step
    size = np.linalg.norm(a, axis=0)
    answer = lsq_linear(a / size, b, (low * size, np.maximum(high, low + 1e-12) * size), method="bvls", max_iter=50)
    return answer.x / size


def _jacobian(bench, misfit, paths, x, natural, log, priors) -> np.ndarray:
    values = natural(x)
    jac = bench.jacobian(dict(zip(paths, values.tolist())), paths)
    jac = misfit.whiten(jac * np.where(log, values, 1.0), bench.fitted)
    if priors:
        rows = np.zeros((len(priors), len(paths)))
        for row, (i, _, s) in zip(rows, priors):
            row[i] = 1 / s
        jac = np.concatenate([jac, rows])
    return jac


def _finish(bench, misfit, keys, paths, x, natural, log, bounds, cost, prediction, evaluations, converged) -> Refit:
    values = natural(x)
    low, high = bounds
    span = np.where(np.isfinite(high - low), high - low, 1.0)
    at = (x - low < 1e-6 * span) | (high - x < 1e-6 * span)
    std = np.full(len(x), np.nan)
    r = misfit.residual(prediction, bench.fitted)
    if np.isfinite(cost):
        jac = misfit.whiten(bench.jacobian(dict(zip(paths, values.tolist())), paths), bench.fitted)
        norms = np.linalg.norm(jac, axis=0)
        use = ~at & (norms > 0) & np.isfinite(norms)
        if use.any():
            _, s, v = np.linalg.svd(jac[:, use] / norms[use], full_matrices=False)
            if s[-1] > 1e-7 * s[0]:
                inflate = max(1.0, float(r @ r) / max(len(r) - len(x), 1))
                std[use] = np.sqrt(inflate * np.sum((v.T / s) ** 2, axis=1)) / norms[use]
    held = misfit.residual(prediction, bench.held_out)
    return Refit(
        keys,
        dict(zip(paths, values.tolist())),
        dict(zip(paths, std.tolist())),
        tuple(p for p, b in zip(paths, at) if b),
        float(r @ r) if np.all(np.isfinite(r)) else np.inf,
        len(r),
        float(held @ held) if np.all(np.isfinite(held)) else np.inf,
        len(held),
        evaluations,
        converged,
        prediction,
    )

"""The evidence of a model: tempered sampling from the prior to the posterior (sequential Monte Carlo).

ln Z = ln of the integral of likelihood times prior, by the product of mean incremental weights over a ladder of powers
of the likelihood that keeps half the particles effective; between rungs every particle makes random-walk Metropolis
steps with the particles' own covariance. Source: Del Moral, Doucet and Jasra 2006, J. R. Stat. Soc. B 68; Neal 2001.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError
from tissuejax.estimation.problem import Problem
from tissuejax.fitting.target import Target

MOST_PARAMETERS = 10  # parameters
STEPS = 12  # Metropolis steps on a rung


@dataclass(frozen=True)
class Evidence:
    """What tempered sampling tells.

    Attributes:
        log_evidence: ln Z with the constants of a normal likelihood.
        std: its spread over repeated runs.
        rungs: of the ladder, in the first run.
        draws: (runs, particles, p) draws of the free parameters from the posterior, SI.
    """

    log_evidence: float
    std: float
    rungs: int
    draws: Float[np.ndarray, "r n p"]


def refuse_improper(problem: Problem) -> None:
    """Refuse a problem that has no evidence, before anything is fitted.

    Raises:
        InputError: a parameter without prior whose bounds are not both finite, or more than ten parameters.
    """
    if len(problem.free) > MOST_PARAMETERS:
        raise InputError(
            f"{len(problem.free)} free parameters; evidence is computed for at most {MOST_PARAMETERS}: fix some"
        )
    bad = [p for p in problem.free if p not in problem.priors and not np.isfinite(np.ptp(problem.bound(p)))]
    if bad:
        raise InputError(f"evidence needs proper priors: give {', '.join(bad)} a --prior, or both --bounds")


def evidence(target: Target, particles: int = 500, runs: int = 4, seed: int = 0) -> Evidence:
    """The evidence under proper priors: normal where one was given (cut at the bounds), else flat between the bounds.

    Raises:
        InputError: a parameter without prior whose bounds are not both finite, or more than ten parameters.
    """
    problem = target.problem
    refuse_improper(problem)
    lower, upper = (np.array([problem.bound(p)[k] for p in problem.free]) for k in (0, 1))
    sigma = target._sigma
    constant = -float(np.sum(np.log(sigma))) - 0.5 * len(sigma) * math.log(2 * math.pi)

    def likelihood(x):
        """Nothing is likely where a law has no stress."""
        told = np.asarray(target.likelihoods(x, target.data))
        return np.where(np.isnan(told), -np.inf, told)

    def prior(x):
        """ln of the normal priors, unnormalised; they are part of log_likelihood and taken out there."""
        total = np.zeros(len(x))
        for i, path in enumerate(problem.free):
            if path in problem.priors:
                mean, std = problem.priors[path]
                total -= 0.5 * ((x[:, i] - mean) / std) ** 2
        return total

    ends = [
        _run(np.random.default_rng(seed + k), problem, lower, upper, likelihood, prior, particles) for k in range(runs)
    ]
    found = np.array([e[0] for e in ends]) + constant
    spread = float(found.std(ddof=1)) if runs > 1 else math.nan
    return Evidence(float(found.mean()), spread, ends[0][1], np.stack([e[2] for e in ends]))


def _run(rng, problem, lower, upper, likelihood, prior, n: int) -> tuple[float, int, np.ndarray]:
    x = _draw(rng, problem, lower, upper, n)
    ll = np.asarray(likelihood(x)) - prior(x)
    power, log_z, rungs = 0.0, 0.0, 0
    while power < 1.0:
        nxt = _next(ll, power)
        w = (nxt - power) * ll
        top = w.max()
        log_z += top + math.log(np.mean(np.exp(w - top)))
        share = np.exp(w - top)
        x = x[_systematic(rng, share / share.sum())]
        power, rungs = nxt, rungs + 1
        ll, lp = np.asarray(likelihood(x)), prior(x)
        ll = ll - lp
        spread = np.atleast_2d(np.cov(x.T)) + 1e-18 * np.diag(np.var(x, axis=0) + 1e-30)
        root, scale = np.linalg.cholesky(spread + 1e-12 * np.diag(np.diag(spread))), 2.38 / math.sqrt(x.shape[1])
        for _ in range(STEPS):
            new = x + scale * rng.normal(size=x.shape) @ root.T
            inside = ((new >= lower) & (new <= upper)).all(1)
            lp_new = prior(new)
            ll_new = np.asarray(likelihood(np.where(inside[:, None], new, x))) - np.where(inside, lp_new, lp)
            accept = inside & (np.log(rng.uniform(size=n)) < power * (ll_new - ll) + lp_new - lp)
            x, ll, lp = np.where(accept[:, None], new, x), np.where(accept, ll_new, ll), np.where(accept, lp_new, lp)
            scale *= math.exp(0.5 * (accept.mean() - 0.3))
    return log_z, rungs, x


def _draw(rng, problem, lower, upper, n: int):
    columns = []
    for path, a, b in zip(problem.free, lower, upper):
        if path not in problem.priors:
            columns.append(rng.uniform(a, b, n))
            continue
        mean, std = problem.priors[path]
        x = rng.normal(mean, std, n)
        while (out := (x < a) | (x > b)).any():
            x[out] = rng.normal(mean, std, out.sum())
        columns.append(x)
    return np.stack(columns, 1)


def _next(ll, power: float) -> float:
    """The largest next power that keeps half the particles effective, by bisection."""

    def effective(p: float) -> float:
        w = np.exp((p - power) * (ll - ll.max()))
        return w.sum() ** 2 / (w @ w) / len(w)

    if effective(1.0) >= 0.5:
        return 1.0
    low, high = power, 1.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if effective(middle) >= 0.5 else (low, middle)
    return high if low == power else low


def _systematic(rng, weights):
    places = (rng.uniform() + np.arange(len(weights))) / len(weights)
    return np.minimum(np.searchsorted(np.cumsum(weights), places), len(weights) - 1)

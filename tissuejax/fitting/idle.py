"""Terms of a series that are idle, woken at the time where they promise most.

A relaxation term whose share is zero has no slope in its time, so no step brings it to where it would be needed: a
whole step of the share at another time may lead into a corner of its box, where a descent stays. Two terms at one time
are one. The misfit's gain is foretold for times all over the allowed range by one linear step of the share beside
everything else that is free (the score test), and a descent begins, or goes on, from the best.

Source: Rao 1948, Proc. Camb. Phil. Soc. 44:50 (score test).
"""

from collections.abc import Mapping

import numpy as np

from tissuejax.estimation.problem import Problem

IDLE = 1e-3  # share of the whole below which a term is idle
ALIKE = 0.05  # difference of two logarithms of times below which the terms are one
TIMES = 9  # at which a share is scored
WAKING = (0.01, 0.3)  # least and greatest share with which a term is woken


def terms(problem: Problem, least: int = 2) -> list[list[tuple[str, str]]]:
    """(share, time) of all terms of each effect that has at `least` so many of them, both free in the fit."""
    found = []
    for effect in problem.predictor.model.effects:
        pairs = [
            (f"effects.{effect.name}.{share}", f"effects.{effect.name}.{time}")
            for share, time in zip(getattr(effect, "shares", ()), getattr(effect, "times", ()))
        ]
        free = [pair for pair in pairs if set(pair) <= set(problem.free)]
        if len(free) >= least:
            found.append(free)
    return found


def merged(problem: Problem, values: Mapping[str, float]) -> tuple[dict[str, float], list[tuple[str, str]]]:
    """The same prediction with terms at one time put together, and the terms that are idle."""
    values, idle = dict(values), []
    for series in terms(problem):
        for k, (share, time) in enumerate(series):
            for other_share, other_time in series[:k]:
                same = abs(np.log(values[time] / values[other_time])) < ALIKE
                if same and min(values[share], values[other_share]) > 0:
                    values[other_share] += values[share]
                    values[share] = 0.0
        idle += [(share, time) for share, time in series if values[share] < IDLE]
    return values, idle


def woken(problem: Problem, values: Mapping[str, float]) -> dict[str, float] | None:
    """Values with one idle term at the time where it promises most; None where no term is idle or none would help."""
    values, idle = merged(problem, values)
    if not idle:
        return None
    share, time = idle[0]
    found = _promising(problem, values, share, time, {path for pair in idle for path in pair})
    return None if found is None else values | found


def roused(problem: Problem, values: Mapping[str, float], told: frozenset[str] = frozenset()) -> dict[str, float]:
    """Values with each series whose shares are all zero begun at the time that promises most, by the term next to it.

    Series that would not help, have priors or are `told` (their parameters are among these) stay as they are.
    """
    values = dict(values)
    for series in terms(problem, least=1):
        paths = {path for pair in series for path in pair}
        if any(values[share] != 0 for share, _ in series) or paths & {*told, *problem.priors}:
            continue
        found = _promising(problem, values, *series[0], paths)
        if found is not None:
            step, t = (found[path] for path in series[0])
            share, time = min(series, key=lambda pair: abs(np.log(values[pair[1]] / t)))
            values |= {share: step, time: t}
    return values


def _promising(
    problem: Problem, values: Mapping[str, float], share: str, time: str, apart: set[str]
) -> dict[str, float] | None:
    """Share and time of one term where it promises most, beside all that is free but what is set `apart`."""
    lower, upper = problem.bound(time)
    best, found = 0.0, None
    others = [i for i, path in enumerate(problem.free) if path not in apart]
    for t in np.geomspace(max(lower, 1e-9 * upper), upper, TIMES + 2)[1:-1]:
        r, jacobian = problem.linearised({**values, share: 0.0, time: float(t)})
        if not (np.isfinite(r).all() and np.isfinite(jacobian).all()):
            continue
        rest = jacobian[:, others]
        size = np.linalg.norm(rest, axis=0)
        u, s, _ = np.linalg.svd(rest[:, size > 0] / size[size > 0], full_matrices=False)
        u = u[:, s > 1e-10 * s[:1]]
        column = jacobian[:, problem.free.index(share)]
        column = column - u @ (u.T @ column)
        downhill, length = -float(column @ r), float(column @ column)
        if length > 0 and downhill > 0 and downhill**2 / length > best:
            best = downhill**2 / length
            found = {share: float(np.clip(downhill / length, *WAKING)), time: float(t)}
    return found

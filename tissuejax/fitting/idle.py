"""Terms of a series that are idle, woken at the time where they promise most.

A relaxation term whose share is zero has no slope in its time, so no step brings it to where it would be needed: a
whole step of the share at another time may lead into a corner of its box, where a descent stays. Two terms at one time
are one. The misfit's gain is foretold for times all over the allowed range by one linear step of the share beside
everything else that is free (the score test), and a descent begins, or goes on, from the best. A modulus that a descent
left at zero is such a term too, its shapes in place of the time.

Source: Rao 1948, Proc. Camb. Phil. Soc. 44:50 (score test).
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from tissuejax.estimation.problem import Problem

IDLE = 1e-3  # share of the whole below which a term is idle
ALIKE = 0.05  # difference of two logarithms of times below which the terms are one
TIMES = 9  # at which a share is scored
SHAPES = 64  # points at which the shapes of an idle modulus are scored
DECADES = (0.1, 100.0)  # of a shape without a far end, over its typical value
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


def woken_modulus(problem: Problem, values: Mapping[str, float]) -> dict[str, float] | None:
    """Values with a modulus of the energy that a descent left at zero woken where its shapes promise most.

    Fibres that carry nothing have no slope in their direction, dispersion or stiffening: a corner like that of an idle
    relaxation. None where no modulus is at zero, none has such shapes, or none would help.
    """
    for modulus in problem.moduli:
        lower, _ = problem.bound(modulus)
        if lower != 0 or values[modulus] > IDLE * problem.predictor.model.parameters[modulus].typical:
            continue
        at = {**values, modulus: 0.0}
        _, jacobian = problem.linearised(at)
        shapes = [p for i, p in enumerate(problem.free) if p.startswith("energy.") and not jacobian[:, i].any()]
        if not shapes or not np.isfinite(jacobian).all():
            continue
        found = _scored(problem, at, modulus, _drawn(problem, shapes), {modulus, *shapes})
        if found is not None:
            step, shape = found
            return at | shape | {modulus: step}
    return None


def _drawn(problem: Problem, shapes: Sequence[str]) -> list[dict[str, float]]:
    """Points all over the range of some shapes: of one without a far end, decades about its typical value."""
    from scipy.stats import qmc

    points = qmc.Sobol(len(shapes), rng=0).random(SHAPES)
    found = []
    for point in points:
        one = {}
        for u, path in zip(point, shapes, strict=True):
            lower, upper = problem.bound(path)
            typical = problem.predictor.model.parameters[path].typical
            wide = not np.isfinite(upper - lower) or upper > DECADES[1] * typical
            x = typical * 10 ** (np.log10(DECADES[0]) + u * np.log10(DECADES[1] / DECADES[0])) if wide else 0.0
            one[path] = float(np.clip(x, lower, upper)) if wide else float(lower + u * (upper - lower))
        found.append(one)
    return found


def _promising(
    problem: Problem, values: Mapping[str, float], share: str, time: str, apart: set[str]
) -> dict[str, float] | None:
    """Share and time of one term where it promises most, beside all that is free but what is set `apart`."""
    lower, upper = problem.bound(time)
    times = [{time: float(t)} for t in np.geomspace(max(lower, 1e-9 * upper), upper, TIMES + 2)[1:-1]]
    found = _scored(problem, {**values, share: 0.0}, share, times, apart)
    return None if found is None else {share: float(np.clip(found[0], *WAKING)), **found[1]}


def _scored(
    problem: Problem,
    values: Mapping[str, float],
    amplitude: str,
    candidates: Iterable[dict[str, float]],
    apart: set[str],
) -> tuple[float, dict[str, float]] | None:
    """The linear step of an amplitude at zero, and the candidate at which it takes most of the misfit."""
    best, found = 0.0, None
    others = [i for i, path in enumerate(problem.free) if path not in apart]
    for candidate in candidates:
        r, jacobian = problem.linearised({**values, **candidate})
        if not (np.isfinite(r).all() and np.isfinite(jacobian).all()):
            continue
        rest = jacobian[:, others]
        size = np.linalg.norm(rest, axis=0)
        u, s, _ = np.linalg.svd(rest[:, size > 0] / size[size > 0], full_matrices=False)
        u = u[:, s > 1e-10 * s[:1]]
        column = jacobian[:, problem.free.index(amplitude)]
        column = column - u @ (u.T @ column)
        downhill, length = -float(column @ r), float(column @ column)
        if length > 0 and downhill > 0 and downhill**2 / length > best:
            best = downhill**2 / length
            found = downhill / length, candidate
    return found

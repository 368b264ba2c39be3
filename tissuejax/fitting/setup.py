"""From what a user says (which recordings, what is fixed, bounds, priors) to a checked problem."""

from dataclasses import replace

from tissuejax.errors import InputError, unknown
from tissuejax.estimation.problem import Problem
from tissuejax.estimation.transforms import checked_bounds
from tissuejax.estimation.weights import noise
from tissuejax.experiments.predictor import Predictor
from tissuejax.fitting.memory import spread, time_bounds
from tissuejax.fitting.options import Objective, Unknowns
from tissuejax.parameters import checked
from tissuejax.recordings.checks import distinct
from tissuejax.recordings.recording import Sample

STIFFNESS = 300.0  # an instability of 1 % of the mean stiffness costs as much as a misfit of 3 noise levels everywhere


def split(
    sample: Sample, only: tuple[str, ...] = (), holdout: tuple[str, ...] = ()
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the recordings to fit and to hold out, in file order.

    Args:
        sample: what was recorded.
        only: fit these (default: all that are not held out).
        holdout: predict these only.

    Raises:
        InputError: an unknown name, one listed twice or in both lists, two recordings with identical data, or nothing
            left to fit.
    """
    for kind, names in (("recording", only), ("recording to hold out", holdout)):
        for name in names:
            if name not in sample.recordings:
                raise unknown(kind, name, sample.recordings)
        if len(set(names)) < len(names):
            raise InputError(f"a {kind} is listed twice: {', '.join(names)}; list each once")
    both = sorted(set(only) & set(holdout))
    if both:
        raise InputError(f"{', '.join(both)}: to be fitted and held out at once; choose one")
    fitted = tuple(n for n in sample.recordings if (n in only if only else n not in holdout))
    if not fitted:
        raise InputError(f"nothing is left to fit: all of {', '.join(sample.recordings)} are held out")
    held = tuple(n for n in sample.recordings if n in holdout)
    distinct((n, sample.recordings[n]) for n in dict.fromkeys((*fitted, *held)))
    return fitted, held


def problem(
    predictor: Predictor,
    unknowns: Unknowns | None = None,
    objective: Objective | None = None,
) -> Problem:
    """A problem with everything that is not said taken from the declarations.

    Args:
        predictor: model, sample and the recordings that take part.
        unknowns: what is estimated, and within which limits.
        objective: what a unit of misfit means.

    Raises:
        InputError: unknown paths, values outside their range, empty bounds, too few samples.
    """
    unknowns, objective = unknowns or Unknowns(), objective or Objective()
    free, priors = unknowns.free, dict(unknowns.priors or {})
    declared = predictor.model.parameters
    fix, start, bounds = dict(unknowns.fix or {}), dict(unknowns.start or {}), dict(unknowns.bounds or {})
    checked(fix, declared)
    checked(start, declared)
    seen = {p: b for p, b in time_bounds(predictor).items() if p not in {*fix, *start, *bounds}}
    for path in (*bounds, *(free or ()), *priors):
        if path not in declared:
            raise unknown("parameter", path, declared)
    if free is None:
        named = {*start, *bounds, *priors}
        free = tuple(p for p, d in declared.items() if p not in fix and (not d.frozen or p in named))
    clash = sorted(set(free) & set(fix))
    if clash:
        raise InputError(f"{', '.join(clash)}: fixed and free at once; choose one")
    values = predictor.model.defaults | spread(seen) | start | fix
    bounds = seen | bounds
    for path, (lower, upper) in bounds.items():
        lower, upper = checked_bounds(path, lower, upper)
        if path not in start and path not in fix:
            values[path] = min(max(values[path], lower), upper)
    found = noise(predictor.sample, predictor.names, objective.weights, tuple(objective.channels))
    posed = Problem(predictor, tuple(free), values, found, bounds, priors, objective.loss)
    return replace(posed, stiffness=STIFFNESS * posed.n_samples**0.5) if unknowns.stable else posed

"""Which effects may join a set: the log evidence that a linear step of each would gain at the set's fit.

What moves a corner is scored by what it does as a whole too, at the sizes that the effect names: the slope at neutral
has its corner elsewhere, and where noise is small that is all that a discrepancy leaves to be seen.

It is scored under the noise and the discrepancy of that fit, and again under a discrepancy of its prior's size: a set
that has no name yet may have given its misfit to the discrepancy.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.bench import Bench, Candidate
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.judge import Beforehand
from tissuejax.diagnosis.judgement.scales import Scales, squared
from tissuejax.diagnosis.judgement.weigh import Weighed
from tissuejax.diagnosis.judgement.whitening import Whitening
from tissuejax.diagnosis.score import Score, complement, gain, trusted


def nominated(
    bench: Bench, scales: Scales, at: Weighed, left: Sequence[Candidate], criteria: Criteria, before: Beforehand
) -> list[Score]:
    """The candidates `left`, by the log evidence that a linear step of each gains beside the set `at`, best first."""
    values, prediction = at.refit.values, at.refit.prediction
    grids = [list(bench.settings(c, prediction)) for c in left]
    wanted = [(s, a) for c, grid in zip(left, grids, strict=True) for s in grid for a in c.amplitudes]
    if not wanted:
        return []
    columns = bench.columns(values, wanted)
    cornered = [(c, a, size) for c in left for a, sizes in c.corners.items() for size in sizes]
    if cornered:
        whole = [_whole(bench, values, prediction, a, size) for _, a, size in cornered]
        columns = np.column_stack([columns, *whole])
    jac = bench.jacobian(values, tuple(values), bench.fitted)
    usual = scales.priors(criteria).width ** 2
    found: dict[str, Score] = {}
    for v in (at.v, usual):
        whitening = Whitening(bench, scales.cut, scales.blocked, at.parts, v)
        basis = complement(whitening.whiten(jac, bench.fitted))
        r = whitening.residual(prediction, bench.fitted)
        r = r - basis @ (basis.T @ r)
        with np.errstate(over="ignore", invalid="ignore"):  # a column may be beyond all numbers: no trial of it
            white = whitening.whiten(columns, bench.fitted)
            white = white - basis @ (basis.T @ white)
        steps = [(c, c.amplitudes, s) for c, grid in zip(left, grids, strict=True) for s in grid]
        steps += [(c, (a,), {}) for c, a, _ in cornered]
        edges = np.cumsum([0, *(len(amplitudes) for _, amplitudes, _ in steps)])
        scored: dict[str, list[tuple]] = {c.key: [] for c in left}
        for (c, amplitudes, s), a, b in zip(steps, edges, edges[1:], strict=False):
            block, raw = white[:, a:b], columns[:, a:b]
            if np.isfinite(squared(block)) and np.isfinite(squared(raw)):
                origin = {**bench.start, **values, **s}
                worth, step, moved = _step(bench, scales, (c, amplitudes), origin, (r, block, raw), criteria)
                worth += math.log(before.odds[c.name] / before.forms[c.name])
                scored[c.key].append((worth, step, dict(s), moved))
        for c in left:
            trials = sorted(scored[c.key], key=lambda t: -t[0])
            if trials and (c.key not in found or trials[0][0] > found[c.key].gain):
                g, step, setting, moved = trials[0]
                size = float(np.linalg.norm(moved)) or 1.0
                share = float(min(max(2 * g / max(r @ r, 1e-9), 0.0), 1.0))
                found[c.key] = Score(c.key, g, share, step, setting, moved / size, tuple(t[:3] for t in trials))
    return sorted(found.values(), key=lambda s: -s.gain)


def _whole(
    bench: Bench, values: Mapping[str, float], prediction: Float[np.ndarray, " N"], path: str, size: float
) -> Float[np.ndarray, " N"]:
    """What an amplitude of that size changes, per unit of it."""
    return (bench.predict({**values, path: size}, bench.fitted) - prediction) / (size - bench.start[path])


def _step(
    bench: Bench,
    scales: Scales,
    of: tuple[Candidate, Sequence[str]],
    at: Mapping[str, float],
    white: tuple[Float[np.ndarray, " m"], Float[np.ndarray, "m k"], Float[np.ndarray, "N k"]],
    criteria: Criteria,
) -> tuple[float, dict[str, float], Float[np.ndarray, " m"]]:
    """Log evidence of the linear step, which is what it removes less what its amplitudes could have done; the step;
    and what it moves.

    Args:
        of: the candidate, and which of its amplitudes.
        at: where it begins; white: residual and columns, whitened, and the columns in Pa per unit.
    """
    (c, amplitudes), (r, block, raw) = of, white
    origin = np.array([at[a] for a in amplitudes])
    low, high = np.array([trusted(bench.free[a]) for a in amplitudes]).T
    g, step = gain(r, block, np.minimum(low - origin, 0.0), np.maximum(high - origin, 0.0))
    moved = np.sum(scales.cut.mean(raw) ** 2, axis=0)
    stress = float(np.sum(scales.reference**2))
    size = np.where(moved > 0, criteria.usual(c.rig) * np.sqrt(stress / np.where(moved > 0, moved, 1.0)), 0.0)
    h = (block * size).T @ (block * size)
    price = 0.5 * float(np.linalg.slogdet(np.eye(len(h)) + h)[1])
    return 0.5 * g - price, dict(zip(amplitudes, step.tolist(), strict=True)), block @ step

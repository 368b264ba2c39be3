"""Whether something happened at once that no smooth part of the discrepancy describes, and where.

At a fit, every moment is asked what a part that begins there would gain, its amplitude integrated over its prior (in
closed form, as `Marginal.along`). Where all moments together make it likelier than not that something happened, the
best of them comes into the discrepancy of every set, with the prior probability of that one: sets of effects then
compete with it, as they do with everything else that has no name.
"""

import copy
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.linalg import cho_solve
from scipy.special import logsumexp

from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Course
from tissuejax.diagnosis.judgement.marginal import Blocked, Linear, factored, smooth
from tissuejax.diagnosis.judgement.scales import Scales
from tissuejax.diagnosis.judgement.weigh import Start, Weighed, weigh
from tissuejax.estimation.discrepancy import Discrepancy, Part
from tissuejax.estimation.sudden import Moment

AMPLITUDES = np.geomspace(0.01, 4.0, 30)  # of what is usual where something happened


def happened(scales: Scales, at: Weighed, criteria: Criteria) -> Moment | None:
    """The likeliest moment, where something is likelier to have happened at once than not; beside the set `at`."""
    of = scales.discrepancy
    if not isinstance(of, Discrepancy) or of.timed is None or at.linear is None:
        return None
    if len(of.sudden) > len({s.recording for s in scales.bench.segments}):  # one in each, and one more
        return None
    moments, known = scanned(scales), {s.name for s in of.sudden}
    if not moments:
        return None
    prediction = scales.cut.mean(at.refit.prediction)
    factors = [p.factor(prediction, of.timed) for p in moments]
    odds = gains(scales.blocked, at.parts, at.v, at.linear, factors, criteria.sudden)
    odds += math.log(criteria.unknown / len(moments))
    odds[[p.name in known for p in moments]] = -math.inf
    if logsumexp(odds) < 0:
        return None
    return moments[int(np.argmax(odds))]


def disrupted(
    scales: Scales, base: Weighed, criteria: Criteria, course: Course | None = None
) -> tuple[Scales, Weighed]:
    """Scales and base with all that may have happened beside the base alone, one after the other."""
    while (moment := happened(scales, base, criteria)) is not None:
        scales = joined(scales, moment)
        base = weigh(scales, (), Start(base.refit.values, begun(base, criteria)), criteria, course)
        if not held(base, moment):
            break
    return scales, base


def held(w: Weighed, moment: Moment) -> bool:
    """Whether something happened there beside what was weighed."""
    return w.evidence.amplitudes.get(moment.name, 0.0) > 0


def begun(w: Weighed, criteria: Criteria) -> np.ndarray:
    """Squared amplitudes from which a set is weighed anew with one moment more."""
    return np.append(w.v, criteria.sudden**2)


def beside(w: Weighed, moment: Moment) -> Weighed:
    """What was weighed without this moment, as it is where nothing happened there."""
    if w.linear is None:
        return w
    part = Part(moment.name, "sudden", np.zeros((len(w.rest), 1)))
    evidence = replace(w.evidence, amplitudes={**w.evidence.amplitudes, moment.name: 0.0})
    return replace(w, evidence=evidence, v=np.append(w.v, 0.0), parts=(*w.parts, part))


def scanned(scales: Scales) -> list[Moment]:
    """All moments that are asked whether something happened then."""
    return scales.discrepancy.timed.moments(list(dict.fromkeys(s.recording for s in scales.bench.segments)))


def gains(
    blocked: Blocked,
    parts: Sequence[Part],
    v: Float[np.ndarray, " K"],
    linear: Linear,
    factors: Sequence[Float[np.ndarray, "N r"]],
    width: float,
) -> Float[np.ndarray, " P"]:
    """Log evidence that one part more gains, by its factor, its amplitude half-normal of this width."""
    inverse = [np.linalg.inv(b) for b in blocked.within(parts, v)]

    def solve(x: np.ndarray) -> np.ndarray:
        return np.concatenate([i @ x[rows] for i, rows in zip(inverse, blocked.rows, strict=True)])

    u = smooth(parts, v)
    w = np.concatenate([u, linear.jacobian], axis=1)
    prior = np.concatenate([np.ones(u.shape[1]), linear.weak])
    g = solve(w)
    m = w.T @ g + np.diag(prior)
    size = 1 / np.sqrt(np.maximum(np.diag(m), 1e-300))
    c = factored(m * np.outer(size, size))

    def projected(x: np.ndarray) -> np.ndarray:
        return solve(x) - g @ (size[:, None] * cho_solve(c, size[:, None] * (g.T @ x), check_finite=False))

    whole = np.concatenate(factors, axis=1)
    moved, left = projected(whole), projected(linear.residual[:, None])[:, 0]
    density = -0.5 * AMPLITUDES**2 + 0.5 * math.log(2 / math.pi) + np.log(AMPLITUDES)
    density += math.log(math.log(AMPLITUDES[1] / AMPLITUDES[0]))
    d, out, first = (width * AMPLITUDES) ** 2, [], 0
    for f in factors:
        columns = slice(first, first + f.shape[1])
        first += f.shape[1]
        values, turn = np.linalg.eigh(f.T @ moved[:, columns])
        grown = 1 + np.outer(d, np.maximum(values, 0.0))
        change = -0.5 * np.sum(np.log(grown), axis=1) + 0.5 * d * np.sum((turn.T @ (f.T @ left)) ** 2 / grown, axis=1)
        out.append(logsumexp(change + density))
    return np.array(out)


def joined(scales: Scales, moment: Moment) -> Scales:
    """The same scales with this moment in the discrepancy of every set."""
    made = copy.copy(scales)
    of = scales.discrepancy
    made.discrepancy = replace(of, sudden=(*of.sudden, moment))
    made.families = (*scales.families, "sudden")
    made.moments = len(scanned(scales))
    return made

"""Whether something happened at once that no smooth part of the discrepancy describes, and where.

At a fit, every moment is asked what a part that begins there would gain, its amplitude integrated over its prior (in
closed form, as `Marginal.along`), and the best of them whether a clock jumped there by more than its slope says. A
smooth part that is wide may have taken up what happened, and beside it a step is one of its steps: each is also asked
as if it were as usual, at what that costs. Where all moments together make it likelier than not that something
happened, the best of them comes into the discrepancy of every set, with the prior probability of that one: sets of
effects then compete with it, as they do with everything else that has no name.
"""

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.linalg import cho_solve
from scipy.special import logsumexp

from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.marginal import Blocked, Linear, factored, marginal, smooth
from tissuejax.diagnosis.judgement.scales import Scales
from tissuejax.diagnosis.judgement.weigh import Start, Weighed, weigh
from tissuejax.estimation.discrepancy import Discrepancy, Part
from tissuejax.estimation.sudden import Disturbed, Moment

AMPLITUDES = np.geomspace(0.01, 4.0, 30)  # of what is usual where something happened


@dataclass(frozen=True)
class Happening:
    """What may have happened at once.

    Attributes:
        moment: when, and what.
        instead: smooth parts, by place, that are no wider than usual beside it: they had taken it up.
    """

    moment: Moment
    instead: tuple[int, ...] = ()

    def start(self, scales: Scales, w: Weighed, criteria: Criteria) -> Float[np.ndarray, " K"]:
        """Squared amplitudes from which a set is weighed anew beside it; `scales` without it."""
        return np.append(narrowed(scales, w, criteria, self.instead), criteria.sudden**2)


def happened(scales: Scales, at: Weighed, criteria: Criteria) -> Happening | None:
    """The likeliest moment, where something is likelier to have happened at once than not; beside the set `at`."""
    of = scales.discrepancy
    if not isinstance(of, Discrepancy) or of.timed is None or at.linear is None:
        return None
    if len(of.sudden) > len({s.recording for s in scales.bench.segments}):  # one in each, and one more
        return None
    taken = {(m.recording, m.time) for m in of.sudden}
    moments = [m for m in of.timed.moments() if (m.recording, m.time) not in taken]
    if not moments:
        return None
    linear, timed = at.linear, of.timed
    disturbed = Disturbed(scales.cut.mean(at.refit.prediction), timed)
    widths = scales.priors(criteria, at.evidence.keys)

    def worth(v: Float[np.ndarray, " K"]) -> float:
        value = marginal(linear, at.parts, v, scales.blocked).value
        return value + float(np.sum(widths.log_shape(v / widths.width**2)))

    def odds(these: Sequence[Moment], v: Float[np.ndarray, " K"]) -> Float[np.ndarray, " P"]:
        factors = [p.factor(disturbed) for p in these]
        gained = gains(scales.blocked, at.parts, v, linear, factors, criteria.sudden)
        return gained + np.log(criteria.happens(len(of.sudden)) * np.array([p.chance for p in these]))

    wide = tuple(int(k) for k in np.flatnonzero(widths.wider(at.v) & scales.lasting))
    likeliest: dict[str, tuple[float, Happening]] = {}  # each moment once, beside what it is likeliest beside
    for instead in dict.fromkeys(((), *((k,) for k in wide), wide)):
        v = narrowed(scales, at, criteria, instead)
        cost = worth(v) - worth(at.v) if instead else 0.0
        found = list(zip(odds(moments, v), moments, strict=True))
        for finer in (timed.near, lambda m: m.jumping(timed)):
            best = sorted(found, key=lambda pair: -pair[0])[: timed.smooth.followed]
            more = {m.name: m for _, near in best for m in finer(near) if (m.recording, m.time) not in taken}
            found += zip(odds(tuple(more.values()), v), more.values(), strict=True) if more else ()
        for x, m in found:
            likely = (cost + float(x), Happening(m, instead))
            likeliest[m.name] = max(likeliest.get(m.name, likely), likely, key=lambda pair: pair[0])
    if logsumexp([x for x, _ in likeliest.values()]) < 0:
        return None
    return max(likeliest.values(), key=lambda pair: pair[0])[1]


def narrowed(scales: Scales, w: Weighed, criteria: Criteria, these: Sequence[int]) -> Float[np.ndarray, " K"]:
    """Squared amplitudes of a set with `these` parts no wider than usual."""
    v, usual = w.v.copy(), scales.priors(criteria, w.evidence.keys).width ** 2
    v[list(these)] = np.minimum(v, usual)[list(these)]
    return v


def disrupted(scales: Scales, base: Weighed, criteria: Criteria) -> tuple[Scales, Weighed]:
    """Scales and base with all that may have happened beside the base alone, one after the other."""
    while (happening := happened(scales, base, criteria)) is not None:
        start = Start(base.refit.values, happening.start(scales, base, criteria))
        scales = joined(scales, happening.moment)
        base = weigh(scales, (), start, criteria)
        if not held(base, happening.moment):
            break
    return scales, base


def held(w: Weighed, moment: Moment) -> bool:
    """Whether something happened there beside what was weighed."""
    return w.evidence.amplitudes.get(moment.name, 0.0) > 0


def beside(w: Weighed, moment: Moment) -> Weighed:
    """What was weighed without this moment, as it is where nothing happened there."""
    if w.linear is None:
        return w
    part = Part(moment.name, "sudden", np.zeros((len(w.rest), 1)))
    evidence = replace(w.evidence, amplitudes={**w.evidence.amplitudes, moment.name: 0.0})
    return replace(w, evidence=evidence, v=np.append(w.v, 0.0), parts=(*w.parts, part))


def known_moments(of: Discrepancy) -> dict[str, Moment]:
    """All moments that may be found, by name."""
    timed = of.timed
    return {} if timed is None else {n.name: n for m in timed.moments(every=1) for n in (m, *m.jumping(timed))}


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
    made.moments = (*scales.moments, moment.chance)
    return made

"""What weighing needs of a sample beside the bench, and the priors of everything that a set of effects frees."""

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from jaxtyping import Bool, Float

from tissuejax.diagnosis.bench import Bench, Candidate, Free
from tissuejax.diagnosis.judgement.blocks import Blocks
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.marginal import Blocked, Widths
from tissuejax.diagnosis.judgement.ranges import between
from tissuejax.estimation.discrepancy import Discrepancy, Done, Part

CLOCKED = ("s", "1/s")  # units of parameters by which a law knows time
BEFORE = ("zero", "clock")  # families of what was set before a recording began
SINGULAR = 1e-6  # of the largest: a direction in which constants of the base do less than that is none of its own


@dataclass
class Scales:
    """What weighing needs of a sample beside the bench; the same for all sets.

    Attributes:
        bench: with all recordings fitted.
        discrepancy: its parts, about any prediction.
        families: of the parts, in order.
        cut, blocked: block means and their noise.
        values: the base fit, where the sizes of effects are taken.
        reference: the stress that it predicts, block means, Pa.
        peak: the largest stress, Pa.
        size: against which the rest is measured, by block: the peak, or what noise makes of it (`Criteria.unseen`).
        moments: probability of each that is in the discrepancy, if something happened at once.
    """

    bench: Bench
    discrepancy: Discrepancy
    families: tuple[str, ...]
    cut: Blocks
    blocked: Blocked
    values: Mapping[str, float]
    reference: Float[np.ndarray, " M"]
    peak: float
    size: Float[np.ndarray, " M"] | None = None
    moments: tuple[float, ...] = ()

    def about(
        self,
        prediction: Float[np.ndarray, " N"],
        bench: Bench,
        keys: Sequence[str] = (),
        values: Mapping[str, float] = MappingProxyType({}),
        slopes: Float[np.ndarray, "M p"] | None = None,
        base: Float[np.ndarray, "M b"] | None = None,
        faults: Float[np.ndarray, "M r"] | None = None,
    ) -> tuple[Part, ...]:
        """The discrepancy's parts beside a prediction (a long vector), and what the simulation has wrong there.

        Args:
            keys: effects in the prediction, at `values`; what their laws err by is a part where that is known.
            slopes: of the prediction, in the constants of the tissue that the set frees: no law errs by what they could
                do, and what a fault of the rig does is that fault's alone.
            base: slopes in the base's constants; worked out where they are needed and not given.
            faults: slopes in what faults of the rig are free in the set: a zero or a clock that they can set is theirs.
        """
        here = np.nan_to_num(self.cut.mean(prediction))
        done = self._done(here, bench, keys, values, base) if "effect" in self.families else []
        parts = self.discrepancy.about(here, done) if done else self.discrepancy.about(here)
        if done and slopes is not None:
            parts = tuple(self._across(p, slopes) if p.family == "effect" else p for p in parts)
        if faults is not None and faults.shape[1]:
            parts = tuple(self._across(p, faults) if p.family in BEFORE else p for p in parts)
        if bench.numerical is None:
            return parts
        return (*parts, *(self._known(name, self.cut.mean(x)) for name, x in bench.numerical.items()))

    def _done(
        self,
        here: Float[np.ndarray, " M"],
        bench: Bench,
        keys: Sequence[str],
        values: Mapping[str, float],
        slopes: Float[np.ndarray, "M b"] | None,
    ) -> list[Done]:
        """What each effect of the tissue does that the base's constants could not do in its place: the prediction less
        the one with its amplitudes at neutral, and of that what lies across all slopes of the base.

        A relaxation that is long over at the first sample only makes the base softer: it does nothing, and has nothing
        wrong with it, however much of the stress is gone.

        A fault of the rig is exactly what it is called: an offset, a lag, a hum of one frequency; but what acts within
        some samples is no better known than what those say of it. A law without a time or a rate errs by no function
        of time: that is for another effect to explain.
        """
        out, base = [], None
        for candidate in (bench.candidates[k] for k in keys):
            neutral = {a: bench.start[a] for a in candidate.amplitudes if a in values}
            if neutral and (candidate.brief or not candidate.rig):
                without = self.cut.mean(bench.predict({**values, **neutral}))
                timed = any(bench.free[p].unit in CLOCKED for p in candidate.paths)
                change = np.nan_to_num(here - without)
                if base is None:
                    known = (
                        self.cut.mean(bench.jacobian(values, bench.base, bench.fitted)) if slopes is None else slopes
                    )
                    base = _span(np.nan_to_num(known))  # an orthonormal basis of what the base's constants can do
                if not candidate.brief:
                    change = change - base @ (base.T @ change)
                out.append(Done(change, timed, candidate.brief))
        return out

    def _across(self, part: Part, slopes: Float[np.ndarray, "M p"]) -> Part:
        """Of this part what lies across the slopes, each block in units of its noise (Plumlee 2017, JASA 112)."""
        sigma = self.blocked.sigma[:, None]
        basis = _span(np.nan_to_num(slopes) / sigma)
        light = part.factor / sigma
        return replace(part, factor=sigma * (light - basis @ (basis.T @ light)))

    def _known(self, name: str, error: Float[np.ndarray, "M ..."]) -> Part:
        """A known error of a simulation: by columns, or where its sign is not known of each block alone."""
        if error.ndim == 1:
            return Part(name, "numerical", within=tuple(np.diag(error[r] ** 2) for r in self.blocked.rows))
        return Part(name, "numerical", error)

    @property
    def lasting(self) -> Bool[np.ndarray, " K"]:
        """Which parts of the discrepancy are not what happened at once."""
        return np.array([f != "sudden" for f in self.families])

    def priors(self, criteria: Criteria, keys: Sequence[str] = ()) -> Widths:
        """Prior of the amplitudes where the effects `keys` act.

        A family whose widening has a name that these recordings can show is wide with that name alone: always in the
        form that is nothing else, as likely as not beside another form of it. Any other may be wider without a name.
        """
        candidates = self.bench.candidates
        named = {f: c.name for c in candidates.values() for f in c.widens}
        wide = {f: w for key in keys for f, w in candidates[key].widens.items()}
        acting = {candidates[key].name for key in keys}
        free = np.array([f not in named and f not in criteria.settled for f in self.families])
        partly = np.array([f not in wide and named.get(f) in acting for f in self.families])
        width = np.array([wide.get(f, criteria.shares[f]) for f in self.families])
        sudden = ~self.lasting
        several = max(int(np.sum(free & ~sudden)), 1)
        chance = free * criteria.unknown / several + criteria.partly * partly
        if not sudden.any():
            return Widths(width, chance, criteria.strange)
        chance[sudden] = [criteria.happens(i) * p for i, p in enumerate(self.moments)]
        return Widths(width, chance, np.where(sudden, criteria.sudden / width, criteria.strange))

    def widened(self, keys: Sequence[str]) -> frozenset[str]:
        """Families of the discrepancy that are the business of the effects `keys`, in whatever form they act."""
        candidates = self.bench.candidates
        acting = {candidates[key].name for key in keys}
        return frozenset(f for c in candidates.values() if c.name in acting for f in c.widens)

    def effect_size(self, candidate: Candidate, values: Mapping[str, float], criteria: Criteria) -> dict[str, float]:
        """For every amplitude of a candidate, the value that changes the stress as much as is usual, to first order.

        Of an amplitude that does nothing at these shapes (fibres that nothing stretches) it is taken at those scanned;
        of one that does nothing there either, its typical value: its prior has to be a density, whatever its width.
        """
        shapes = {p: values[p] for p in candidate.shapes if p in values}
        out: dict[str, float] = {}
        for setting in ({}, *candidate.grid):
            left = [a for a in candidate.amplitudes if a not in out]
            if not left:
                break
            columns = self.cut.mean(self.bench.columns(self.values, [({**shapes, **setting}, a) for a in left]))
            for a, c in zip(left, columns.T, strict=True):  # over what it acts on: its own recording, say
                moved, stress = squared(c), squared(self.reference[c != 0])
                if 0 < moved < math.inf and stress > 0:
                    out[a] = criteria.usual(candidate.rig) * math.sqrt(stress / moved)
        return {a: out.get(a, self.bench.free[a].scale) for a in candidate.amplitudes}


def _span(slopes: Float[np.ndarray, "M p"]) -> Float[np.ndarray, "M q"]:
    """An orthonormal basis of what these slopes do, directions that are rounding left out."""
    sizes = np.linalg.norm(slopes, axis=0)
    felt = sizes > 0
    if not felt.any():
        return np.zeros((len(slopes), 0))
    turned, size, _ = np.linalg.svd(slopes[:, felt] / sizes[felt], full_matrices=False)
    return turned[:, size > SINGULAR * size[0]]


def scaled(
    bench: Bench,
    cut: Blocks,
    of: Discrepancy,
    prediction: np.ndarray,
    values: Mapping[str, float],
    criteria: Criteria | None = None,
) -> Scales:
    """The scales of a sample about the base's fit."""
    criteria = criteria or Criteria()
    sigma = cut.spread(bench.sigma)
    edges = np.flatnonzero(np.diff(cut.owner, prepend=-1))
    rows = tuple(slice(int(a), int(b)) for a, b in zip(edges, [*edges[1:], len(sigma)], strict=True))
    peak = max(float(np.quantile(np.abs(bench.y[s.rows]), criteria.means.peak)) for s in bench.segments) or 1.0
    shared = None if bench.shared is None else bench.shared[cut.owner[[r.start for r in rows]]]
    made = Scales(bench, of, (), cut, Blocked(rows, sigma, shared), values, cut.mean(prediction), peak)
    if bench.costly:
        made.size = np.maximum(peak, criteria.unseen / criteria.negligible * cut.mean(bench.sigma))
    made.families = tuple(p.family for p in made.about(bench.sigma, bench))
    return made


def with_priors(
    scales: Scales, keys: Sequence[str], start: Mapping[str, float], criteria: Criteria, bench: Bench | None = None
) -> tuple[Bench, dict[str, tuple[float, float]]]:
    """The bench with priors on everything that the set frees, and those priors in the coordinates of a descent."""
    bench, free, priors = bench or scales.bench, dict(scales.bench.free), {}
    for key in keys:
        c = bench.candidates[key]
        sizes = scales.effect_size(c, {**bench.start, **start}, criteria)
        middle = {p: [g[p] for g in c.grid if p in g] for p in c.shapes}
        for path in c.amplitudes:  # of what only corrects what was noted, how far that may be wrong
            priors[path] = free[path].prior or (bench.start[path], sizes[path])
        for path in c.shapes:
            f, scanned = free[path], middle[path] or [bench.start[path]]
            if f.log:
                logs = np.log(scanned)
                priors[path] = (float(np.mean(logs)), float(np.hypot(criteria.shape, np.std(logs))))
            else:
                width = max(criteria.loose * f.scale, float(np.ptp(scanned)))
                priors[path] = (float(np.mean(scanned)), width)
    for path, prior in priors.items():
        free[path] = replace(free[path], prior=prior)
    ready = copy.copy(bench)
    ready.free = free
    return ready, priors


def log_prior(f: Free, at: float, prior: tuple[float, float]) -> float:
    """Log density of a normal prior inside the bounds of a parameter, in the coordinates of a descent."""
    mean, std = prior
    low, high = (math.log(f.lower), math.log(f.upper)) if f.log else (f.lower, f.upper)
    inside = between((low - mean) / std, (high - mean) / std)
    return -0.5 * ((at - mean) / std) ** 2 - math.log(std * math.sqrt(2 * math.pi)) - inside


def squared(x: Float[np.ndarray, "..."]) -> float:
    """Sum of squares; infinite, or not a number, where something is out of all bounds."""
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.sum(x**2))

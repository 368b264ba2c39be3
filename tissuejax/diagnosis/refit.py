"""Full refits: all base parameters, amplitudes and shapes of a set of candidates together, within bounds.

Every step is a small bounded linear problem (`estimation.methods.broyden`), so that one-sided amplitudes rest on
their bound exactly and leave it when the data want them to. Positive shapes move in logarithm.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float

from tissuejax.diagnosis.bench import Bench, Free
from tissuejax.diagnosis.misfit import Misfit
from tissuejax.estimation.covariance import inflation, standard_errors
from tissuejax.estimation.descent import Ended, descend
from tissuejax.estimation.methods import broyden
from tissuejax.estimation.posed import LeastSquares
from tissuejax.estimation.reach import Reach, Whole
from tissuejax.estimation.solution import Limits, Solution

ENDS = 1e-6  # of a parameter's scale or range: what rests on its end


@dataclass(frozen=True)
class Refit(Solution):
    """A fit of the base with a set of candidates: one of the fits that a diagnosis is made of.

    Attributes:
        keys: candidates in the set, in the order in which they were added.
        values: free paths and their values; `own` those of the held-out recordings themselves.
        std: standard errors (natural coordinates); nan on a bound or where nothing is identified.
        at_bound: paths that rest on a bound.
        dof: degrees of freedom of the noise level behind `std`; infinite where the recorded one was used.
        chi2: whitened chi-square of the fitted recordings (without priors), n its number of samples.
        held: whitened chi-square of the held-out recordings, n_held its number of samples.
        prediction: the long vector.
        free: how each path may move.
    """

    keys: tuple[str, ...]
    values: dict[str, float]
    own: dict[str, float]
    std: dict[str, float]
    at_bound: tuple[str, ...]
    chi2: float
    n: int
    held: float
    n_held: int
    converged: bool
    prediction: Float[np.ndarray, " N"]
    dof: float = math.inf
    free: Mapping[str, Free] = field(default_factory=dict)

    @property
    def k(self) -> int:
        """Number of free parameters."""
        return len(self.values)

    @property
    def all(self) -> dict[str, float]:
        """Values of all recordings."""
        return {**self.values, **self.own}

    @property
    def freedom(self) -> float:
        """See `Solution.freedom`."""
        return self.dof

    def estimate(self, path: str) -> float:
        """See `Solution.estimate`; those of held-out recordings too."""
        return self.all[path]

    def limits(self, path: str) -> Limits:
        """See `Solution.limits`."""
        free = self.free[path]
        return Limits(free.lower, free.upper, free.log)


@dataclass(frozen=True)
class Resting:
    """What of a point rests on an end of its range.

    Attributes:
        on: whether it does, by parameter; side: +1 on the lower end, -1 on the upper one, or to which it is nearer.
        full: parts that take up their whole: the largest, which stands for their sum and rests on its upper end, and
            the others, which move at its cost.
        below, above: how far it is to either end; of an angle, which goes round, there is none.
    """

    on: Bool[np.ndarray, " p"]
    side: Float[np.ndarray, " p"]
    below: Float[np.ndarray, " p"]
    above: Float[np.ndarray, " p"]
    full: tuple[tuple[int, np.ndarray], ...] = ()

    def along(self, slopes: Float[np.ndarray, "... p"]) -> Float[np.ndarray, "... p"]:
        """Slopes by the parameters turned into slopes by what stands for them."""
        out = slopes.copy()
        for largest, others in self.full:
            out[..., others] -= slopes[..., [largest]]
        return out


class Descent(LeastSquares):
    """The parameters `paths` of a bench as a least-squares problem on some recordings, the rest of the values held.

    Coordinates are the parameters themselves, positive shapes in logarithm, between their bounds.
    """

    def __init__(
        self,
        bench: Bench,
        misfit: Misfit,
        paths: tuple[str, ...],
        recordings: tuple[str, ...],
        rest: Mapping[str, float],
    ):
        self.bench, self.misfit, self.paths, self.recordings, self.rest = bench, misfit, paths, recordings, dict(rest)
        free = [bench.free[p] for p in paths]
        self.log = np.array([f.log for f in free], bool)
        self.low = np.array([np.log(f.lower) if f.log else f.lower for f in free])
        self.high = np.array([np.log(f.upper) if f.log else f.upper for f in free])
        self.scale = np.array([1.0 if f.log else f.scale for f in free])
        self.turns = np.array([f.unit == "rad" for f in free], bool)
        self.priors = [(i, *f.prior) for i, f in enumerate(free) if f.prior is not None]
        self.wholes = self._wholes()
        self.predictions: dict[bytes, np.ndarray] = {}

    def _wholes(self) -> tuple[Whole, ...]:
        """What free parameters are parts of, less those that are held or known."""
        groups: dict[str, list[int]] = {}
        for i, path in enumerate(self.paths):
            groups.setdefault(self.bench.free[path].whole, []).append(i)
        stated = {**getattr(self.bench, "known", {}), **self.rest}
        found = []
        for name, members in groups.items():
            if name:
                others = (p for p, f in self.bench.free.items() if f.whole == name and p not in self.paths)
                most = 1.0 - sum(stated.get(p, 0.0) for p in others)
                found.append(Whole(tuple(members), max(most, 0.0)))
        return tuple(found)

    def resting(self, x: Float[np.ndarray, " p"]) -> "Resting":
        """What of x rests on an end of its range, and what takes up its whole."""
        span = np.minimum(np.where(np.isfinite(self.high - self.low), self.high - self.low, 1.0), self.scale)
        on = (x - self.low < ENDS * span) | (self.high - x < ENDS * span)
        side = np.where(x - self.low <= self.high - x, 1.0, -1.0)
        full = []
        for whole in self.wholes:
            members = np.array(whole.members)
            if whole.excess(x) > -ENDS:
                most = members[np.argmax(x[members])]
                full.append((int(most), members[members != most]))
                on[most], side[most] = True, -1.0
        below, above = (np.where(self.turns, np.inf, room) for room in (x - self.low, self.high - x))
        return Resting(on, side, below, above, tuple(full))

    def natural(self, x: Float[np.ndarray, " p"]) -> dict[str, float]:
        """Values of the free paths at x."""
        return dict(zip(self.paths, np.where(self.log, np.exp(np.where(self.log, x, 0.0)), x).tolist()))

    def point(self, values: Mapping[str, float]) -> Float[np.ndarray, " p"]:
        """x inside the box from values."""
        x = [np.log(max(values[p], 1e-300)) if log else values[p] for p, log in zip(self.paths, self.log)]
        inside = np.clip(np.array(x), self.low, self.high)
        for whole in self.wholes:
            inside = whole.shrunk(inside)
        return inside

    def residuals(self, x: Float[np.ndarray, " p"]) -> Float[np.ndarray, " n"]:
        """Whitened (predicted - measured), with the rows of the priors."""
        prediction = self.bench.predict({**self.rest, **self.natural(x)}, self.recordings)
        self.predictions[x.tobytes()] = prediction
        r = -self.misfit.residual(prediction, self.recordings)
        return np.concatenate([r, [(x[i] - m) / s for i, m, s in self.priors]]) if self.priors else r

    def jacobian(self, x: Float[np.ndarray, " p"]) -> Float[np.ndarray, "n p"]:
        """Whitened derivative of the prediction by x, with the rows of the priors."""
        jac = self.bench.jacobian({**self.rest, **self.natural(x)}, self.paths, self.recordings)
        return self.scaled(self.misfit.whiten(jac, self.recordings), x)

    def scaled(self, jac: Float[np.ndarray, "m p"], x: Float[np.ndarray, " p"]) -> Float[np.ndarray, "n p"]:
        """A whitened derivative by natural values turned into one by x, with the rows of the priors."""
        values = self.natural(x)
        jac = jac * np.where(self.log, [values[p] for p in self.paths], 1.0)
        if self.priors:
            rows = np.zeros((len(self.priors), len(self.paths)))
            for row, (i, _, s) in zip(rows, self.priors):
                row[i] = 1 / s
            jac = np.concatenate([jac, rows])
        return jac

    def sharpen(self) -> None:
        """Derivatives of the very place from now on."""
        self.bench = self.bench.sharpened()

    def run(
        self, x: Float[np.ndarray, " p"], iterations: int, tolerance: float, jac: Float[np.ndarray, "n p"] | None = None
    ) -> Ended:
        """A `broyden` descent from x.

        Args:
            tolerance: of chi-square.
            jac: the Jacobian at x (as `jacobian` gives it) where it is known already.
        """
        costly = self.bench.costly
        reach = Reach(self.low, self.high, self.scale, turns=self.turns, wholes=self.wholes)
        method = broyden(reach, iterations, tolerance, jac, self.sharpen if costly else None, costly)
        return descend(self, x, method)

    def prediction(self, ended: Ended) -> Float[np.ndarray, " N"]:
        """The long vector where a descent of this problem ended."""
        return self.predictions[ended.y.tobytes()]

    def errors(self, x: np.ndarray, r: np.ndarray) -> tuple[dict[str, float], tuple[str, ...], float]:
        """Standard errors in natural coordinates (see `inflation`), the paths on a bound, degrees of freedom."""
        inflate, dof = inflation(float(r @ r), len(r), len(x), self.bench.estimated)
        resting = self.resting(x)
        at, std = resting.on, np.full(len(x), np.nan)
        jac = resting.along(self.jacobian(x))
        norms = np.linalg.norm(jac, axis=0)
        use = ~at & (norms > 0) & np.isfinite(norms)
        if use.any():
            std[use] = np.sqrt(inflate) * standard_errors(jac[:, use])
        values = self.natural(x)
        std = np.where(self.log, std * np.array([values[p] for p in self.paths]), std)
        return dict(zip(self.paths, std.tolist())), tuple(p for p, b in zip(self.paths, at) if b), dof


def refit(
    bench: Bench,
    misfit: Misfit,
    keys: Sequence[str],
    start: Mapping[str, float],
    *,
    iterations: int = 30,
    tolerance: float = 0.1,
    final: bool = True,
    errors: bool = True,
    seed: np.ndarray | None = None,
) -> Refit:
    """Fit base and candidates `keys` from `start` (absent paths start at the bench's neutral values).

    Args:
        tolerance: stops when two steps in a row lower chi-square by less.
        final: False leaves standard errors and held-out recordings out, for trial starts.
        errors: False leaves standard errors out.
        seed: the whitened Jacobian at the start (natural coordinates, without priors) where it is known.
    """
    whole = {**bench.start, **start}
    paths = tuple(dict.fromkeys([*bench.base, *(p for key in keys for p in bench.candidates[key].paths)]))
    descent = Descent(bench, misfit, paths, bench.fitted, {})
    first = descent.point(whole)
    known = None if seed is None else descent.scaled(seed, first)
    ended = descent.run(first, iterations, tolerance, known)
    x, prediction = ended.y, descent.prediction(ended)
    values, own, std, at_bound, dof = descent.natural(x), {}, {}, (), math.inf
    r = misfit.residual(prediction, bench.fitted)
    chi2 = float(r @ r) if np.isfinite(ended.cost) else np.inf
    held = np.full(misfit.count(bench.held_out), np.inf)
    if final and np.isfinite(chi2):
        std, at_bound, dof = descent.errors(x, r) if errors else ({}, (), math.inf)
        belong = tuple(p for key in keys for p in bench.candidates[key].held)
        if belong and bench.held_out:
            second = Descent(bench, misfit, belong, bench.held_out, values)
            own = second.natural(second.run(second.point(whole), iterations, tolerance).y)
        prediction = bench.predict({**values, **own})
        held = misfit.residual(prediction, bench.held_out)
    outside = float(held @ held) if np.all(np.isfinite(held)) else np.inf
    return Refit(
        keys=tuple(keys),
        values=values,
        own=own,
        std=std,
        at_bound=at_bound,
        chi2=chi2,
        n=len(r),
        held=outside,
        n_held=len(held),
        converged=ended.converged,
        prediction=prediction,
        dof=dof,
        free=bench.free,
    )


def anchored(bench: Bench, fit: Refit, start: Mapping[str, float], shortened: int) -> tuple[Bench, Refit]:
    """The bench corrected where a fit came to rest, and the fit; nearer to its start where the fine simulation fails.

    A law that softens may be stable on a coarse mesh, where strains are averaged, and not on a fine one.

    Returns:
        The bench as it was, and a fit whose prediction is not finite, where `shortened` halvings lead to no fine
        simulation either.
    """
    first = fit
    for _ in range(shortened):
        near = bench.anchored(fit.values)
        if near is not bench or fit is not first:
            fit = replace(fit, prediction=near.predict(fit.values))
        if np.all(np.isfinite(fit.prediction)):
            return near, fit
        fit = replace(fit, values={p: 0.5 * (start.get(p, v) + v) for p, v in fit.values.items()})
    return bench, fit

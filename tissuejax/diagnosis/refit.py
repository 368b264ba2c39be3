"""Full refits: all base parameters, amplitudes and shapes of a set of candidates together, within bounds.

Levenberg-Marquardt whose every step is a small bounded linear least-squares problem, so that one-sided
amplitudes rest on their bound exactly and leave it when the data want them to. Positive shapes move in logarithm.
What belongs to one recording alone (an offset, a phase) is fitted on the held-out recordings too, all else fixed.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import lsq_linear

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.misfit import Misfit
from tissuejax.estimation.quantile import quantile

HOPELESS = 2e-3  # of what exceeds noise: a fit that leaves much is not polished
NOTHING = 1e-5  # of the largest effect of a parameter, each moved by its scale: what a one-sided difference errs by
FREE = 1e-4  # damping below which a step of a true Jacobian that gains nothing is the end
TURN = 0.8  # rad: the longest step of an angle, a quarter of it after every step that gained nothing


@dataclass(frozen=True)
class Refit:
    """A fit of a set of candidates.

    Attributes:
        keys: candidates in the set, in the order in which they were added.
        values: free paths and their values; `own` those of the held-out recordings themselves.
        std: standard errors (natural coordinates); nan on a bound or where nothing is identified.
        at_bound: paths that rest on a bound.
        dof: degrees of freedom of the noise level behind `std`; infinite where the recorded one was used.
        chi2: whitened chi-square of the fitted recordings (without priors), n its number of samples.
        held: whitened chi-square of the held-out recordings, n_held its number of samples.
        prediction: the long vector.
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

    @property
    def k(self) -> int:
        """Number of free parameters."""
        return len(self.values)

    @property
    def all(self) -> dict[str, float]:
        """Values of all recordings."""
        return {**self.values, **self.own}

    def intervals(self, bench: Bench, confidence: float = 0.95) -> dict[str, tuple[float, float]]:
        """Value -+ Student's quantile times standard error, cut at the bounds; of paths that are identified.

        Of paths that move in logarithm the interval is the logarithm's: it never reaches zero.
        """
        q, found = quantile(confidence, self.dof), {}
        for path, std in self.std.items():
            free, value = bench.free[path], self.all[path]
            if not np.isfinite(std):
                continue
            if free.log:
                with np.errstate(over="ignore"):
                    reach = float(np.exp(q * std / value))
                low, high = value / reach, value * reach
            else:
                low, high = value - q * std, value + q * std
            found[path] = max(low, free.lower), min(high, free.upper)
        return found


@dataclass
class Descent:
    """A descent over `paths` on some recordings, the rest of the values held."""

    bench: Bench
    misfit: Misfit
    paths: tuple[str, ...]
    recordings: tuple[str, ...]
    rest: dict[str, float]

    def __post_init__(self):
        free = [self.bench.free[p] for p in self.paths]
        self.log = np.array([f.log for f in free], bool)
        self.low = np.array([np.log(f.lower) if f.log else f.lower for f in free])
        self.high = np.array([np.log(f.upper) if f.log else f.upper for f in free])
        self.scale = np.array([1.0 if f.log else f.scale for f in free])
        # near an axis of the tests an angle has next to no slope and wants several turns: the rest must not wait for it
        self.turns = np.array([f.unit == "rad" for f in free], bool)
        self.priors = [(i, *f.prior) for i, f in enumerate(free) if f.prior is not None]

    def natural(self, x: np.ndarray) -> dict[str, float]:
        """Values of the free paths at x."""
        return dict(zip(self.paths, np.where(self.log, np.exp(np.where(self.log, x, 0.0)), x).tolist()))

    def point(self, values: Mapping[str, float]) -> np.ndarray:
        """x inside the box from values."""
        x = [np.log(max(values[p], 1e-300)) if log else values[p] for p, log in zip(self.paths, self.log)]
        return np.clip(np.array(x), self.low, self.high)

    def objective(self, x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """Sum of squares with priors, whitened residual, prediction."""
        prediction = self.bench.predict({**self.rest, **self.natural(x)}, self.recordings)
        r = self.misfit.residual(prediction, self.recordings)
        if not np.all(np.isfinite(r)):
            return np.inf, r, prediction
        if self.priors:
            r = np.concatenate([r, [(m - x[i]) / s for i, m, s in self.priors]])
        return float(r @ r), r, prediction

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Whitened derivative of the prediction by x, with the rows of the priors."""
        jac = self.bench.jacobian({**self.rest, **self.natural(x)}, self.paths, self.recordings)
        return self.scaled(self.misfit.whiten(jac, self.recordings), x)

    def scaled(self, jac: np.ndarray, x: np.ndarray) -> np.ndarray:
        """A whitened derivative by natural values turned into one by x, with the rows of the priors."""
        values = self.natural(x)
        jac = jac * np.where(self.log, [values[p] for p in self.paths], 1.0)
        if self.priors:
            rows = np.zeros((len(self.priors), len(self.paths)))
            for row, (i, _, s) in zip(rows, self.priors):
                row[i] = 1 / s
            jac = np.concatenate([jac, rows])
        return jac

    def run(
        self, x: np.ndarray, iterations: int, tolerance: float, jac: np.ndarray | None = None
    ) -> tuple[np.ndarray, float, np.ndarray, bool]:
        """From x to (x, cost, prediction, converged).

        A Jacobian costs many predictions, so it is only corrected along steps that keep their promise (Broyden); but a
        corrected one knows nothing of directions that were not taken, nor that of the start of shapes whose amplitude
        was zero there: neither may end the descent.

        Args:
            jac: the Jacobian at x (as `jacobian` gives it) where it is known already.
        """
        cost, r, prediction = self.objective(x)
        tries, sharp = 2 if self.bench.costly else 10, not self.bench.costly
        # a Jacobian from elsewhere may lack what vanishes there (shapes at zero amplitude): good for one step
        damping, small, age, given, first = 1e-3, 0, 0, jac is not None, True
        for _ in range(iterations):
            if not np.isfinite(cost):
                return x, cost, prediction, False
            if jac is None:
                jac, age = self.jacobian(x), 0
            if not np.all(np.isfinite(jac)):
                return x, cost, prediction, False
            size = np.linalg.norm(jac, axis=0)
            # A column that is nothing but the error of a difference (a fibre along an axis: no slope in its angle) must
            # not call for a step of its own, or nothing else moves.
            nothing = size * self.scale < NOTHING * np.max(size * self.scale, initial=0.0)
            lacking = given or (first and not np.all(size))
            first = False
            q, t = np.linalg.qr(np.where(nothing, 0.0, jac))
            right, enough = q.T @ r, False
            size = np.maximum(size, 1e-9 * np.max(size, initial=0.0) + 1e-6 / self.scale)
            for tried in range(tries):
                reach = np.where(self.turns, TURN / 4**tried, np.inf)
                low, high = np.maximum(self.low - x, -reach), np.minimum(self.high - x, reach)
                a = np.vstack([t, np.diag(np.sqrt(damping) * size)])
                step = bounded(a, np.concatenate([right, np.zeros(len(x))]), low, high)
                trial = np.clip(x + step, self.low, self.high)
                step = trial - x
                left = r - jac @ step
                promised = cost - float(left @ left)
                if self.bench.costly and promised < tolerance and not lacking:  # no simulation is run for so little
                    new, enough = cost, True
                    break
                new, r_new, p_new = self.objective(trial)
                if new < cost or age > 0:
                    break
                damping = max(damping * 8, 1e-6)
                if np.max(np.abs(step) / np.maximum(self.scale, np.abs(x)), initial=0.0) < 1e-9:
                    return x, cost, prediction, True
            else:
                enough = True
            if enough:
                if age > 0:  # a corrected Jacobian knows nothing of directions that were not taken
                    jac = None
                    continue
                if sharp or tried == 0:
                    return x, cost, prediction, True
                self.bench, jac, sharp = self.bench.sharpened(), None, True
                continue
            if not new < cost:  # a corrected Jacobian failed: take a true one
                jac = None
                continue
            drop = cost - new
            true = age == 0 and not lacking
            if drop > 0.7 * promised and age < 3 and step @ step > 0 and not lacking:
                jac, age = jac + np.outer(left - r_new, step) / (step @ step), age + 1
            else:
                jac, given = None, False
            cost, x, r, prediction = new, trial, r_new, p_new
            damping = max(damping / 10, 1e-9)
            tiny = drop < max(tolerance, HOPELESS * (cost - len(r)))
            if tiny and not true:  # a corrected Jacobian, or one without the column of a shape, tells of no end
                jac, given = None, False
                continue
            small = small + 1 if tiny else 0
            if small >= 2 or drop < 1e-3 * tolerance or (tiny and damping < FREE):
                return x, cost, prediction, True
        return x, cost, prediction, False

    def errors(self, x: np.ndarray, r: np.ndarray) -> tuple[dict[str, float], tuple[str, ...], float]:
        """Standard errors in natural coordinates (see `inflation`), the paths on a bound, degrees of freedom."""
        inflate, dof = inflation(self.bench, float(r @ r), len(r), len(x))
        span = np.minimum(np.where(np.isfinite(self.high - self.low), self.high - self.low, 1.0), self.scale)
        at = (x - self.low < 1e-6 * span) | (self.high - x < 1e-6 * span)
        std = np.full(len(x), np.nan)
        jac = self.jacobian(x)
        norms = np.linalg.norm(jac, axis=0)
        use = ~at & (norms > 0) & np.isfinite(norms)
        if use.any():
            _, s, v = np.linalg.svd(jac[:, use] / norms[use], full_matrices=False)
            if s[-1] > 1e-8 * s[0]:
                std[use] = np.sqrt(inflate * np.sum((v.T / s) ** 2, axis=1)) / norms[use]
        values = self.natural(x)
        std = np.where(self.log, std * np.array([values[p] for p in self.paths]), std)
        return dict(zip(self.paths, std.tolist())), tuple(p for p, b in zip(self.paths, at) if b), dof


def inflation(bench: Bench, chi2: float, n: int, k: int) -> tuple[float, float]:
    """What variances of estimates are multiplied by, and the degrees of freedom behind it.

    A recorded noise level is only widened where the misfit says that it is more; a guessed one (`Bench.estimated`)
    gives way to what the model leaves, in either direction. Intervals then follow Student's distribution.

    Args:
        chi2: of n whitened residuals that k parameters were fitted to.
    """
    dof = max(n - k, 1)
    scale = chi2 / dof
    if not bench.estimated and scale <= 1.0:
        return 1.0, math.inf
    return max(scale, 1e-12), float(dof)


def bounded(a: np.ndarray, b: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """min |a s - b| with low <= s <= high; the free solution where it is allowed."""
    step = np.linalg.lstsq(a, b, rcond=None)[0]
    if np.all(step >= low) and np.all(step <= high):
        return step
    size = np.linalg.norm(a, axis=0)
    answer = lsq_linear(a / size, b, (low * size, np.maximum(high, low + 1e-12) * size), method="bvls", max_iter=50)
    return answer.x / size


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
    x, cost, prediction, converged = descent.run(first, iterations, tolerance, known)
    values, own, std, at_bound, dof = descent.natural(x), {}, {}, (), math.inf
    r = misfit.residual(prediction, bench.fitted)
    chi2 = float(r @ r) if np.isfinite(cost) else np.inf
    held = np.full(misfit.count(bench.held_out), np.inf)
    if final and np.isfinite(chi2):
        std, at_bound, dof = descent.errors(x, r) if errors else ({}, (), math.inf)
        belong = tuple(p for key in keys for p in bench.candidates[key].held)
        if belong and bench.held_out:
            second = Descent(bench, misfit, belong, bench.held_out, values)
            y, *_ = second.run(second.point(whole), iterations, tolerance)
            own = second.natural(y)
        prediction = bench.predict({**values, **own})
        held = misfit.residual(prediction, bench.held_out)
    outside = float(held @ held) if np.all(np.isfinite(held)) else np.inf
    return Refit(tuple(keys), values, own, std, at_bound, chi2, len(r), outside, len(held), converged, prediction, dof)

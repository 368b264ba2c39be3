"""How the noise is correlated in time, estimated although the prediction is wrong.

A residual that is smooth because physics is missing must not be taken for correlated noise, or nothing would ever be
found. Two facts keep them apart: the variance of a single sample was recorded, and noise with a correlated part can't
have more; and a mismatch driven by piecewise-smooth motions has a spectrum that falls at least as f^-4 (kinks), while
that of exponentially correlated noise never falls faster than f^-2. So a residual is taken for the sum of

    white noise + exponentially correlated noise + an integrated random walk with an intensity of its own,

whose likelihood is exact at any sampling: a Kalman filter with four numbers' worth of state. The integrated random
walk (spectrum exactly f^-4; its posterior mean is a cubic smoothing spline) is the nuisance, one a recording, with a
level and a slope that nothing is known of.

Behind a filter of second order noise falls as f^-4 too, above its corner; below it such noise is flat and has the
recorded variance, and a walk grows without end. Where the recorded white noise is not to be seen, that is asked. A
filter has a time in seconds, or follows the rate of its converter: then it is one in samples.

The shape (share, tau) is common to the recordings unless their likelihoods say otherwise. The level is the recorded
one, unless they say that it is wrong: then it is each recording's own.

Sources: Wahba 1978, J. R. Stat. Soc. B 40:364 (spline and integrated random walk); Harvey 1989, Forecasting,
Structural Time Series Models and the Kalman Filter, ch. 3; Akaike 1974; Schwarz 1978.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from tissuejax.cache.programs import Kept
from tissuejax.estimation.noise import Noise

LEAST = 64  # samples of a series from which its correlation can be told from a mismatch
MISSTATED = 2.0  # factor by which a recorded level may be wrong: levels that are read off a rest seldom are worse
GAIN = 8.0  # twice the log-likelihood by which correlated noise must beat white: 2 Akaike units a parameter beyond cost
SHARES, TAUS, WALKS = 6, 7, 9  # tried at once of the share, the time, the intensity of the walk: one program
ROUNDS = 3  # of trials, each in a narrower range
NEWTON = 3  # steps to the likeliest level
DIFFUSE = 1e4  # prior variance of the mismatch's level over that of the residual
NEVER_WHITE, FILTERED = 1e-3, 1e-6  # least share of white noise that is tried; of a recorded level behind a filter
LOGITS = -4.5, 6.5, 13.5  # of the shares that are tried: the least, and the greatest of either
UNLIKE = 1.1  # ratio of sampling steps from which a filter in seconds and one in samples are two things


@dataclass(frozen=True)
class Series:
    """A residual of one recording over its recorded standard deviation, columns sampled alike.

    Attributes:
        time: s.
        values: one row a sample.
        kinks: samples from which on a smooth part may have another slope (where a ramp ends).
    """

    time: Float[np.ndarray, " n"]
    values: Float[np.ndarray, "n k"]
    kinks: tuple[int, ...] = ()


@dataclass(frozen=True)
class Estimate:
    """What is said of the noise of several recordings.

    Attributes:
        noises: the shape for each series, of standard deviation 1.
        levels: standard deviation of each over the recorded one, mismatch left aside.
        common: whether all series share one shape.
    """

    noises: tuple[Noise, ...]
    levels: tuple[float, ...]
    common: bool = True


def estimate(
    series: Sequence[Series], recorded: bool = True, orders: tuple[int, ...] = (1,), mismatch: bool = True
) -> Estimate:
    """Correlation of the noise in several residuals.

    Args:
        recorded: False where the standard deviation was not recorded: then correlated noise may have any.
        orders: of the low-pass that may stand before the noise; the likelier one is taken.
        mismatch: False where all that is left shall be noise, as for intervals, which a mismatch then widens; noise
            behind a low-pass of second order falls as f^-4 too and is not told from a mismatch otherwise.

    Returns:
        White noise where nothing else is clearly better; short series (< `LEAST` samples) take the shape of the others
        and are white where there are none.
    """
    long = [i for i, s in enumerate(series) if len(s.time) >= LEAST]
    levels = [float(np.std(s.values)) or 1.0 if len(s.time) else 1.0 for s in series]
    if not long:
        return Estimate((Noise(),) * len(series), tuple(levels))
    surfaces = [_Surface(series[i], recorded, mismatch) for i in long]
    shared = _best(surfaces, orders)
    price = 2 * (len(surfaces) - 1) * math.log(sum(s.n for s in surfaces))
    # on a coarse grid; the rest is seen where it may matter
    common = len(surfaces) == 1 or 2 * shared.apart < 0.5 * price
    alone = [_best([s], orders) for s in surfaces] if not common else [shared] * len(surfaces)
    common = common or 2 * (sum(a.likelihood for a in alone) - shared.likelihood) <= price
    noises = [shared.noise(_step(np.asarray(s.time, float))) for s in series]
    for i, own, surface, level in zip(long, alone, surfaces, shared.levels):
        levels[i] = level if common else own.levels[0]
        if not common:
            noises[i] = own.noise(surface.step)
    return Estimate(tuple(noises), tuple(levels), common)


def _step(time: Float[np.ndarray, " n"]) -> float:
    """Typical time between samples, s; two samples may share a time, and one has none to another."""
    steps = np.diff(time)
    return float(np.median(steps[steps > 0])) if np.any(steps > 0) else 1.0


class _Surface:
    """The likelihood of one series, the walk's intensity and the level at their best."""

    def __init__(self, series: Series, capped: bool = True, mismatch: bool = True):
        self.capped, self.tried = capped, WALKS if mismatch else 1
        time = np.asarray(series.time, float) - series.time[0]
        self.n, self.columns = len(time), series.values.reshape(len(time), -1).T
        steps = np.diff(time)
        self.span, self.step = time[-1], _step(time)
        line = np.stack([np.ones(self.n), time / self.span - 0.5], 1)
        self.columns = self.columns - (line @ np.linalg.lstsq(line, self.columns.T, rcond=None)[0]).T
        size = float(np.mean(self.columns**2)) or 1.0
        self.prior = np.float64(DIFFUSE * max(size, 1.0)), np.float64(self.span)
        self.least, self.most = math.log10(1e-6 / self.span**3), math.log10(1e3 / self.step**3)
        power = 2 ** math.ceil(math.log2(max(self.n, 256)))
        padded = 3 * power // 4 if self.n <= 3 * power // 4 else power  # few lengths, few programs
        self.steps = np.pad(steps, (0, padded - self.n + 1))
        self.seen = np.arange(padded) < self.n
        self.turns = np.isin(np.arange(padded), series.kinks)
        self.padded = [np.pad(c, (0, padded - self.n)) for c in self.columns]

    def walks(self, low: float, high: float, n: int = 1) -> np.ndarray:
        """No walk, and as many intensities between two powers of ten as make `n` times those tried at once."""
        n = n * self.tried
        if self.tried == 1:
            return np.zeros(n)
        return np.concatenate([[0.0], np.logspace(low, high, n - 1)])

    def __call__(
        self, shares: np.ndarray, taus: np.ndarray, walks: np.ndarray, free: bool, order: int = 1
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Log-likelihood, intensity of the walk and variance at their best, for every share and time.

        Args:
            walks: intensities to try, 1/s^3, over the noise's variance.
            free: whether the variance may differ from the recorded one.
        """
        trials = [x.ravel() for x in np.meshgrid(shares, taus, walks, indexing="ij")]
        with jax.enable_x64(True):
            run = _filtered if order == 1 else _filtered_twice
            parts = [run(self.steps, c, self.seen, self.turns, *trials, *self.prior) for c in self.padded]
        logs, squares = (np.sum([np.asarray(part[i]) for part in parts], axis=0) for i in (0, 1))
        n = self.n * len(parts)
        # white noise may exceed what was recorded, nothing else is like it; correlated noise may not
        most = np.where((trials[0] > 0) & self.capped, 1.0, np.inf)
        variance = np.minimum(_levels(squares, n, self.capped), most) if free else np.ones(len(logs))
        likelihood = -0.5 * (n * np.log(variance) + logs + squares / variance + _unlikely(variance, self.capped))
        shape = (len(shares), len(taus), len(walks))
        likelihood, variance = likelihood.reshape(shape), variance.reshape(shape)
        at = np.argmax(likelihood, axis=2)[..., None]
        best, level = (np.take_along_axis(x, at, 2)[..., 0] for x in (likelihood, variance))
        return best, np.asarray(walks)[at[..., 0]], level


def _unlikely(variance: Float[np.ndarray, " t"], recorded: bool) -> Float[np.ndarray, " t"]:
    """Minus twice the log probability of a variance over the recorded one: as often twice the level as half of it. A
    mismatch that may be anything could take all of a residual up, and the noise were of any level below."""
    return (0.5 * np.log(variance) / math.log(MISSTATED)) ** 2 if recorded else np.zeros_like(variance)


def _levels(squares: Float[np.ndarray, " t"], n: int, recorded: bool) -> Float[np.ndarray, " t"]:
    """The likeliest variance over the recorded one, where `n` samples have such sums of squares: Newton in its
    logarithm, of a convex function."""
    log = np.log(np.maximum(squares / n, 1e-300))  # without a prior, which is of as much weight as a sample or two
    stiff = 0.5 / math.log(MISSTATED) ** 2
    for _ in range(NEWTON if recorded else 0):
        seen = squares * np.exp(-log)
        log = log - (n - seen + stiff * log) / (seen + stiff)
    return np.exp(log)


@dataclass(frozen=True)
class _Found:
    """A shape; `apart` is by how much the log-likelihood may grow if every series has a shape of its own.

    Attributes:
        tau: s, or in samples of each series where `sampled`.
    """

    share: float
    tau: float
    likelihood: float
    levels: list[float]
    apart: float = 0.0
    order: int = 1
    sampled: bool = False

    def noise(self, step: float) -> Noise:
        """Of unit variance, of a series with `step` s between samples."""
        return Noise.shaped(self.share, self.tau * (step if self.sampled else 1.0), order=self.order)

    @property
    def seen(self) -> bool:
        """Whether any series shows noise of the level that was recorded."""
        return max(self.levels) * MISSTATED >= 1


def _best(surfaces: Sequence[_Surface], orders: tuple[int, ...] = (1,)) -> _Found:
    """White noise or, if that is clearly better, correlated; of the recorded level unless that is clearly wrong.

    Whether it is correlated is asked with the level free: a level that is a little off must not be read as a shape.
    Where white noise of the level is seen, no filter of second order was passed, and none is sought.
    """
    maps = [s(np.zeros(1), np.ones(1), s.walks(s.least, s.most, SHARES * TAUS), True) for s in surfaces]
    white = _Found(0.0, 1.0, sum(float(t[0][0, 0]) for t in maps), [math.sqrt(t[2][0, 0]) for t in maps])
    alone = [float(t[0][0, 0]) for t in maps]
    capped = surfaces[0].capped
    found = _correlated(surfaces, alone, True, min(orders))
    if 2 in orders and not (capped and white.seen):
        unlike = max(s.step for s in surfaces) > UNLIKE * min(s.step for s in surfaces)
        clocks = (False, True) if unlike else (False,)
        second = max((_correlated(surfaces, alone, True, 2, clock) for clock in clocks), key=lambda f: f.likelihood)
        found = second if 2 * (second.likelihood - found.likelihood) > (GAIN if capped else 0) else found
    if 2 * (found.likelihood - white.likelihood) <= GAIN:
        return replace(white, apart=found.apart)
    if not capped:
        return found
    recorded = _correlated(surfaces, [-math.inf] * len(surfaces), False, near=found)
    if 2 * (found.likelihood - recorded.likelihood) > GAIN * len(surfaces):
        return found
    return replace(recorded, apart=found.apart)


def _correlated(
    surfaces: Sequence[_Surface],
    white: Sequence[float],
    free: bool,
    order: int = 1,
    sampled: bool = False,
    near: _Found | None = None,
) -> _Found:
    """The share and the time of highest likelihood, on ever narrower grids.

    Args:
        white: likelihoods without a share.
        sampled: whether the time is one in samples of each series: a filter that follows the rate of a converter.
        near: where to begin, two rounds instead of three; of its order, and in its unit of time.
    """
    if near is not None:
        order, sampled = near.order, near.sampled
    behind = order == 2 and surfaces[0].capped
    never = FILTERED if behind else NEVER_WHITE
    units = [s.step if sampled else 1.0 for s in surfaces]
    logits = np.linspace(LOGITS[0], LOGITS[2 if behind else 1], SHARES)
    least, most = (min(s.step / u for s, u in zip(surfaces, units)), max(s.span / u for s, u in zip(surfaces, units)))
    logs = np.linspace(math.log(least / 3), math.log(most / 3), TAUS)
    if near is not None:
        at = math.log(near.share / (1 - near.share))
        logits = np.linspace(at - 2, at + 2, SHARES)
        logs = math.log(near.tau) + np.linspace(-1.2, 1.2, TAUS)
    ranges = [(s.least, s.most) for s in surfaces]
    best, apart = _Found(0.0, 1.0, -math.inf, []), None
    for _ in range(ROUNDS if near is None else ROUNDS - 1):
        shares = np.minimum(1 / (1 + np.exp(-logits)), 1 - never)
        maps = [s(shares, u * np.exp(logs), s.walks(*r), free, order) for s, u, r in zip(surfaces, units, ranges)]
        total = sum((t[0] for t in maps[1:]), maps[0][0])
        i, j = np.unravel_index(np.argmax(total), total.shape)
        if apart is None:
            own = sum(max(float(np.max(t[0])), w) for t, w in zip(maps, white))
            apart = own - max(float(total[i, j]), sum(white))
        if total[i, j] > best.likelihood:
            levels = [math.sqrt(t[2][i, j]) for t in maps]
            tau = float(math.exp(logs[j]))
            best = _Found(float(shares[i]), tau, float(total[i, j]), levels, apart, order, sampled)
        ranges = [_narrowed(r, float(t[1][i, j])) for r, t in zip(ranges, maps)]
        logits = _around(logits, int(i))
        logs = _around(logs, int(j))
    return best


def _around(grid: np.ndarray, at: int) -> np.ndarray:
    """As many values between the neighbours of the best one."""
    step = grid[1] - grid[0]
    return np.linspace(grid[at] - step, grid[at] + step, len(grid))


def _narrowed(limits: tuple[float, float], best: float) -> tuple[float, float]:
    """Powers of ten between which the walk is sought next."""
    step = 1.5 * (limits[1] - limits[0]) / (WALKS - 2)
    at = math.log10(best) if best > 0 else limits[0]
    return at - step, at + step


def _filter(steps, y, seen, turns, share, tau, walk, diffuse, span):
    """Sum of the logarithms of the innovations' variances and of their squares over these, for every trial.

    State: correlated noise u, level a and slope b of the mismatch; y = u + a + white. Variances are in units of the
    noise's.
    """
    white = 1 - share
    none = jnp.zeros_like(share)

    def advance(carry, now):
        (u, a, b), (uu, ua, ub, aa, ab, bb), logs, squares = carry
        dt, value, there, turn = now
        b, ub, ab = (jnp.where(turn, 0.0, x) for x in (b, ub, ab))
        bb = jnp.where(turn, diffuse / span**2, bb)
        hu, ha, hb = uu + ua, ua + aa, ub + ab
        variance = hu + ha + white
        error = jnp.where(there, value - u - a, 0.0)
        gain = jnp.where(there, 1 / variance, 0.0)
        logs = logs + jnp.where(there, jnp.log(variance), 0.0)
        squares = squares + gain * error**2
        ku, ka, kb = gain * hu, gain * ha, gain * hb
        u, a, b = u + ku * error, a + ka * error, b + kb * error
        uu, ua, ub = uu - ku * hu, ua - ku * ha, ub - ku * hb
        aa, ab, bb = aa - ka * ha, ab - ka * hb, bb - kb * hb
        fade = jnp.exp(-dt / tau)
        ua, ub = fade * (ua + dt * ub), fade * ub
        uu = fade**2 * uu + share * (1 - fade**2)
        aa = aa + 2 * dt * ab + dt**2 * bb + walk * dt**3 / 3
        ab = ab + dt * bb + walk * dt**2 / 2
        bb = bb + walk * dt
        return ((fade * u, a + dt * b, b), (uu, ua, ub, aa, ab, bb), logs, squares), None

    first = ((none, none, none), (share, none, none, none + diffuse, none, none + diffuse / span**2), none, none)
    return jax.lax.scan(advance, first, (steps, y, seen, turns))[0][2:]


def _filter_twice(steps, y, seen, turns, share, tau, walk, diffuse, span):
    """The same behind a low-pass of second order: states u, v (tau times its rate), a, b, and their covariances."""
    white, none = 1 - share, jnp.zeros_like(share)

    def advance(carry, now):
        (u, v, a, b), (uu, uv, ua, ub, vv, va, vb, aa, ab, bb), logs, squares = carry
        dt, value, there, turn = now
        b, ub, vb, ab = (jnp.where(turn, 0.0, x) for x in (b, ub, vb, ab))
        bb = jnp.where(turn, diffuse / span**2, bb)
        hu, hv, ha, hb = uu + ua, uv + va, ua + aa, ub + ab
        variance = hu + ha + white
        error = jnp.where(there, value - u - a, 0.0)
        gain = jnp.where(there, 1 / variance, 0.0)
        logs = logs + jnp.where(there, jnp.log(variance), 0.0)
        squares = squares + gain * error**2
        ku, kv, ka, kb = gain * hu, gain * hv, gain * ha, gain * hb
        u, v, a, b = u + ku * error, v + kv * error, a + ka * error, b + kb * error
        uu, uv, ua, ub = uu - ku * hu, uv - ku * hv, ua - ku * ha, ub - ku * hb
        vv, va, vb = vv - kv * hv, va - kv * ha, vb - kv * hb
        aa, ab, bb = aa - ka * ha, ab - ka * hb, bb - kb * hb
        d = dt / tau
        e = jnp.exp(-d)
        p, q, r = e * (1 + d), e * d, e * (1 - d)  # u goes to p u + q v, v to r v - q u
        # what is fresh in them, written so that nothing cancels where d is small
        w = -jnp.expm1(-2 * d)
        fresh_uu, fresh_uv, fresh_vv = w - 2 * d * (1 + d) * e**2, 2 * q**2, w + 2 * d * (1 - d) * e**2
        ua, va = ua + dt * ub, va + dt * vb
        ua, va, ub, vb = p * ua + q * va, r * va - q * ua, p * ub + q * vb, r * vb - q * ub
        uu, uv, vv = (
            p * (p * uu + 2 * q * uv) + q**2 * vv + share * fresh_uu,
            p * (r * uv - q * uu) + q * (r * vv - q * uv) + share * fresh_uv,
            r * (r * vv - 2 * q * uv) + q**2 * uu + share * fresh_vv,
        )
        aa = aa + 2 * dt * ab + dt**2 * bb + walk * dt**3 / 3
        ab = ab + dt * bb + walk * dt**2 / 2
        bb = bb + walk * dt
        spread = (uu, uv, ua, ub, vv, va, vb, aa, ab, bb)
        return ((p * u + q * v, r * v - q * u, a + dt * b, b), spread, logs, squares), None

    level, slope = none + diffuse, none + diffuse / span**2
    spread = (share, none, none, none, share, none, none, level, none, slope)
    first = ((none, none, none, none), spread, none, none)
    return jax.lax.scan(advance, first, (steps, y, seen, turns))[0][2:]


_filtered = Kept(_filter, "estimation.correlation._filter")
_filtered_twice = Kept(_filter_twice, "estimation.correlation._filter_twice")

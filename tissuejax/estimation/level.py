"""How large noise is that was not recorded: from what a response to the drive can't be.

Differences between neighbours see white noise only: noise that is correlated, filtered or quantised differs little from
one sample to the next and comes out too small. So the response is taken out first, by a description that knows no
particular material: any smooth law of the drive at once (cubic splines, for powers can't follow one that stiffens
tenfold), and powers of it that fade over several times (the leading terms of a Green-Rivlin expansion). What is left
holds the noise and a smooth rest; the two are told apart by their spectra (`estimation.correlation`), and what the
description took of slow noise is put back.

Sources: Green and Rivlin 1957, Arch. Ration. Mech. Anal. 1:1 (multiple-integral expansion); de Boor 1978, A Practical
Guide to Splines, ch. IX; Gasser, Sroka and Jennen-Steinmetz 1986, Biometrika 73:625 (differences, for short series);
Widrow and Kollar 2008, Quantization Noise, ch. 1 (q^2/12).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tissuejax.estimation.correlation import LEAST, Series, estimate
from tissuejax.estimation.noise import Noise
from tissuejax.estimation.series import finest

OF_NOTE = 0.005  # of the peak: half of what load cells are verified to (class 1 of ISO 7500-1)
THIRD = np.array([1.0, -3.0, 3.0, -1.0])
PIECES = (3, 6)  # of the law of the drive at once, between its least and its largest: for few and for many samples
EACH = 25  # samples a piece
POWERS = (1, 2, 3)
LONGEST, SHORTEST = 0.5, 0.012  # of the recording: times over which the response forgets
APART = 6.5  # of one such time over the next
SEEN = 10.0  # finest steps that the shortest of them lasts where steps are uneven
KINK = 0.25  # of the fastest drive: change of rate from which the response may turn sharply
LEVELS = 0.25  # distinct values a sample below which a series is called quantised
SMOOTH = 2.0  # what is left over noise, from which the smooth part may itself be slow noise


@dataclass(frozen=True)
class Response:
    """One measured series and what was done.

    Attributes:
        time: s.
        drive: stretch, shear or whatever was imposed, any unit.
        values: what was measured.
    """

    time: Float[np.ndarray, " n"]
    drive: Float[np.ndarray, " n"]
    values: Float[np.ndarray, " n"]


@dataclass(frozen=True)
class Level:
    """Noise of a series as far as the series tells.

    Attributes:
        std: standard deviation, unit of the values.
        noise: its shape.
        left: standard deviation of all that the description of the response left, the smooth part included.
        resolution: step of the recorded values; 0 where none shows.
        short: whether the series was too short for anything but differences of neighbours.
    """

    std: float
    noise: Noise = Noise()
    left: float = 0.0
    resolution: float = 0.0
    short: bool = False

    @property
    def certain(self) -> bool:
        """Whether slow noise and a slow part of the response were told apart."""
        return self.short or self.left < SMOOTH * self.std


def rough(y: Float[np.ndarray, " n"]) -> float:
    """Standard deviation of white noise on a smooth series: from third differences, by their median; 0 where a series
    is too short to have one."""
    if len(y) < len(THIRD):
        return 0.0
    d = np.convolve(y, THIRD, "valid") / np.sqrt(np.sum(THIRD**2))
    return float(np.median(np.abs(d)) / 0.6745)


def resolution(y: Float[np.ndarray, " n"]) -> float:
    """Step between neighbouring values of a quantised series; 0 where samples seldom repeat a value."""
    y = y[np.isfinite(y)]
    distinct = np.unique(y)
    if len(distinct) < 2 or len(distinct) > LEVELS * len(y):
        return 0.0
    steps = np.diff(distinct)
    step = float(np.min(steps[steps > 1e-9 * np.ptp(y)]))
    off = np.abs(steps / step - np.round(steps / step))
    return step if np.all(off < 0.05) else 0.0


def kinks(time: Float[np.ndarray, " n"], drive: Float[np.ndarray, " n"], width: int = 3) -> tuple[int, ...]:
    """Samples where the rate of the drive changes at once."""
    n = len(time)
    if n < 4 * width:
        return ()
    rate = (drive[width:] - drive[:-width]) / (time[width:] - time[:-width])
    change = np.zeros(n)
    change[width : n - width] = np.abs(rate[width:] - rate[:-width])
    limit = KINK * float(np.max(np.abs(rate)))
    return tuple(
        k
        for k in range(width, n - width)
        if change[k] > limit and change[k] == np.max(change[max(k - width, 0) : k + width + 1])
    )


def description(time: Float[np.ndarray, " n"], drive: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n k"]:
    """Orthonormal columns that span a response to the drive: a law of it at once, fading powers of it, and a slope."""
    e = (drive - drive[0]) / (float(np.max(np.abs(drive - drive[0]))) or 1.0)
    powers = np.stack([e**power for power in POWERS], 1)
    faded = [fading(time, powers, tau) for tau in fades(time)]
    columns = np.concatenate([(time - time[0])[:, None], law(e), *faded], axis=1)
    u, s, _ = np.linalg.svd(columns / np.linalg.norm(columns, axis=0).clip(1e-300), full_matrices=False)
    return u[:, s > 1e-6 * s[0]]


def law(e: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n k"]:
    """Cubic B-splines over the range of e, which hold every polynomial to the third power; ones where e is constant."""
    from scipy.interpolate import BSpline  # it takes a while to load, and few recordings come without a level

    low, high = float(np.min(e)), float(np.max(e))
    if high <= low:
        return np.ones((len(e), 1))
    pieces = int(np.clip(len(e) // EACH, *PIECES))
    knots = np.concatenate([[low] * 3, np.linspace(low, high, pieces + 1), [high] * 3])
    return BSpline.design_matrix(e, knots, 3).toarray()


def fades(time: Float[np.ndarray, " n"]) -> Float[np.ndarray, " m"]:
    """Times over which the response forgets, s, the longest first: to where the sampling is finest."""
    span = float(time[-1] - time[0])
    shortest = min(SHORTEST * span, SEEN * finest([time]))
    steps = max(math.ceil(math.log(LONGEST * span / shortest) / math.log(APART)), 1)
    return np.geomspace(LONGEST * span, shortest, steps + 1)


def fading(time: Float[np.ndarray, " n"], x: Float[np.ndarray, "n k"], tau: float) -> Float[np.ndarray, "n k"]:
    """Part of x that was imposed within about tau: increments that fade; exact between samples of a straight x."""
    step = np.maximum(np.diff(time) / tau, 1e-12)
    kept = np.exp(-step)
    fresh = np.diff(x, axis=0) * (-np.expm1(-step) / step)[:, None]
    out = np.zeros_like(x)
    for k in range(len(step)):
        out[k + 1] = kept[k] * out[k] + fresh[k]
    return out


def levels(responses: Sequence[Response]) -> list[Level]:
    """Noise of several series of one sensor, whose noise has one shape as far as they tell."""
    long = [i for i, r in enumerate(responses) if len(r.time) >= LEAST]
    steps = [resolution(r.values) for r in responses]
    found = [Level(rough(r.values), resolution=s, short=True) for r, s in zip(responses, steps)]
    series, taken = [], []
    for i in long:
        r = responses[i]
        u = description(r.time, r.drive)
        left = r.values - u @ (u.T @ r.values)
        unit = max(rough(r.values), 1e-3 * float(np.std(left))) or 1.0
        series.append(Series(r.time, left[:, None] / unit, kinks(r.time, r.drive)))
        taken.append((u, unit, float(np.std(left))))
    estimated = estimate(series, recorded=False)
    for i, noise, level, (u, unit, left) in zip(long, estimated.noises, estimated.levels, taken):
        time = responses[i].time
        lost = float(np.sum((noise.covariance(time) @ u) * u)) / len(time)  # of the variance, in the description
        std = unit * level / math.sqrt(max(1 - lost, 0.25))
        found[i] = Level(std, noise, left, steps[i])
    floor = [s / math.sqrt(12) for s in steps]
    return [Level(max(f.std, q), f.noise, f.left, f.resolution, f.short) for f, q in zip(found, floor)]

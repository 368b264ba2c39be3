"""Happenings that no catalogue of effects lists: the right answer to these is "unexplained".

Each takes what was recorded without it and an `amount`; `where` are numbers drawn for the case.
"""

import numpy as np
from jaxtyping import Float

from tissuejax.challenge.specimen import Trial

History = Float[np.ndarray, "n ..."]


def first_hold(trial: Trial) -> float:
    """When the first hold away from rest begins, s; the middle of the recording if it has none."""
    drive = trial.strain if trial.strain.ndim == 1 else trial.strain[:, 0]
    still = (np.abs(np.diff(drive)) < 1e-9) & (np.abs(drive[1:]) > 0.02)
    return trial.time[1 + np.argmax(still)] if still.any() else trial.time[len(drive) // 2]


def slip_event(trial: Trial, amount: float, where: float) -> History:
    """Change of the driven strain: the grip lets go by `amount` at a share `where` of the recording's loaded part."""
    strain = trial.strain if trial.strain.ndim == 1 else trial.strain[:, 0]
    loaded = np.flatnonzero(np.abs(strain) > 0.3 * np.abs(strain).max())
    at = loaded[int(where * (len(loaded) - 1))]
    after = np.arange(len(trial.time)) >= at
    return -np.sign(strain[at]) * amount * after


def stepped(P: History, amount: float) -> History:
    """Coarse converter: steps of `amount`, Pa."""
    return amount * np.round(P / amount)


def torn(trial: Trial, P: History, amount: float, at: float) -> History:
    """A region of the specimen tears once, `at` s after the first recording began: it bears no load from then on."""
    gone = trial.time + trial.start >= at
    return P * (1 - amount * gone).reshape(-1, *([1] * (P.ndim - 1)))


def shock(trial: Trial, amount: float, at: float, time: float) -> Float[np.ndarray, " n"]:
    """Shift of a load cell that is warmed at once and cools: rises to `amount` (Pa) within `time` s, then decays."""
    since = np.maximum(trial.time + trial.start - at, 0) / time
    return amount * since * np.exp(1 - since)


def cured(trial: Trial, P: History, amount: float, time: float) -> History:
    """Links that form once the specimen is held: stress grows by up to `amount` from the first hold on."""
    t = np.maximum(trial.time - first_hold(trial), 0)
    return P * (1 - amount * np.expm1(-t / time)).reshape(-1, *([1] * (P.ndim - 1)))


def skipped(trial: Trial, P: History, amount: float, where: float) -> History:
    """A block of `amount` seconds lost by the force's recorder: what follows is shown too early, the end repeats."""
    t = trial.time
    at = t[0] + where * (t[-1] - t[0])
    source = np.where(t < at, t, np.minimum(t + amount, t[-1]))
    columns = P.reshape(len(t), -1)
    return np.stack([np.interp(source, t, c) for c in columns.T], -1).reshape(P.shape)


def flicker(P: History, amount: float, rng: np.random.Generator) -> History:
    """Supply of the bridge that trembles: every reading is off by a share of itself, `amount` in root mean square."""
    return P * (1 + amount * rng.normal(size=len(P))).reshape(-1, *([1] * (P.ndim - 1)))


def frozen(trial: Trial, P: History, amount: float, where: float) -> History:
    """Recorder that keeps its last reading for `amount` seconds, from a share `where` of the recording on."""
    t = trial.time
    at = t[0] + where * (t[-1] - t[0])
    source = np.where((t >= at) & (t < at + amount), np.searchsorted(t, at), np.arange(len(t)))
    return P[source]


def stick_slip(trial: Trial, amount: float, travel: float) -> History:
    """Sawtooth of `amount` (Pa) over every `travel` of strain while moving, in the sense of the motion."""
    strain = trial.strain if trial.strain.ndim == 1 else trial.strain[:, 0]
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(strain)))])
    motion = np.sign(np.gradient(strain))
    tooth = amount * (np.mod(way / travel, 1.0) - 0.5) * motion
    return tooth if trial.drive.ndim == 1 else np.stack([tooth, tooth], -1)


def spikes(n: int, amount: float, share: float, rng: np.random.Generator) -> Float[np.ndarray, " n"]:
    """Electrical spikes of either sign and about `amount` (Pa) at a share of the samples."""
    hit = rng.random(n) < share
    return hit * rng.normal(0, amount, n)


def slew(trial: Trial, P: History, amount: float) -> History:
    """Amplifier whose output can't change faster than the quickest change of this recording over `1 + amount`."""
    columns, out = P.reshape(len(P), -1), []
    for c in columns.T:
        step = np.diff(trial.time) * np.max(np.abs(np.diff(c) / np.diff(trial.time))) / (1 + amount)
        follows = [c[0]]
        for wanted, most in zip(c[1:], step, strict=True):
            follows.append(follows[-1] + np.clip(wanted - follows[-1], -most, most))
        out.append(follows)
    return np.array(out).T.reshape(P.shape)


def bumped(trial: Trial, amount: float, at: float, period: float) -> Float[np.ndarray, " n"]:
    """Ringing of a frame that somebody bumps `at` s after the first recording began: dies out within five periods."""
    since = np.maximum(trial.time + trial.start - at, 0) / period
    return amount * np.exp(-since / 5) * np.sin(2 * np.pi * since)

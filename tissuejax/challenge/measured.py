"""What the rig makes of a true stress: mixed sampling, noise drawn in seconds, a stated level that may be wrong."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from tissuejax.challenge.specimen import Trial


@dataclass(frozen=True)
class Sensor:
    """How a case is measured.

    Attributes:
        std: of the noise, Pa.
        share: of its variance that is correlated; 0 is white.
        time: correlation time of that part, s (Ornstein-Uhlenbeck).
        stated: what the file says of it, Pa; None says nothing.
    """

    std: float
    share: float
    time: float
    stated: float | None


def sensor(rng: np.random.Generator, std: float) -> Sensor:
    """White in half of the cases; stated rightly, wrongly by up to a factor of two, or not at all, a third each."""
    share = float(rng.uniform(0.3, 0.9)) if rng.random() < 0.5 else 0.0
    turn = rng.integers(3)
    wrong = float(np.exp(rng.uniform(-np.log(2), np.log(2))))
    stated = [std, std * wrong, None][turn]
    return Sensor(std, share, float(np.exp(rng.uniform(np.log(0.1), np.log(1.5)))), stated)


def noise(rng: np.random.Generator, s: Sensor, time: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """White and Ornstein-Uhlenbeck noise on any sampling, Pa (exact transition: Uhlenbeck and Ornstein 1930)."""
    white = rng.standard_normal(len(time))
    if s.share == 0:
        return s.std * white
    drive, slow = rng.standard_normal(len(time)), np.empty(len(time))
    slow[0] = drive[0]
    for i, dt in enumerate(np.diff(time)):
        rho = np.exp(-dt / s.time)
        slow[i + 1] = rho * slow[i] + np.sqrt(1 - rho**2) * drive[i + 1]
    return s.std * (np.sqrt(1 - s.share) * white + np.sqrt(s.share) * slow)


def kept_rows(rng: np.random.Generator, trial: Trial) -> Int[np.ndarray, " k"]:
    """Rows that the recorder keeps: all, every second or fifth, or in holds ever fewer (a logarithmic scheme)."""
    n = len(trial.time)
    scheme = rng.choice(["all", "second", "fifth", "sparse holds"], p=[0.4, 0.2, 0.15, 0.25])
    if scheme != "sparse holds":
        return np.arange(0, n, {"all": 1, "second": 2, "fifth": 5}[str(scheme)])
    strain = trial.strain if trial.strain.ndim == 1 else trial.strain[:, 0]
    moving = np.concatenate([[True], np.abs(np.diff(strain)) > 1e-9])
    since, keep, following = 0, [], 0
    for i in range(n):
        since = 0 if moving[i] else since + 1
        if since == 0:
            following = 1
            keep.append(i)
        elif since >= following:
            keep.append(i)
            following = int(np.ceil(1.3 * since + 1))
    return np.array(keep)


def sampled(trial: Trial, rows: Int[np.ndarray, " k"]) -> Trial:
    """The trial at these rows alone."""
    return replace(trial, time=trial.time[rows], drive=trial.drive[rows])

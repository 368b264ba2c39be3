"""How large an effect is once the base model has been refitted to swallow what it can, in units of the noise."""

from collections.abc import Callable

import numpy as np

from tissuejax.challenge.material import Specimen, reported
from tissuejax.challenge.specimen import Trial
from tissuejax.challenge.strain_laws import Body

TOLD = {
    "reduced-polynomial-2": ("10", "20"),
    "mooney-rivlin": ("10", "01"),
    "neo-hookean": ("10",),
}


def columns(energy: str, trials: list[Trial]) -> list[np.ndarray]:
    """Stress of each of the told energy's coefficients at 1 Pa, all samples of all trials in one column each."""
    unit = [Specimen(Body({term: 1.0})) for term in TOLD[energy]]
    return [np.concatenate([reported(one, t).ravel() for t in trials]) for one in unit]


def beyond(energy: str, trials: list[Trial], stresses: list[np.ndarray], noise: float) -> float:
    """Rms of what the told energy, refitted by least squares to `stresses`, leaves, over the noise.

    Args:
        stresses: noise-free stress of each trial, Pa.
        noise: standard deviation, Pa.
    """
    A = np.stack(columns(energy, trials), -1)
    b = np.concatenate([s.ravel() for s in stresses])
    best, *_ = np.linalg.lstsq(A, b, rcond=None)
    return float(np.sqrt(np.mean((b - A @ best) ** 2)) / noise)


def reach(size: Callable[[float], float], target: float, least: float, most: float) -> tuple[float, float]:
    """Amount within its range whose size is nearest to `target`, and that size; secant steps in logarithms.

    Args:
        size: size of the effect by amount, nearly a power law.
    """
    low, high = np.log(least), np.log(most)
    x = high
    y = np.log(max(size(np.exp(x)), 1e-12))
    if y <= np.log(target):
        return float(np.exp(x)), float(np.exp(y))
    slope = 1.0
    for _ in range(12):
        new = float(np.clip(x + (np.log(target) - y) / slope, low, high))
        if new == x:
            break
        after = np.log(max(size(np.exp(new)), 1e-12))
        slope = float(np.clip((after - y) / (new - x), 0.3, 4.0))
        x, y = new, after
        if abs(y - np.log(target)) < 0.03:
            break
    return float(np.exp(x)), float(np.exp(y))

"""Noise levels of a sample's recordings: as recorded, or from what no smooth response could be."""

import numpy as np
from jaxtyping import Float

from tissuejax.recordings.recording import Sample

THIRD = np.array([1.0, -3.0, 3.0, -1.0])


def rough(y: Float[np.ndarray, " n"]) -> float:
    """Standard deviation of white noise on a smooth series: from third differences, by their median.

    Source: Gasser, Sroka and Jennen-Steinmetz 1986, Biometrika 73 (difference-based variance estimates).
    """
    d = np.convolve(y, THIRD, "valid") / np.sqrt(np.sum(THIRD**2))
    return float(np.median(np.abs(d)) / 0.6745) if len(d) else 0.0


def sigmas(
    sample: Sample, names: tuple[str, ...], channel: str = "nominal_stress"
) -> tuple[dict[str, float], list[str]]:
    """Noise standard deviation of each recording, and remarks where it had to be estimated."""
    out, guessed = {}, []
    for name in names:
        c = sample.recordings[name].channels[channel]
        if c.noise_std:
            out[name] = float(c.noise_std)
            continue
        y = np.asarray(c.values, float).reshape(len(c.time), -1)
        size = float(np.sqrt(np.mean(y**2))) or 1.0
        out[name] = max(float(np.mean([rough(y[:, i]) for i in range(y.shape[1])])), 1e-3 * size)
        guessed.append(f"{name} {out[name]:.3g} {c.unit}")
    if guessed:
        return out, [f"noise was not recorded and is estimated from third differences: {', '.join(guessed)}"]
    return out, []

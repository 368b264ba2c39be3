"""The misfit of a prediction: residuals over noise, whitened, and what would be left of pure noise."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.bench import Bench, Segment
from tissuejax.diagnosis.noise import Noise, estimate


@dataclass(frozen=True)
class Misfit:
    """Whitens long vectors of a bench, segment by segment, with one noise a channel.

    Attributes:
        bench: the sample on the table.
        noises: by channel.
    """

    bench: Bench
    noises: dict[str, Noise]

    def rows(self, recordings: Sequence[str]) -> list[Segment]:
        """Segments of `recordings`."""
        return [s for s in self.bench.segments if s.recording in recordings]

    def whiten(self, x: Float[np.ndarray, "N ..."], recordings: Sequence[str]) -> Float[np.ndarray, "M ..."]:
        """x over sigma, whitened, rows of `recordings` only, stacked in the order of the segments."""
        sigma = self.bench.sigma
        parts = [self._white(x, s, sigma) for s in self.rows(recordings)]
        return np.concatenate(parts) if parts else np.zeros((0, *x.shape[1:]))

    def _white(self, x: np.ndarray, s: Segment, sigma: np.ndarray) -> np.ndarray:
        scaled = x[s.rows] / sigma[s.rows].reshape(-1, *([1] * (x.ndim - 1)))
        return self.noises[s.channel].whiten(scaled)

    def residual(self, prediction: Float[np.ndarray, " N"], recordings: Sequence[str]) -> Float[np.ndarray, " M"]:
        """Whitened (measured - predicted)."""
        return self.whiten(self.bench.y - prediction, recordings)

    def effective(self, recordings: Sequence[str]) -> float:
        """Number of independent samples, for smooth signals."""
        return sum(len(s.time) / self.noises[s.channel].inflation for s in self.rows(recordings))

    def count(self, recordings: Sequence[str]) -> int:
        """Number of samples."""
        return sum(len(s.time) for s in self.rows(recordings))


def white(bench: Bench) -> Misfit:
    """The misfit under white noise."""
    return Misfit(bench, {s.channel: Noise() for s in bench.segments})


def estimated(bench: Bench, prediction: Float[np.ndarray, " N"]) -> Misfit:
    """The misfit under noise whose correlation is estimated from the residuals of all recordings."""
    noises = {}
    for channel in dict.fromkeys(s.channel for s in bench.segments):
        blocks: dict[str, list[np.ndarray]] = {}
        for s in bench.segments:
            if s.channel == channel:
                r = (bench.y[s.rows] - prediction[s.rows]) / bench.sigma[s.rows]
                blocks.setdefault(f"{s.recording}/{len(r)}", []).append(r)
        noises[channel] = estimate([np.stack(b, axis=1) for b in blocks.values()])
    return Misfit(bench, noises)

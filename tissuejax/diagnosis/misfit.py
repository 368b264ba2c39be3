"""The misfit of a prediction: residuals over noise, whitened, and what would be left of pure noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.bench import Bench
from tissuejax.estimation.correlation import Series, estimate
from tissuejax.estimation.noise import Noise
from tissuejax.estimation.series import Segment

WHITE = Noise()
Place = tuple[str, str]  # recording, channel


@dataclass(frozen=True)
class Misfit:
    """Whitens long vectors of a bench, segment by segment.

    Attributes:
        bench: the sample on the table.
        noises: by recording and channel, in units of the recorded standard deviation; white where none is named.
    """

    bench: Bench
    noises: Mapping[Place, Noise] = field(default_factory=dict)

    def rows(self, recordings: Sequence[str]) -> list[Segment]:
        """Segments of `recordings`."""
        return [s for s in self.bench.segments if s.recording in recordings]

    def noise(self, s: Segment) -> Noise:
        """The noise of a segment."""
        return self.noises.get((s.recording, s.channel), WHITE)

    def white(self, x: Float[np.ndarray, "n ..."], s: Segment) -> Float[np.ndarray, "n ..."]:
        """A segment's series, over sigma already, whitened."""
        return self.noise(s).whiten(x, s.time)

    def whiten(self, x: Float[np.ndarray, "N ..."], recordings: Sequence[str]) -> Float[np.ndarray, "M ..."]:
        """x over sigma, whitened, rows of `recordings` only, stacked in the order of the segments."""
        sigma = self.bench.sigma.reshape(-1, *([1] * (x.ndim - 1)))
        parts = [self.white(x[s.rows] / sigma[s.rows], s) for s in self.rows(recordings)]
        return np.concatenate(parts) if parts else np.zeros((0, *x.shape[1:]))

    def residual(self, prediction: Float[np.ndarray, " N"], recordings: Sequence[str]) -> Float[np.ndarray, " M"]:
        """Whitened (measured - predicted)."""
        return self.whiten(self.bench.y - prediction, recordings)

    def count(self, recordings: Sequence[str]) -> int:
        """Number of samples."""
        return sum(len(s.time) for s in self.rows(recordings))


def white(bench: Bench) -> Misfit:
    """The misfit under white noise."""
    return Misfit(bench)


def estimated(bench: Bench, prediction: Float[np.ndarray, " N"]) -> Misfit:
    """The misfit under noise whose correlation in time is estimated from the residuals of the fitted recordings.

    Behind a low-pass of second order noise is told from a mismatch by its level, so only where one was recorded.
    Held-out recordings take no part; theirs is that of the fitted ones, of the longest where these differ.
    """
    noises = {}
    for channel in dict.fromkeys(s.channel for s in bench.segments):
        blocks: dict[str, list[Segment]] = {}
        for s in bench.segments:
            if s.channel == channel and s.recording in bench.fitted:
                blocks.setdefault(s.recording, []).append(s)
        alike = ([s for s in own if len(s.time) == len(own[0].time)] for own in blocks.values())
        series = [
            Series(own[0].time, np.stack([(bench.y - prediction)[s.rows] / bench.sigma[s.rows] for s in own], axis=1))
            for own in alike
        ]
        found = estimate(series, orders=(1,) if bench.estimated else (1, 2))
        noises |= {(name, channel): noise for name, noise in zip(blocks, found.noises, strict=True)}
        if blocks:
            longest = max(blocks, key=lambda name: len(blocks[name][0].time))
            noises |= {(name, channel): noises[longest, channel] for name in bench.held_out}
    return Misfit(bench, noises)

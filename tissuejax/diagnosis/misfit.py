"""The misfit of a prediction: residuals over noise, whitened, and what would be left of pure noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.bench import Bench, Segment
from tissuejax.estimation.correlation import Series, estimate
from tissuejax.estimation.noise import Noise

WHITE = Noise()
WRONG = 1.2  # white noise over the recorded level from which the recorded one is not believed; few know theirs better
Place = tuple[str, str]  # recording, channel


@dataclass(frozen=True)
class Misfit:
    """Whitens long vectors of a bench, segment by segment.

    Attributes:
        bench: the sample on the table.
        noises: by recording and channel, in units of the recorded standard deviation: 1 all in all, or more where the
            residuals hold more white noise than was recorded; white where none is named.
        levels: by recording and channel, the noise's standard deviation over the recorded one as the residuals have
            it, mismatch left aside, where that was estimated.
    """

    bench: Bench
    noises: Mapping[Place, Noise] = field(default_factory=dict)
    levels: Mapping[Place, float] = field(default_factory=dict)

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

    def effective(self, recordings: Sequence[str]) -> float:
        """Number of independent samples, for smooth signals."""
        return sum(self.noise(s).effective(s.time) for s in self.rows(recordings))

    def count(self, recordings: Sequence[str]) -> int:
        """Number of samples."""
        return sum(len(s.time) for s in self.rows(recordings))

    def differs(self, other: "Misfit") -> bool:
        """Whether the noise of `other` is another one as far as samples of these recordings tell."""
        for s in self.bench.segments:
            if len(s.time) > 1:
                step = float(np.median(np.diff(s.time)))
                one, two = self.noise(s), other.noise(s)
                near = abs(float(one.correlation(step)) - float(two.correlation(step)))
                if near > 0.05 or abs(one.share - two.share) > 0.1 or abs(one.std / two.std - 1) > 0.05:
                    return True
        return False

    def remarks(self) -> list[str]:
        """What is said where white noise exceeds the recorded level."""
        seen = {r: max(level for (name, _), level in self.levels.items() if name == r) for r, _ in self.levels}
        wrong = {r: level for r, level in seen.items() if level > WRONG}
        if not wrong:
            return []
        said = ", ".join(f"{level:.1f} times in {r}" for r, level in wrong.items())
        return [
            f"check the noise level: what is left is white but larger than the recorded noise ({said}), which missing "
            "physics is not; the larger level was used in all that follows"
        ]


def white(bench: Bench) -> Misfit:
    """The misfit under white noise."""
    return Misfit(bench)


def estimated(bench: Bench, prediction: Float[np.ndarray, " N"]) -> Misfit:
    """The misfit under noise whose correlation in time is estimated from the residuals of the fitted recordings.

    Held-out recordings take no part; theirs is that of the fitted ones, of the longest where these differ.
    """
    noises, levels = {}, {}
    for channel in dict.fromkeys(s.channel for s in bench.segments):
        blocks: dict[str, list[Segment]] = {}
        for s in bench.segments:
            if s.channel == channel and s.recording in bench.fitted:
                blocks.setdefault(s.recording, []).append(s)
        series = [
            Series(own[0].time, np.stack([(bench.y - prediction)[s.rows] / bench.sigma[s.rows] for s in own], axis=1))
            for own in blocks.values()
        ]
        found = estimate(series)
        for name, noise, level in zip(blocks, found.noises, found.levels):
            too_large = level > WRONG and noise.share == 0
            noises[name, channel] = noise.scaled(level) if too_large else noise
            levels[name, channel] = level
        if blocks:
            longest = max(blocks, key=lambda name: len(blocks[name][0].time))
            noises |= {(name, channel): noises[longest, channel] for name in bench.held_out}
    return Misfit(bench, noises, levels)

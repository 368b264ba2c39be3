"""Means over blocks of samples: all that was measured, in a hundred numbers a recording.

Neighbouring samples of a slow test say the same but for their noise, so means of blocks lose next to nothing, and a
covariance matrix of all of them stays small. Blocks are short where the specimen moves or its stress changes and long
where nothing happens; they depend on the recordings alone, so that all models are compared on the same numbers.
"""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.judgement.particular import MEANS, Means
from tissuejax.estimation.discrepancy import Series, loading_states
from tissuejax.estimation.series import Segment
from tissuejax.estimation.smoothness import USUAL, Smoothness


@dataclass(frozen=True)
class Blocks:
    """Blocks of every segment of a bench.

    Attributes:
        starts: first row of each block in the long vector, in order.
        counts: samples in each.
        owner: index of the segment of each block.
    """

    starts: np.ndarray
    counts: np.ndarray
    owner: np.ndarray

    def mean(self, x: Float[np.ndarray, "N ..."]) -> Float[np.ndarray, "M ..."]:
        """Means over the blocks."""
        return np.add.reduceat(x, self.starts, axis=0) / self.counts.reshape(-1, *([1] * (x.ndim - 1)))

    def spread(self, sigma: Float[np.ndarray, " N"]) -> Float[np.ndarray, " M"]:
        """Standard deviation of the means, where samples have independent errors of `sigma`."""
        return np.sqrt(np.add.reduceat(sigma**2, self.starts)) / self.counts


@dataclass(frozen=True)
class State:
    """Strain of a segment at every sample.

    Attributes:
        mode: segments of one mode share what a law lacks: where the strain is the same, so is its share of the stress.
        strain: ln stretch or amount of shear, in columns.
    """

    mode: Hashable
    strain: Float[np.ndarray, "n k"]


def path(x: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Length of the way so far, 0 to 1; even steps where there is none."""
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(x)))])
    return way / way[-1] if way[-1] > 0 else np.linspace(0, 1, len(x))


def smoothed(y: Float[np.ndarray, " n"], knots: int) -> Float[np.ndarray, " n"]:
    """y between means of at most so many pieces."""
    edges = np.unique(np.linspace(0, len(y), min(knots, len(y)) + 1).astype(int))
    means = np.add.reduceat(y, edges[:-1]) / np.diff(edges)
    return np.interp(np.arange(len(y)), 0.5 * (edges[:-1] + edges[1:] - 1), means)


def blocks(bench: Bench, several: Mapping[str, int] | None = None, means: Means = MEANS) -> Blocks:
    """Blocks of all segments: `several` of each channel's, by default as many as `means` says."""
    usual = int(np.clip(means.whole // max(len(bench.segments), 1), means.least, means.most))
    starts, owner = [], []
    for k, s in enumerate(bench.segments):
        n = len(s.time)
        wanted = min((several or {}).get(s.channel, usual), n)
        way = (np.linspace(0, 1, n) + path(s.drive) + path(smoothed(bench.y[s.rows], means.knots))) / 3
        which = np.minimum((way * wanted).astype(int), wanted - 1) if wanted < n else np.arange(n)
        first = np.flatnonzero(np.diff(which, prepend=-1))
        starts.append(s.rows.start + first)
        owner += [k] * len(first)
    flat = np.concatenate(starts)
    return Blocks(flat, np.diff(np.append(flat, len(bench.y))), np.array(owner))


def series(
    bench: Bench,
    cut: Blocks,
    states: Sequence[State],
    smooth: Smoothness = USUAL,
    means: Means = MEANS,
    starts: Mapping[str, float] | None = None,
) -> list[Series]:
    """The blocks as the discrepancy sees them.

    Args:
        states: of each segment (`driven_states`, or those of a bench that knows more).
        smooth: how a loading state turns; means: what a typical largest stress is.
        starts: when recordings began, s on the session's clock, where that is known.
    """
    out = []
    for k, (s, state) in enumerate(zip(bench.segments, states, strict=True)):
        own = Blocks(cut.starts[cut.owner == k] - s.rows.start, cut.counts[cut.owner == k], np.zeros(0, int))
        peaks = [np.quantile(np.abs(bench.y[o.rows]), means.peak) for o in bench.segments if o.recording == s.recording]
        out.append(
            Series(
                s.recording,
                state.mode,
                own.mean(s.time),
                own.mean(state.strain),
                own.mean(loading_states(strain(s), smooth)),
                float(max(peaks)) or 1.0,
                (starts or {}).get(s.recording, 0.0),
                float(np.median(np.diff(s.time))) if len(s.time) > 1 else 0.0,
            )
        )
    return out


def driven_states(bench: Bench) -> list[State]:
    """Strains as they were driven; recordings of a bench share what a law lacks, component by component."""
    return [
        State(s.component, np.stack([strain(o) for o in bench.segments if o.recording == s.recording], axis=1))
        for s in bench.segments
    ]


def strain(s: Segment) -> Float[np.ndarray, " n"]:
    """ln stretch, or the amount of shear."""
    return np.log(s.drive) if s.drive_name == "stretch" else s.drive

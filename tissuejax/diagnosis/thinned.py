"""A search's bench of material tests: pieces of every block in place of samples, right where a fit comes to rest.

A search compares block means, so what happens within a block matters to it by its mean alone. Predicting every sample
of slow recordings to take means of twenty is most of what a search would cost. Here a series is cut into pieces, about
two to a block, and more where the specimen is moved far in one; a prediction is made of the pieces' mean times and
stretches. What is lacking then is added where a fit begins and where it comes to rest (`Bench.anchored`): evidence is
that of the whole series, slopes are those of the pieces.

A hum is predicted in full, for it turns within a piece, and so is what acts within some samples (`Effect.brief`).
"""

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from tissuejax.cache.programs import Kept
from tissuejax.diagnosis.judgement.blocks import Blocks, path
from tissuejax.diagnosis.material import MaterialBench, Program
from tissuejax.diagnosis.padding import lengthened, lengths
from tissuejax.effects.material_test import MaterialTest

FAR = 0.04  # of a recording's range: how far a specimen is moved within a piece, twice that at most
USUAL = 1.8  # pieces of a block
WORTHWHILE = 0.6  # of all samples: what pieces have to stay below


class ThinnedBench(MaterialBench):
    """See the module's text. What a prediction lacks, `lacking`, is nothing until it is anchored."""

    def __init__(self, whole: MaterialBench, pieces: Mapping[str, Int[np.ndarray, " p"]]):
        """
        Args:
            whole: with all samples; pieces: first sample of every piece, by recording.
        """
        vars(self).update(vars(whole))  # sample, model and candidates are the same
        # asked for once a fit, so one length serves all recordings: one program more is to be compiled, not several
        self.whole = copy.copy(whole)
        longest = max(len(t.time) for t in whole._tests.values())
        self.whole._lay({n: lengthened(t, longest) for n, t in whole._tests.items()})
        self.lacking = np.zeros(len(whole.y))
        ends = {n: [*p, len(whole._of[n][0].time)] for n, p in pieces.items()}
        self._counts = {n: np.diff(e) for n, e in ends.items()}
        thin = {n: averaged(whole._tests[n], p, self._counts[n]) for n, p in pieces.items()}
        to = lengths([len(p) for p in pieces.values()])
        self._lay({n: lengthened(t, k) for (n, t), k in zip(thin.items(), to, strict=True)})
        within = (c for c in self.candidates.values() if c.spectral is not None or c.brief)
        self._within = frozenset(p for c in within for p in c.paths)

    def _in_full(self, values: Mapping[str, float]) -> bool:
        return not self._within.isdisjoint(values)

    def predict(self, values: Mapping[str, float], recordings: Sequence[str] | None = None) -> Float[np.ndarray, " N"]:
        """See `Bench.predict`."""
        if self._in_full(values):
            return self.whole.predict(values, recordings)
        return super().predict(values, recordings) + self.lacking

    def jacobian(
        self, values: Mapping[str, float], paths: Sequence[str], recordings: Sequence[str] | None = None
    ) -> Float[np.ndarray, "N k"]:
        """See `Bench.jacobian`."""
        if self._in_full({**values, **dict.fromkeys(paths)}):
            return self.whole.jacobian(values, paths, recordings)
        return super().jacobian(values, paths, recordings)

    def columns(
        self, values: Mapping[str, float], settings: Sequence[tuple[Mapping[str, float], str]]
    ) -> Float[np.ndarray, "N k"]:
        """See `Bench.columns`."""
        full = np.array([self._in_full({**values, **setting, path: 0.0}) for setting, path in settings])
        out = np.zeros((len(self.y), len(settings)))
        for these, of in ((full, self.whole.columns), (~full, super().columns)):
            if these.any():
                out[:, these] = of(values, [s for s, here in zip(settings, these, strict=True) if here])
        return out

    def anchored(self, values: Mapping[str, float]) -> "ThinnedBench":
        """See `Bench.anchored`."""
        if self._in_full(values):
            return self
        near = copy.copy(self)
        near.lacking = self.whole.predict(values) - MaterialBench.predict(self, values)
        return near

    def _calls(self, program: Program) -> list[tuple[Kept, tuple]]:
        return super()._calls(program) + self.whole._calls(program)

    def _put(self, out: Float[np.ndarray, " N"], name: str, stress: Float[np.ndarray, "n ..."]) -> None:
        pieces = self._counts[name]
        super()._put(out, name, np.repeat(stress[: len(pieces)], pieces, axis=0))


def averaged(test: MaterialTest, pieces: Int[np.ndarray, " p"], counts: Int[np.ndarray, " p"]) -> MaterialTest:
    """A test with the mean time and drive of every piece."""

    def mean(series: np.ndarray) -> np.ndarray:
        total = np.add.reduceat(series[: np.sum(counts)], pieces, axis=0)
        return total / counts.reshape(-1, *([1] * (series.ndim - 1)))

    return replace(test, time=mean(np.asarray(test.time)), drive=mean(np.asarray(test.drive)))


def thinned(bench: MaterialBench, cut: Blocks) -> MaterialBench:
    """The bench with pieces in place of samples; itself where they would hardly be fewer."""
    pieces = {n: _pieces(bench, cut, n) for n in bench._tests}
    before = sum(len(t.time) for t in bench._tests.values())
    if sum(lengths([len(p) for p in pieces.values()])) > WORTHWHILE * before:
        return bench
    return ThinnedBench(bench, pieces)


def _pieces(bench: MaterialBench, cut: Blocks, name: str) -> Int[np.ndarray, " p"]:
    """First samples of a recording's pieces. The first sample is one of its own: a history begins there."""
    segments = bench._of[name]
    n = len(segments[0].time)
    mine = [(i, s.rows.start) for i, s in enumerate(bench.segments) if s.recording == name]
    starts = np.unique(np.concatenate([[0], *(cut.starts[cut.owner == i] - first for i, first in mine)]))
    counts = np.diff([*starts, n])
    ways = [np.concatenate([[0.0], np.cumsum(np.abs(np.diff(s.drive)))]) / (np.ptp(s.drive) or 1.0) for s in segments]
    moved = [np.diff(np.append(way[starts], way[-1])) for way in ways]
    wanted = np.clip(np.ceil(np.max(moved, axis=0) / FAR).astype(int), 1, counts)
    most = lengths([max(math.ceil(USUAL * len(starts)), int(np.sum(wanted)) + 1)])[0] - 1
    while np.sum(wanted) < min(most, n):  # what there is room for goes to the longest
        wanted[np.argmax(counts / wanted - (counts == wanted) * n)] += 1
    along = (np.arange(n) / n + np.mean([path(way) for way in ways], axis=0)) / 2
    edges = {0, 1}
    for a, count, k in zip(starts, counts, wanted, strict=True):
        here = along[a : a + count]
        way = (here - here[0]) / ((here[-1] - here[0]) or 1.0) * (count - 1) / count
        edges |= set((a + np.flatnonzero(np.diff((way * k).astype(int), prepend=-1))).tolist())
    return np.array(sorted(edges))

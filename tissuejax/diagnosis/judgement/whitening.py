"""Residuals of block means under noise and discrepancy, in the form that scores and refits take (`misfit.Misfit`)."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float
from scipy.linalg import cholesky, solve_triangular

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.judgement.blocks import Blocks
from tissuejax.diagnosis.judgement.marginal import Blocked, smooth
from tissuejax.estimation.discrepancy import Part


@dataclass
class Whitening:
    """x -> K^-1/2 (means of x over blocks), for the recordings that are asked for.

    K = L L' + U U' with L block-diagonal: with A S B' = L^-1 U, K^-1/2 = (1 - A (1 - 1/sqrt(1 + S^2)) A') L^-1.

    Attributes:
        parts, v: of the discrepancy, and their squared amplitudes.
        named: families of parts that belong to the model: they are the business of an effect that has a name.
    """

    bench: Bench
    cut: Blocks
    blocked: Blocked
    parts: Sequence[Part]
    v: Float[np.ndarray, " K"]
    named: frozenset[str] = frozenset()
    _roots: dict = field(default_factory=dict, repr=False)

    def _root(self, recordings: tuple[str, ...]):
        if recordings not in self._roots:
            members = [i for i, s in enumerate(self.bench.segments) if s.recording in recordings]
            blocks = self.blocked.within(self.parts, self.v)
            lower = [cholesky(blocks[i], lower=True, check_finite=False) for i in members]
            rows = [self.blocked.rows[i] for i in members]
            u = smooth(self.parts, self.v)
            light = [solve_triangular(c, u[r], lower=True, check_finite=False) for c, r in zip(lower, rows)]
            a, s, _ = np.linalg.svd(np.concatenate(light), full_matrices=False)
            self._roots[recordings] = lower, rows, a, 1 - 1 / np.hypot(1.0, s)
        return self._roots[recordings]

    def whiten(self, x: Float[np.ndarray, "N ..."], recordings: Sequence[str]) -> Float[np.ndarray, "M ..."]:
        """Whitened block means of x, a long vector or several as columns."""
        if not recordings:
            return np.zeros((0, *x.shape[1:]))
        return self.whiten_means(self.cut.mean(x), tuple(recordings))

    def whiten_means(
        self, m: Float[np.ndarray, "M ..."], recordings: tuple[str, ...] = ()
    ) -> Float[np.ndarray, "m ..."]:
        """The same of what is block means already; of all recordings by default."""
        lower, rows, a, taken = self._root(recordings or self.bench.fitted)
        light = np.concatenate(
            [solve_triangular(c, m[r], lower=True, check_finite=False) for c, r in zip(lower, rows, strict=True)]
        )
        inner = a.T @ light
        return light - a @ (taken.reshape(-1, *([1] * (inner.ndim - 1))) * inner)

    def residual(self, prediction: Float[np.ndarray, " N"], recordings: Sequence[str]) -> Float[np.ndarray, " M"]:
        """Whitened (measured - predicted)."""
        return self.whiten(self.bench.y - prediction, recordings)

    def count(self, recordings: Sequence[str]) -> int:
        """Number of blocks."""
        return sum(
            r.stop - r.start
            for r, s in zip(self.blocked.rows, self.bench.segments, strict=True)
            if s.recording in recordings
        )

"""Noise that is correlated in time, as the block means of a judgement see it.

A noise level, recorded or estimated, is that of single samples, and says nothing of how much of it a filter or an
amplifier carries from one to the next. Taken for white, what is carried would be left over in means of many samples and
be called a rest. So the share that is correlated, and its time, are read from the residual of a model (of the
base first) beside whatever mismatch it holds (`estimation.correlation`); the level stays what it was.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.judgement.blocks import Blocks
from tissuejax.diagnosis.judgement.marginal import Blocked
from tissuejax.diagnosis.misfit import Misfit, estimated
from tissuejax.estimation.noise import Noise
from tissuejax.estimation.series import Segment


def coloured(blocked: Blocked, bench: Bench, cut: Blocks, prediction: Float[np.ndarray, " N"]) -> Blocked | None:
    """The same blocks under the noise that the residual of `prediction` shows; None where that is white as before."""
    if bench.costly:
        return None
    misfit = estimated(bench, prediction)
    if all(misfit.noise(s).is_white(s.time) for s in bench.segments):
        return None
    noise = tuple(_segment(bench, cut, misfit, i, s) for i, s in enumerate(bench.segments))
    return replace(blocked, sigma=np.sqrt(np.concatenate([np.diag(n) for n in noise])), noise=noise)


def shown(blocked: Blocked, bench: Bench, cut: Blocks, prediction: Float[np.ndarray, " N"]) -> Blocked:
    """The same blocks under the noise that the residual of `prediction` shows, white or not."""
    noise = coloured(blocked, bench, cut, prediction)
    return replace(blocked, sigma=cut.spread(bench.sigma), noise=None) if noise is None else noise


def _segment(bench: Bench, cut: Blocks, misfit: Misfit, i: int, s: Segment) -> Float[np.ndarray, "M M"]:
    mine = cut.owner == i
    starts = cut.starts[mine] - s.rows.start
    return means_covariance(misfit.noise(s).unit, s.time, bench.sigma[s.rows], starts)


def means_covariance(
    noise: Noise, time: Float[np.ndarray, " n"], sigma: Float[np.ndarray, " n"], starts: np.ndarray
) -> Float[np.ndarray, "M M"]:
    """Covariance of means over blocks of samples that begin at `starts`.

    Between blocks the correlation falls apart into what a block has to its end, the time between, and what the other
    has from its beginning: of first order exp(-d) is a product, of second order (1 + d) exp(-d) a sum of three.
    Within a block all pairs are summed.

    Args:
        noise: of unit variance; sigma: its standard deviation at every sample.
    """
    ends = np.append(starts[1:], len(time))
    late, early = np.empty((2, len(starts))), np.empty((2, len(starts)))  # sums of exp(-d) and of d exp(-d)
    own = np.empty(len(starts))
    for k, (a, b) in enumerate(zip(starts, ends, strict=True)):
        t, w = time[a:b], sigma[a:b] / (b - a)
        for sums, d in ((late, (t[-1] - t) / noise.tau), (early, (t - t[0]) / noise.tau)):
            faded = w * np.exp(-d)
            sums[:, k] = np.sum(faded), np.sum(d * faded)
        own[k] = np.sum(w * noise.times(w, t))
    gap = time[starts][None, :] - time[ends - 1][:, None]  # from the end of one to the beginning of another
    gap = np.maximum(gap, 0.0) / noise.tau
    alike = np.outer(late[0], early[0])
    if noise.order == 2:
        alike = (1 + gap) * alike + np.outer(late[1], early[0]) + np.outer(late[0], early[1])
    upper = np.triu(noise.share * np.exp(-gap) * alike, 1)
    return upper + upper.T + np.diag(own)

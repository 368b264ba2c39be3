"""What a name without parameters predicts: the discrepancy that it widens, as the fitted recordings tell it.

A strain energy of no form in the catalogue, a hysteresis, a stiffness of each specimen's own have no parameters but a
part of the discrepancy that is theirs. Given what the model leaves of the fitted recordings, r = y - f there,

    E[d(all) | r] = sum_k v_k F_k F_k(fitted)' K(fitted)^-1 r,    K = D + sum over all parts of v F F',

k over the parts that the names widen. It reaches a recording held out where kernels do: along strains of one kind of
test, not from specimen to specimen.

Source: Rasmussen and Williams 2006, Gaussian Processes for Machine Learning, eq. 2.25 and sec. 2.7.
"""

import numpy as np
from jaxtyping import Float
from scipy.linalg import block_diag, cho_solve

from tissuejax.diagnosis.judgement.blocks import Blocks
from tissuejax.diagnosis.judgement.marginal import factored
from tissuejax.diagnosis.judgement.whitening import Whitening


def carried(whitening: Whitening, left: Float[np.ndarray, "N k"]) -> Float[np.ndarray, "N k"]:
    """Posterior mean at every sample of what the names of a set widen (`Whitening.named`), from the fitted recordings.

    Args:
        left: what the parameters leave (y - f; or -df/dtheta, for its derivative), of which the fitted recordings'
            rows are read.
    """
    bench, cut, blocked = whitening.bench, whitening.cut, whitening.blocked
    if not whitening.named:
        return np.zeros_like(left)
    parts = [(p, x) for p, x in zip(whitening.parts, whitening.v, strict=True) if x > 0]
    known, within = np.zeros(len(cut.starts), bool), []
    for s, rows, block in zip(bench.segments, blocked.rows, blocked.within(whitening.parts, whitening.v), strict=True):
        if s.recording in bench.fitted:
            known[rows] = True
            within.append(block)
    total = block_diag(*within)
    for p, x in parts:
        if p.factor is not None:
            total = total + x * p.factor[known] @ p.factor[known].T
    size = 1 / np.sqrt(np.diag(total))[:, None]
    weight = size * cho_solve(factored(total * size * size.T), size * cut.mean(left)[known])
    named = (x * p.factor @ (p.factor[known].T @ weight) for p, x in parts if p.family in whitening.named)
    return between(cut, sum(named, np.zeros((len(cut.starts), left.shape[1]))))


def between(cut: Blocks, means: Float[np.ndarray, "M k"]) -> Float[np.ndarray, "N k"]:
    """Values at all samples, straight between the middles of blocks of one segment."""
    middle, ends = cut.starts + 0.5 * (cut.counts - 1), np.append(cut.starts, cut.starts[-1] + cut.counts[-1])
    out = np.empty((ends[-1], means.shape[1]))
    for k in range(int(cut.owner[-1]) + 1):
        own = np.flatnonzero(cut.owner == k)
        rows = np.arange(ends[own[0]], ends[own[-1] + 1])
        for i in range(means.shape[1]):
            out[rows, i] = np.interp(rows, middle[own], means[own, i])
    return out

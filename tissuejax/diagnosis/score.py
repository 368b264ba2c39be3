"""Scores: how much of the misfit a candidate would remove in one linear step, beside all base parameters.

With whitened residual r, base columns B and candidate columns C, let P project on the complement of span(B). The gain
of a candidate is r'Pr - min |Pr - P C a|^2 over the amplitudes a allowed (one-sided ones stay one-sided).
Shapes (times, periods, places) are scanned: the best setting counts. The score nominates; it doesn't decide.

Source: Rao's score test, Rao 1948, Proc. Camb. Phil. Soc. 44; one-sided: Silvapulle and Silvapulle 1995, JASA 90.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import lsq_linear

from tissuejax.diagnosis.bench import Bench, Candidate, Free
from tissuejax.diagnosis.misfit import Misfit


@dataclass(frozen=True)
class Score:
    """One candidate's score.

    Attributes:
        key: of the candidate.
        gain: chi-square removed by the best linear step.
        share: gain over the excess of chi-square above its expectation.
        step: amplitudes of that step by path.
        setting: shapes at which it was reached.
        direction: the projected change of prediction, unit length (whitened), for correlations.
        settings: every setting scanned with its gain and step, best first.
    """

    key: str
    gain: float
    share: float
    step: dict[str, float]
    setting: dict[str, float]
    direction: Float[np.ndarray, " M"]
    settings: tuple[tuple[float, dict, dict], ...] = ()


def complement(b: Float[np.ndarray, "M p"]) -> Float[np.ndarray, "M q"]:
    """Orthonormal basis of the span of b's columns, dropping what is zero or dependent to 1e-9."""
    norms = np.linalg.norm(b, axis=0)
    b = b[:, norms > 0] / norms[norms > 0]
    if b.shape[1] == 0:
        return b
    u, s, _ = np.linalg.svd(b, full_matrices=False)
    return u[:, s > 1e-9 * s[0]]


def gain(
    r: Float[np.ndarray, " M"], c: Float[np.ndarray, "M k"], lower: np.ndarray, upper: np.ndarray
) -> tuple[float, np.ndarray]:
    """Chi-square removed from r by the best step within bounds, and that step; r and c are already projected."""
    norms = np.linalg.norm(c, axis=0)
    good = norms > 1e-9
    if not good.any():
        return 0.0, np.zeros(c.shape[1])
    q, t = np.linalg.qr(c[:, good] / norms[good])
    low, high = lower[good] * norms[good], upper[good] * norms[good]
    answer = lsq_linear(t, q.T @ r, (low, np.maximum(high, low + 1e-12)), method="bvls")
    step = np.zeros(c.shape[1])
    step[good] = answer.x / norms[good]
    left = r - c @ step
    return float(r @ r - left @ left), step


def trusted(f: Free) -> tuple[float, float]:
    """Range of a parameter that a linear step may use: its bounds, and two standard deviations of its prior."""
    if f.prior is None:
        return f.lower, f.upper
    return max(f.lower, f.prior[0] - 2 * f.prior[1]), min(f.upper, f.prior[0] + 2 * f.prior[1])


def scores(
    bench: Bench, misfit: Misfit, values: Mapping[str, float], free: tuple[str, ...], candidates: list[Candidate]
) -> list[Score]:
    """All candidates scored at `values`, best first.

    Args:
        values: the fit that the candidates would be added to.
        free: its free paths, whose directions are projected out.
    """
    names = bench.fitted
    prediction = bench.predict(values)
    r = misfit.residual(prediction, names)
    expected = misfit.count(names) - len(free)
    excess = max(float(r @ r) - expected, 1.0)
    basis = complement(misfit.whiten(bench.jacobian(values, free, names), names))
    r = r - basis @ (basis.T @ r)
    grids = [list(bench.settings(c, prediction)) for c in candidates]
    wanted = [(i, s, a) for i, c in enumerate(candidates) for s in grids[i] for a in c.amplitudes]
    if not wanted:
        return []
    columns = misfit.whiten(bench.columns(values, [(s, a) for _, s, a in wanted]), names)
    columns = columns - basis @ (basis.T @ columns)
    out = []
    at = 0
    for c, grid in zip(candidates, grids):
        trials = []
        k = len(c.amplitudes)
        for s in grid:
            block = columns[:, at : at + k]
            at += k
            if not np.all(np.isfinite(block)):
                continue
            origin = np.array([{**bench.start, **values, **s}[a] for a in c.amplitudes])
            low = np.array([trusted(bench.free[a])[0] for a in c.amplitudes]) - origin
            high = np.array([trusted(bench.free[a])[1] for a in c.amplitudes]) - origin
            g, step = gain(r, block, np.minimum(low, 0.0), np.maximum(high, 0.0))
            trials.append((g, dict(zip(c.amplitudes, step.tolist())), dict(s), block @ step))
        if not trials:
            continue
        trials.sort(key=lambda t: -t[0])
        g, step, setting, moved = trials[0]
        size = np.linalg.norm(moved)
        out.append(
            Score(
                c.key,
                g,
                min(g / excess, 1.0),
                step,
                setting,
                moved / size if size > 0 else moved,
                tuple((t[0], t[1], t[2]) for t in trials),
            )
        )
    return sorted(out, key=lambda s: -s.gain)

"""Serial correlation of a fit's residuals: what samples are worth that are not independent.

The estimate stays the least-squares one; its covariance is that of least squares under correlated noise,
(J'J)^-1 J'VJ (J'J)^-1, with V from the residuals (`estimation.correlation`). Their degrees of freedom follow
Satterthwaite: squares of correlated residuals scatter more than those of as many independent ones.

Sources: Seber and Wild 1989, Nonlinear Regression, sec. 6.2 (least squares under autocorrelated errors); Satterthwaite
1946, Biometrics Bull. 2:110.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from tissuejax.estimation.correlation import LEAST, Estimate, Series, estimate
from tissuejax.estimation.noise import Noise
from tissuejax.estimation.problem import Problem

NOTICED = 2.5  # standard deviations of a lag-one correlation from which the shape of the noise is sought


@dataclass(frozen=True)
class Serial:
    """Noise shapes (standard deviation 1) of those rows of the residuals that are correlated.

    Attributes:
        parts: rows, times and noise of each series; all other rows are independent.
    """

    parts: tuple[tuple[np.ndarray, np.ndarray, Noise], ...] = field(default_factory=tuple)

    def times(self, x: Float[np.ndarray, "n p"]) -> Float[np.ndarray, "n p"]:
        """V x."""
        out = np.array(x, float)
        for rows, time, noise in self.parts:
            out[rows] = noise.times(x[rows], time)
        return out

    def squares(self, n: int) -> float:
        """Trace of V V, for n rows in all."""
        inside = sum(len(rows) for rows, _, _ in self.parts)
        return n - inside + sum(noise.squares(time) for _, time, noise in self.parts)


def serial(problem: Problem, residuals: Float[np.ndarray, " n"]) -> Serial:
    """The correlation of the noise in `residuals`, by channel; none where neighbours are as good as independent."""
    parts = []
    for channel in dict.fromkeys(c for _, c in problem.channels):
        own = [s for s in problem.series.segments if s.channel == channel and len(s.time) >= LEAST]
        columns = [(np.arange(s.rows.start, s.rows.stop), s.time) for s in own]
        if not any(_noticed(residuals[rows]) for rows, _ in columns):
            continue
        series = [Series(time, residuals[rows][:, None]) for rows, time in columns]
        found = _shape(series)
        parts += [
            (rows, time, noise)
            for (rows, time), noise in zip(columns, found.noises, strict=True)
            if not noise.is_white(time)
        ]
    return Serial(tuple(parts))


def _shape(series: list[Series]) -> Estimate:
    """Noise behind a low-pass of first or second order. The second falls as a mismatch does, so where it is likelier
    all that is left is taken for noise, which can only widen intervals; the first is told from a mismatch."""
    smooth = estimate(series, recorded=False, orders=(1, 2), mismatch=False)
    return smooth if any(noise.order == 2 for noise in smooth.noises) else estimate(series, recorded=False)


def _noticed(r: Float[np.ndarray, " n"]) -> bool:
    r = r - r.mean()
    total = float(r @ r)
    return total > 0 and float(r[1:] @ r[:-1]) / total > NOTICED / math.sqrt(len(r))

"""How far a fit is from pure noise, in every recording: size and correlation of the whitened residuals."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.misfit import Misfit
from tissuejax.diagnosis.refit import Refit
from tissuejax.estimation.whiteness import portmanteau

SIGNIFICANT = 3.5  # standard deviations
# Chi-square per sample below which the stated noise is no noise but a bound on it (the spread between specimens, say):
# it says how large a misfit may be and nothing of how it is correlated.
STATED = 0.5
TOLERATED = 1.12  # chi-square per sample of a simulation, the numerical error in sigma already
TOLERATED_HELD = 1.2  # where nothing was fitted, the numerical error is met in full
CHANNEL = 1.3  # the same in one channel alone: many calm markers must not hide a force that is off
VEILED = 0.04  # chi-square per sample that one linear step may remove before a small misfit counts as something


class Judged(Protocol):
    """Where the noise comes from."""

    bench: Bench
    misfit: Misfit


@dataclass(frozen=True)
class Quality:
    """How far a refit is from noise.

    Attributes:
        fitted, held: chi-square per sample.
        z_fitted, z_held: in standard deviations of pure noise.
        z_correlation: of the whitened residuals (Ljung-Box).
        channel: chi-square per sample of the worst channel, fitted.
    """

    fitted: float
    held: float
    z_fitted: float
    z_held: float
    z_correlation: float
    dear: bool = False
    channel: float = 0.0

    @property
    def noise(self) -> bool:
        """Whether nothing but noise is left; of simulations, nothing but noise and numerical error."""
        if self.dear:
            held = self.held if math.isfinite(self.held) else 0.0
            return self.fitted < TOLERATED and held < TOLERATED_HELD and self.channel < CHANNEL
        if self.fitted < STATED:
            return max(self.z_fitted, self.z_held) < SIGNIFICANT
        return max(self.z_fitted, self.z_held, self.z_correlation) < SIGNIFICANT


def quality(s: Judged, r: Refit) -> Quality:
    """Tests of r's residuals."""
    bench, misfit = s.bench, s.misfit
    names = (*bench.fitted, *bench.held_out)
    channels: dict[str, list[np.ndarray]] = {}
    for segment in misfit.rows(bench.fitted) if bench.dear else ():
        z = (bench.y - r.prediction)[segment.rows] / bench.sigma[segment.rows]
        channels.setdefault(segment.channel, []).append(z)
    series = [misfit.residual(r.prediction, (n,)) for n in names]
    dof = max(r.n - r.k, 1)
    n_held = max(r.n_held - len(r.own), 0)
    z_held = (r.held - n_held) / math.sqrt(2 * n_held) if n_held else 0.0
    # a prediction carries the errors of the fitted parameters: about one unit a parameter, per sample of the fit
    z_held -= r.k * n_held / max(r.n, 1) / math.sqrt(2 * n_held) if n_held else 0.0
    return Quality(
        r.chi2 / dof,
        r.held / n_held if n_held else math.nan,
        (r.chi2 - dof) / math.sqrt(2 * dof),
        z_held,
        portmanteau(series),
        bench.dear,
        max((float(np.mean(np.concatenate(x) ** 2)) for x in channels.values()), default=0.0),
    )


def veiled(s, r: Refit) -> bool:
    """Whether one linear step of a candidate removes more than noise and numerical error would let it.

    Of simulations: sigma holds the numerical error in full, so a model that lacks little can leave less than one a
    sample. What a candidate would remove tells the two apart. False before the candidates are scored at r.
    """
    scores = s.scored.get(frozenset(r.keys), ())
    best = max((score.gain for score in scores), default=0.0)
    known = s.bench.numerics.get(frozenset(r.keys), s.bench.numerics.get(frozenset()))
    numerical = known.gain if known is not None else 0.0
    return s.bench.dear and best > VEILED * r.n and best > 1.5 * numerical

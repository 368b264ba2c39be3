"""How far a fit is from pure noise, in every recording: size and correlation of the whitened residuals."""

import math
from dataclasses import dataclass
from typing import Protocol

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.misfit import Misfit
from tissuejax.diagnosis.noise import portmanteau
from tissuejax.diagnosis.refit import Refit

SIGNIFICANT = 3.5  # standard deviations
# Chi-square per sample below which the stated noise is no noise but a bound on it (the spread between specimens, say):
# it says how large a misfit may be and nothing of how it is correlated.
STATED = 0.5
TOLERATED = 1.12  # chi-square per sample of a simulation, the numerical error in sigma already


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
    """

    fitted: float
    held: float
    z_fitted: float
    z_held: float
    z_correlation: float
    dear: bool = False

    @property
    def noise(self) -> bool:
        """Whether nothing but noise is left; of simulations, nothing but noise and numerical error."""
        if self.dear:
            return max(self.fitted, self.held if math.isfinite(self.held) else 0.0) < TOLERATED
        if self.fitted < STATED:
            return max(self.z_fitted, self.z_held) < SIGNIFICANT
        return max(self.z_fitted, self.z_held, self.z_correlation) < SIGNIFICANT


def quality(s: Judged, r: Refit) -> Quality:
    """Tests of r's residuals."""
    bench, misfit = s.bench, s.misfit
    names = (*bench.fitted, *bench.held_out)
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
    )

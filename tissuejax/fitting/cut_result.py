"""What a fit of cuts found."""

from dataclasses import dataclass

import numpy as np

from tissuejax.estimation.problem import Problem
from tissuejax.experiments.cutting_predictor import CuttingPredictor
from tissuejax.experiments.cutting_record import FORCE
from tissuejax.recordings.recording import Recording

STRENGTH, ENERGY, FRICTION = "cohesion.strength", "cohesion.energy", "effects.blade-friction.coefficient"
POSITIVE = (STRENGTH, ENERGY, FRICTION)
ONSET = "effects.onset.longer"
SCATTER = 3.5  # standard deviations of chi-square from which the recorded noise does not explain the residuals
ROUGH = 0.05  # of the greatest force: what a fit may leave where no noise was recorded
OPEN = np.log(2) / 2 / 1.96  # relative standard error from which an interval spans a factor of two


@dataclass(frozen=True)
class CutFit:
    """What was found: values, standard errors and 95 % intervals by path, what is not identified and why, the record
    and its prediction, how it went, and what must be said beside it."""

    values: dict[str, float]
    std: dict[str, float]
    numerical: dict[str, float]
    unidentified: dict[str, str]
    chi2_per_sample: float
    status: str
    runs: int
    by: str
    predictor: CuttingPredictor
    predicted: dict[str, Recording]
    balance_error: float
    warnings: tuple[str, ...] = ()

    @property
    def interval(self) -> dict[str, tuple[float, float]]:
        """95 % intervals, in logarithm for what is positive by nature."""
        out = {}
        for p, std in self.std.items():
            value, reach = self.values[p], 1.96 * std
            spread = np.exp(min(reach / max(abs(value), 1e-12), 700.0))
            out[p] = (value / spread, value * spread) if p in POSITIVE else (value - reach, value + reach)
        return out

    def record(self) -> dict:
        """Plain data."""
        kept = (
            "values",
            "std",
            "numerical",
            "unidentified",
            "chi2_per_sample",
            "status",
            "runs",
            "by",
            "balance_error",
            "warnings",
        )
        return {k: getattr(self, k) for k in kept} | {"interval": self.interval}


def described(chi2: float, posed: Problem) -> bool:
    """Whether the noise explains what a fit leaves, by its chi-square per sample; where no noise was recorded, whether
    it leaves less than `ROUGH` of the greatest force."""
    if posed.noise.estimated:
        return _left(chi2, posed) < ROUGH
    return chi2 < 1 + SCATTER * np.sqrt(2 / posed.n_samples)


def misfit_said(chi2: float, posed: Problem) -> tuple[str, ...]:
    """A warning where the record is not described; none where it is."""
    if described(chi2, posed):
        return ()
    known = "" if posed.noise.estimated else f"{np.sqrt(chi2):.2g} times the noise, "
    return (
        f"the fit does not describe the record: what it leaves is {known}{100 * _left(chi2, posed):.2g} % of the "
        "greatest force, and the values hold only as far as this model does. Look at the record on the page, ask "
        "`tissuejax diagnose` what is missing, or begin elsewhere (--start)",
    )


def _left(chi2, posed) -> float:
    """Root mean square of what is left, over the greatest force."""
    recordings = (posed.predictor.sample.recordings[n] for n in posed.predictor.names)
    top = max(float(np.max(np.abs(x.channels[FORCE].values))) for x in recordings)
    return float(np.sqrt(chi2)) * max(posed.noise.std.values()) / top

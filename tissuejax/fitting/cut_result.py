"""What a fit of cuts found."""

from dataclasses import dataclass

import numpy as np

from tissuejax.experiments.cutting_predictor import CuttingPredictor
from tissuejax.recordings.recording import Recording

STRENGTH, ENERGY, FRICTION = "cohesion.strength", "cohesion.energy", "effects.blade-friction.coefficient"
POSITIVE = (STRENGTH, ENERGY, FRICTION)
ONSET = "effects.onset.longer"
OPEN = np.log(2) / 2 / 1.96  # relative standard error from which an interval spans a factor of two


@dataclass(frozen=True)
class CutFit:
    """What was found: values, standard errors and 95 % intervals by path, what is not identified and why, the record
    and its prediction, and how it went."""

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

    @property
    def interval(self) -> dict[str, tuple[float, float]]:
        """95 % intervals, in logarithm for what is positive by nature."""
        out = {}
        for p, std in self.std.items():
            value, reach = self.values[p], 1.96 * std
            spread = np.exp(reach / max(abs(value), 1e-12))
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
        )
        return {k: getattr(self, k) for k in kept} | {"interval": self.interval}

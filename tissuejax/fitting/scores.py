"""How far prediction and measurement are apart, per recording and channel, and over all."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np

from tissuejax.estimation.covariance import autocorrelation
from tissuejax.recordings.recording import Recording


@dataclass(frozen=True)
class Score:
    """Error of one channel.

    Attributes:
        rmse: root mean square over the n samples actually compared, in `unit`.
        chi2_per_sample: mean square in units of the noise.
        n: samples compared (lost ones left out).
        r2: coefficient of determination.
        autocorrelation: of successive residuals; near 0 for noise, near 1 where something systematic is left.
    """

    rmse: float
    unit: str
    chi2_per_sample: float
    n: int
    r2: float
    autocorrelation: float

    def record(self) -> dict:
        """For result.json."""
        return asdict(self)


def scores(
    measured: Mapping[str, Recording], predicted: Mapping[str, Recording], std: Mapping[str, float]
) -> dict[str, Score]:
    """The score of every channel that has a standard deviation, by "recording/channel"."""
    found = {}
    for name, prediction in predicted.items():
        for channel, series in measured[name].channels.items():
            key = f"{name}/{channel}"
            if key in std and channel in prediction.channels:
                found[key] = score(series.values, prediction.channels[channel].values, std[key], series.unit)
    return found


def score(measured, predicted, std: float, unit: str) -> Score:
    """Compare two arrays of one shape; NaN marks a lost sample.

    RMSE = sqrt(mean (predicted - measured)^2) over the samples summed (Lister 2012, eq. 2.2, 2.3, corrected: the source
    divides by n while summing n + 1 terms).
    """
    measured, predicted = np.asarray(measured, float).ravel(), np.asarray(predicted, float).ravel()
    kept = np.isfinite(measured)
    error = (predicted - measured)[kept]
    n = int(kept.sum())
    if n == 0:
        return Score(float("nan"), unit, float("nan"), 0, float("nan"), 0.0)
    square = float(np.mean(error**2))
    spread = float(np.var(measured[kept]))
    r2 = 1 - square / spread if spread > 0 else float("nan")
    return Score(square**0.5, unit, square / std**2, n, r2, autocorrelation(error))

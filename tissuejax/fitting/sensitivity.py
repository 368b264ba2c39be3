"""What each parameter does to each sample of each channel, and which combinations the data see at all.

Local: derivatives of the prediction at one set of values, by the predictor's forward mode. The eigenvectors of the
Fisher information, in relative parameters, say in which directions a fit would be sharp and in which it would be blind.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError
from tissuejax.estimation.covariance import Uncertainty, uncertainty
from tissuejax.estimation.weights import Weights
from tissuejax.experiments.predictor import Predictor
from tissuejax.recordings.recording import Recording

SILENT = 0.01  # below this share of a channel's peak an elasticity is not defined


@dataclass(frozen=True)
class Direction:
    """One eigenvector of the Fisher information.

    Attributes:
        relative_std: relative standard error along it; small is well seen.
        weights: share of each parameter, by path.
        sentence: in words.
    """

    relative_std: float
    weights: dict[str, float]
    sentence: str


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Local sensitivities at one set of values.

    Attributes:
        paths: parameters looked at.
        values: where.
        predicted: the recordings there.
        change: by path and "recording/channel", the change of the channel when the parameter grows by 100 %,
            linearised:
            theta dy/dtheta, in the channel's unit, time-resolved.
        elasticity: theta/y dy/dtheta, dimensionless; NaN where |y| is below 1 % of its peak.
        directions: eigenvectors of the Fisher information, the best seen first.
        uncertainty: standard errors and correlation that these data would give.
    """

    paths: tuple[str, ...]
    values: dict[str, float]
    predicted: dict[str, Recording]
    change: dict[str, dict[str, Float[np.ndarray, "n ..."]]]
    elasticity: dict[str, dict[str, Float[np.ndarray, "n ..."]]]
    directions: list[Direction]
    uncertainty: Uncertainty

    def record(self) -> dict:
        """As plain data: per parameter the root mean square change of each channel; the directions."""
        return {
            "values": {path: self.values[path] for path in self.paths},
            "rms_change": {
                path: {key: float(np.sqrt(np.nanmean(c**2))) for key, c in by.items()}
                for path, by in self.change.items()
            },
            "mean_elasticity": {
                path: {key: float(np.nanmean(e)) if np.isfinite(e).any() else None for key, e in by.items()}
                for path, by in self.elasticity.items()
            },
            "relative_std": {
                path: float(s / abs(self.values[path])) if self.values[path] else None
                for path, s in zip(self.paths, self.uncertainty.std, strict=True)
            },
            "correlation": self.uncertainty.correlation.tolist(),
            "condition_number": self.uncertainty.condition,
            "directions": [
                {"relative_std": d.relative_std, "weights": d.weights, "sentence": d.sentence} for d in self.directions
            ],
            "not_identified": list(self.uncertainty.sentences),
        }


def local(predictor: Predictor, values: Mapping[str, float], paths: Sequence[str], noise: Weights) -> Sensitivity:
    """Sensitivities of all channels that have a noise level, at `values`.

    Args:
        predictor: model and recordings (their measured values are not used).
        values: all parameters, SI.
        paths: parameters to look at.
        noise: standard deviation by "recording/channel".

    Raises:
        InputError: no parameter, or an unknown one.
    """
    paths = tuple(paths)
    if not paths:
        raise InputError("no parameter to look at: name at least one")
    values = {path: float(v) for path, v in values.items()}
    predicted, slopes = predictor.jacobian(values, paths)
    declared = predictor.model.parameters
    size = np.array(
        [abs(values[p]) if abs(values[p]) > 1e-9 * declared[p].typical else declared[p].typical for p in paths]
    )
    keys = [(r, c) for r in predictor.names for c in predicted[r].channels if f"{r}/{c}" in noise.std]
    change, elasticity, columns = {p: {} for p in paths}, {p: {} for p in paths}, []
    for path, s in zip(paths, size, strict=True):
        column = []
        for r, c in keys:
            y, slope = np.asarray(predicted[r].channels[c].values, float), np.asarray(slopes[path][r][c], float)
            loud = np.abs(y) > SILENT * np.nanmax(np.abs(y), initial=0.0)
            change[path][f"{r}/{c}"] = slope * s
            elasticity[path][f"{r}/{c}"] = np.where(loud, slope * s / np.where(loud, y, 1.0), np.nan)
            seen = np.isfinite(np.asarray(predictor.sample.recordings[r].channels[c].values, float)).ravel()
            column.append(slope.ravel()[seen] / noise.std[f"{r}/{c}"])
        columns.append(np.concatenate(column))
    jacobian = np.stack(columns, 1)
    labels = tuple(path.removeprefix("energy.") for path in paths)
    units = tuple(declared[path].unit for path in paths)
    spread = uncertainty(jacobian, np.array([values[p] for p in paths]), size, labels, units)
    return Sensitivity(paths, values, predicted, change, elasticity, directions(jacobian * size, paths, labels), spread)


def directions(relative: Float[np.ndarray, "n p"], paths: tuple[str, ...], labels: tuple[str, ...]) -> list[Direction]:
    """Eigenvectors of the Fisher information J'J of relative parameters, the best seen first."""
    _, s, vt = np.linalg.svd(relative, full_matrices=False)
    found = []
    for value, v in zip(s, vt, strict=True):
        v = v * np.sign(v[np.argmax(np.abs(v))])
        std = float(1 / value) if value > 0 else float("inf")
        who = [i for i in np.argsort(-np.abs(v)) if abs(v[i]) > 0.3 * np.abs(v).max()]
        terms = " ".join(f"{'+' if v[i] > 0 else '-'} {abs(v[i]):.2f} {labels[i]}" for i in sorted(who)).removeprefix(
            "+ "
        )
        quality = "sharply" if std < 0.01 else "well" if std < 0.1 else "poorly" if std < 1 else "not at all"
        amount = f"to {100 * std:.2g} %" if std < 1 else "relative error above 100 %"
        found.append(
            Direction(
                std,
                dict(zip(paths, v.tolist(), strict=True)),
                f"relative change along {terms}: seen {quality} ({amount})",
            )
        )
    return found

"""A fitting problem: a predictor, which parameters are free, and what a misfit of one unit means.

Residuals are (predicted - measured) / sigma over all samples of all channels, lost (NaN) samples left out, followed
by one row for every prior, (value - mean) / std. The Jacobian comes from the predictor's own forward mode.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError, unknown
from tissuejax.estimation.losses import checked_loss
from tissuejax.estimation.series import Series
from tissuejax.estimation.stability import penalty_rows
from tissuejax.estimation.transforms import Box, Sticks, checked_bounds
from tissuejax.estimation.weights import Weights
from tissuejax.experiments.predictor import Predictor
from tissuejax.recordings.recording import Recording


@dataclass(frozen=True, eq=False)
class Problem:
    """What is to be fitted.

    Attributes:
        predictor: from values to recordings; its `names` are the recordings that take part.
        free: dotted paths of the parameters to estimate.
        start: a value for every parameter of the model, free or not, SI.
        noise: the standard deviation of each channel.
        bounds: (lower, upper) by path where they differ from the declared range.
        priors: (mean, standard deviation) by path.
        loss: "squares", "soft-l1" or "cauchy".
        stiffness: strength of the stability constraint; 0 leaves it out.
    """

    predictor: Predictor
    free: tuple[str, ...]
    start: Mapping[str, float]
    noise: Weights
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    priors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    loss: str = "squares"
    stiffness: float = 0.0

    def __post_init__(self):
        declared = self.predictor.model.parameters
        for kind, paths in (("free parameter", self.free), ("bound", self.bounds), ("prior", self.priors)):
            for path in paths:
                if path not in declared:
                    raise unknown(kind, path, declared)
        for path in self.start:
            if path not in declared:
                raise unknown("parameter", path, declared)
        missing = sorted(set(declared) - set(self.start))
        if missing:
            raise InputError(f"no start value for {', '.join(missing)}; give one, or leave start out for the defaults")
        if not self.free:
            raise InputError("no parameter is free: name at least one to estimate")
        if len(set(self.free)) < len(self.free):
            raise InputError(f"a free parameter is listed twice: {', '.join(self.free)}")
        checked_loss(self.loss)
        for path in self.free:
            lower, upper = self.bound(path)
            value = float(self.start[path])
            if not math.isfinite(value) or not lower <= value <= upper:
                unit = "" if declared[path].unit == "1" else f" {declared[path].unit}"
                raise InputError(
                    f"start of {path} = {value}{unit}: allowed is {lower} to {upper}{unit}; move the start"
                )
        for path, (_, std) in self.priors.items():
            if not std > 0:
                raise InputError(f"prior of {path}: standard deviation {std}; it must be positive")
        if self.n_samples < len(self.free):
            raise InputError(
                f"{self.n_samples} samples can't determine {len(self.free)} parameters ({', '.join(self.free)}): "
                "fix some with --fix, take a smaller energy or more recordings"
            )

    def bound(self, path: str) -> tuple[float, float]:
        """(lower, upper) of a free parameter; given bounds are cut to the declared range."""
        declared = self.predictor.model.parameters[path]
        lower, upper = self.bounds.get(path, (declared.lower, declared.upper))
        return checked_bounds(path, max(lower, declared.lower), min(upper, declared.upper))

    @cached_property
    def box(self) -> Box:
        """The transform of the free parameters."""
        lower, upper = zip(*(self.bound(path) for path in self.free), strict=True)
        wide = [path in self.moduli for path in self.free]
        return Box(list(lower), list(upper), [self.scale(path) for path in self.free], wide, self.sticks(self.free))

    def sticks(self, free: Sequence[str]) -> tuple[Sticks, ...]:
        """Free parameters among `free` that are parts of one whole (`Effect.shares`), unless they have bounds."""
        found = []
        for effect in self.predictor.model.effects:
            paths = [f"effects.{effect.name}.{name}" for name in getattr(effect, "shares", ())]
            mine = tuple(free.index(path) for path in paths if path in free)
            fixed = sum(float(self.start[path]) for path in paths if path not in self.free)
            if mine and fixed < 1 and not any(path in self.bounds for path in paths):
                found.append(Sticks(mine, 1.0 - fixed))
        return tuple(found)

    @cached_property
    def moduli(self) -> tuple[str, ...]:
        """Free constants of the energy in Pa: stress is (nearly) linear in them, and they may range over decades."""
        declared = self.predictor.model.parameters
        return tuple(p for p in self.free if p.startswith("energy.") and declared[p].unit == "Pa")

    def scale(self, path: str) -> float:
        """Typical magnitude of a parameter, from its start or its declaration."""
        start = abs(float(self.start[path]))
        declared = self.predictor.model.parameters[path]
        return start if start > 1e-3 * declared.typical else declared.typical

    @cached_property
    def channels(self) -> tuple[tuple[str, str], ...]:
        """(recording, channel) in the order of the residuals."""
        recordings = self.predictor.sample.recordings
        return tuple(
            (name, channel)
            for name in self.predictor.names
            for channel in recordings[name].channels
            if f"{name}/{channel}" in self.noise.std
        )

    @cached_property
    def series(self) -> Series:
        """All that was measured as one long vector, the residuals' own order; lost samples are left out."""
        wanted: dict[str, list[str]] = {}
        for recording, channel in self.channels:
            wanted.setdefault(recording, []).append(channel)
        return Series.of(self.predictor.sample, wanted)

    @cached_property
    def std(self) -> Float[np.ndarray, " n"]:
        """Standard deviation of every measured value, SI."""
        return np.concatenate(
            [np.full(len(s.time), self.sigma((s.recording, s.channel))) for s in self.series.segments]
        )

    @cached_property
    def rows(self) -> dict[tuple[str, str], slice]:
        """Where each channel lies in the residuals."""
        return self.series.rows()

    @cached_property
    def seen(self) -> dict[tuple[str, str], np.ndarray]:
        """Indices of the samples that were not lost, in the order of the residuals, into each channel's flat array."""
        found: dict[tuple[str, str], list[np.ndarray]] = {}
        for s, place in zip(self.series.segments, self.series.places, strict=True):
            found.setdefault((s.recording, s.channel), []).append(place)
        return {key: np.concatenate(places) for key, places in found.items()}

    @property
    def n_samples(self) -> int:
        """Number of measured values that take part."""
        return len(self.series.y)

    def sigma(self, key: tuple[str, str]) -> float:
        """Standard deviation of one channel, SI."""
        return self.noise.std["/".join(key)]

    def values(self, x: Float[np.ndarray, " p"]) -> dict[str, float]:
        """A full value set with the free parameters at `x`."""
        return {path: float(v) for path, v in self.start.items()} | dict(zip(self.free, map(float, x), strict=True))

    def vector(self, values: Mapping[str, float]) -> Float[np.ndarray, " p"]:
        """The free parameters of a value set."""
        return np.array([float(values[path]) for path in self.free])

    def residuals(self, values: Mapping[str, float]) -> Float[np.ndarray, " n"]:
        """(predicted - measured) / sigma, then the priors; one forward run of the model."""
        return self.misfit(self.predictor.predict(dict(values)), values)

    def linearised(self, values: Mapping[str, float]) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n p"]]:
        """Residuals and their Jacobian to the free parameters; one forward-mode run.

        With the stability constraint its rows come last; they are zero where the energy is stable.
        """
        predicted, slopes = self.predictor.jacobian(dict(values), self.free)
        jacobian = np.empty((self.n_samples + len(self.priors), len(self.free)))
        for column, path in enumerate(self.free):
            slope = self.series.stacked(lambda recording, channel, own=slopes[path]: own[recording][channel])
            jacobian[: self.n_samples, column] = slope / self.std
            for row, (prior, (_, std)) in enumerate(self.priors.items(), start=self.n_samples):
                jacobian[row, column] = (prior == path) / std
        r = self.misfit(predicted, values)
        if self.stiffness:
            rows, slopes = penalty_rows(self.predictor, values, self.free, self.stiffness)
            r, jacobian = np.concatenate([r, rows]), np.concatenate([jacobian, slopes])
        return r, jacobian

    def misfit(self, predicted: Mapping[str, Recording], values: Mapping[str, float]) -> Float[np.ndarray, " n"]:
        """Residuals of a prediction that is there already."""
        left = (self.series.predicted(predicted) - self.series.y) / self.std
        return np.concatenate([left, [(float(values[p]) - mean) / std for p, (mean, std) in self.priors.items()]])

    def with_noise(self, noise: Weights) -> "Problem":
        """The same problem with other standard deviations."""
        return replace(self, noise=noise)

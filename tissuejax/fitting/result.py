"""What a fit found: values, uncertainties, errors per channel, warnings in sentences; and its record as JSON."""

import functools
import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import metadata

import jax
import numpy as np

from tissuejax.cache import source
from tissuejax.energies.catalogue import forms_of, name_of
from tissuejax.energies.stability import Stability
from tissuejax.estimation.covariance import Uncertainty
from tissuejax.estimation.ending import Ending
from tissuejax.estimation.problem import Problem
from tissuejax.estimation.solution import Limits, Solution
from tissuejax.experiments.soundness import numerics
from tissuejax.fitting.fingerprint import fingerprint
from tissuejax.fitting.first import First
from tissuejax.fitting.scores import Score
from tissuejax.model import Model
from tissuejax.parameters import under
from tissuejax.recordings.recording import Recording

FORMAT = 1


@dataclass(frozen=True)
class Iterate:
    """One accepted point of the descent: evaluations so far, chi-square, free values."""

    n_evaluations: int
    chi2: float
    values: dict[str, float]


@dataclass(frozen=True, eq=False)
class Fit(Solution):
    """The outcome of `fit`.

    Attributes:
        problem: what was solved (with the noise finally used).
        status: how it ended (`estimation.ending.Ending`), or a sentence where a number belongs to that.
        values: all parameters, SI; the free ones at their estimates.
        uncertainty: standard errors, covariance, correlation, condition, sentences.
        at_bound: "lower" or "upper" for a free parameter that ran into a bound.
        chi2: sum of squared residuals in units of the noise.
        channels: score by "recording/channel".
        holdout: the same for recordings that took no part.
        predictions: predicted recordings, fitted and held out.
        trace: accepted points of the best start.
        stability: of the energy (Drucker) over the recorded stretches.
        starts: final chi-square of every start, in the order tried (NaN for one that failed).
        n_evaluations: runs of the model with derivatives, all starts together.
        seconds: wall time, compilation included.
        warnings: sentences for the reader.
        method: how it was minimised.
        sites: for probings, root mean square length of the error vectors of each recording and channel, SI, at the
            start and at the end ("before", "after"; Lister 2012, eq. 2.2 and 2.3).
        curve_std: for probings, standard deviation of the predicted curves by recording and
            channel, SI (`bands`); of material tests it is computed when it is drawn.
        first: where it began, if a surrogate was asked first (`fitting.first`).
    """

    problem: Problem
    status: str
    values: dict[str, float]
    uncertainty: Uncertainty
    at_bound: dict[str, str]
    chi2: float
    channels: dict[str, Score]
    holdout: dict[str, Score]
    predictions: Mapping[str, Recording]
    trace: list[Iterate]
    stability: Stability
    starts: list[float]
    n_evaluations: int
    seconds: float
    warnings: list[str] = field(default_factory=list)
    method: str = "levenberg-marquardt"
    sites: Mapping[str, Mapping[str, Mapping[str, float]]] = field(default_factory=dict)
    curve_std: Mapping[str, Mapping[str, np.ndarray]] = field(default_factory=dict)
    first: First | None = None

    @property
    def converged(self) -> bool:
        """Whether the minimisation ended by its tolerance."""
        return self.status == Ending.CONVERGED

    @property
    def free(self) -> tuple[str, ...]:
        """Paths of the estimated parameters."""
        return self.problem.free

    @property
    def std(self) -> dict[str, float]:
        """Standard errors by path."""
        return dict(zip(self.free, map(float, self.uncertainty.std), strict=True))

    @property
    def freedom(self) -> float:
        """See `Solution.freedom`."""
        return self.uncertainty.dof

    def limits(self, path: str) -> Limits:
        """See `Solution.limits`: the bounds of the fit."""
        return Limits(*self.problem.bound(path))

    @property
    def shear_moduli(self) -> dict[str, float]:
        """Initial shear modulus at once and in the long term, Pa, of a model that relaxes; empty for others."""
        model = self.problem.predictor.model
        for effect in model.effects:
            if hasattr(effect, "long_term"):
                at_once = float(model.energy.initial_shear_modulus(under("energy", self.values)))
                left = float(effect.long_term(under(f"effects.{effect.name}", self.values)))
                return {"instantaneous": at_once, "long_term": at_once * left}
        return {}

    @property
    def covariance(self) -> np.ndarray:
        """(p, p), order of `free`."""
        return self.uncertainty.covariance

    @property
    def correlation(self) -> np.ndarray:
        """(p, p), order of `free`."""
        return self.uncertainty.correlation

    @property
    def chi2_per_dof(self) -> float:
        """Chi-square per degree of freedom."""
        return self.chi2 / max(1, self.problem.n_samples + len(self.problem.priors) - len(self.free))

    @property
    def numerics(self) -> dict[str, dict[str, float]]:
        """For simulated recordings, the worst of each numerical check, as shares: energy of the hourglass control over
        internal energy, penetration over the probe's radius, kinetic over internal energy; and the least volume
        ratio at a corner of an element, 0 or less where one is folded."""
        return numerics(self.predictions)

    def record(self) -> dict:
        """The contents of result.json."""
        model = self.problem.predictor.model
        declared = model.parameters
        return {
            "format": FORMAT,
            "status": self.status,
            "sample": self.problem.predictor.sample.name,
            "energy": described(model),
            "effects": [effect.name for effect in model.effects],
            "method": self.method,
            "recordings": list(self.problem.predictor.names),
            "data": fingerprint(self.problem),
            "parameters": {
                path: {
                    "value": float(value),
                    "std": self.std.get(path),
                    "interval": list(self.intervals[path]) if path in self.free else None,
                    "unit": declared[path].unit,
                    "at_bound": self.at_bound.get(path),
                    "free": path in self.free,
                }
                for path, value in self.values.items()
            },
            "correlation": {"paths": list(self.free), "matrix": self.correlation.tolist()},
            "condition_number": self.uncertainty.condition,
            **({"shear_modulus": self.shear_moduli} if self.shear_moduli else {}),
            "interval": {"confidence": 0.95, "degrees_of_freedom": self.uncertainty.dof},
            "not_identified": list(self.uncertainty.sentences),
            "chi2": self.chi2,
            "chi2_per_dof": self.chi2_per_dof,
            "noise": {
                key: {"std": s, "estimated": key in self.problem.noise.groups}
                for key, s in self.problem.noise.std.items()
            },
            "stable_between": {
                name: [list(piece) for piece in path.ranges] for name, path in self.stability.paths.items()
            },
            "channels": {key: s.record() for key, s in self.channels.items()},
            "holdout": {key: s.record() for key, s in self.holdout.items()},
            **({"sites": self.sites} if self.sites else {}),
            **({"first": self.first.record()} if self.first else {}),
            **({"numerics": checks} if (checks := self.numerics) else {}),
            "warnings": list(self.warnings),
            "starts": self.starts,
            "n_evaluations": self.n_evaluations,
            "seconds": self.seconds,
            "trace": [{"n_evaluations": i.n_evaluations, "chi2": i.chi2, "values": i.values} for i in self.trace],
            "versions": versions(),
        }


def described(model: Model) -> dict:
    """The energy's name and the named forms that its numbers depend on."""
    return {
        "name": name_of(model.energy),
        "formula": model.energy.formula,
        "forms": forms_of(model.energy, model.volumetric),
        "volumetric": None if model.volumetric is None else name_of(model.volumetric),
        "source": model.energy.source,
    }


def versions() -> dict[str, str]:
    """Versions that a number may depend on; "source" is the hash of this package's code as it was loaded."""
    float_name = str(jax.dtypes.canonicalize_dtype(float))
    return {"python": platform.python_version(), "float": float_name} | _installed() | {"source": source.LOADED}


@functools.cache
def _installed() -> dict[str, str]:
    """Read once: parsing the metadata costs as much as a small fit."""
    names = ("tissuejax", "jax", "optimistix", "optax", "diffrax", "numpy", "scipy")
    found = {}
    for name in names:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found

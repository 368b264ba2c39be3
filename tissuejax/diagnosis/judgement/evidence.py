"""What a finished search says, as plain numbers: all that a verdict rests on, and no bench behind it.

Written beside the result as `evidence.json`, so that a verdict can be asked for again with other criteria.
"""

import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from tissuejax.errors import InputError
from tissuejax.storage import write_json


@dataclass(frozen=True)
class SetEvidence:
    """One set of effects, weighed.

    Attributes:
        keys: candidates (effect/form) in the set, in the order in which they were added.
        names: their effects, each once.
        log_evidence: log p(measurements | set), nats; the sum of the next three.
        fit: log density of the measurements at the fit, parameters' and amplitudes' factors left out.
        parameters: log of prior times posterior width of the free parameters (Occam's factor).
        discrepancy: the same of the discrepancy's amplitudes.
        amplitudes: of the discrepancy by part, shares of the stress.
        k: free parameters.
        at_bound: those that rest on a bound.
        void: an effect of the set rests at neutral, so the set is the one without it.
        chi2, n: misfit over the stated noise without any discrepancy, block means, and how many there are.
        kurtosis: excess kurtosis of the whitened residuals: jumps that no part of the discrepancy has.
        explained: share of the base's misfit (beyond noise) that the set's model alone removes.
        rest: mean square of the discrepancy left, as a share of the squared peak, and its standard deviation; without
            what scatters from sample to sample, but in files of before that was kept apart.
        scattered: probability that something of what scatters from sample to sample beside the stated noise is a rest
            (and not the noise, stated wrong), and its mean square then, as a share of the squared peak.
        numerical: root mean square of what is laid to mesh and step of a simulation, a share of the peak.
        free: paths of the free parameters; none in files of before they were kept.
    """

    keys: tuple[str, ...]
    names: tuple[str, ...]
    log_evidence: float
    fit: float
    parameters: float
    discrepancy: float
    amplitudes: Mapping[str, float]
    k: int
    at_bound: tuple[str, ...]
    void: bool
    chi2: float
    n: int
    kurtosis: float
    explained: float
    rest: tuple[float, float]
    scattered: tuple[float, float] = (0.0, 0.0)
    numerical: float = 0.0
    free: tuple[str, ...] = ()

    @property
    def rest_size(self) -> float:
        """Root of the expected mean square of the rest, as a share of the peak, with what scatters and is no noise."""
        chance, square = self.scattered
        return math.sqrt(self.rest[0] + chance * square)


@dataclass(frozen=True)
class Evidence:
    """All sets that were weighed.

    Attributes:
        sets: every set weighed once, in its best fit.
        forms: by name, how many forms of it were offered (each effect's prior is shared among its forms).
        fitted, held_out: recordings; all of them are measurements for the evidence.
        faults: names of faults of a test machine among them, which are rarer (`Criteria.fault`).
        exhausted: whether sets were left untried because the budget was spent.
        simulated: whether every prediction is a simulation, so that a search makes few (probings).
    """

    sets: tuple[SetEvidence, ...]
    forms: Mapping[str, int]
    fitted: tuple[str, ...]
    held_out: tuple[str, ...]
    exhausted: bool = False
    simulated: bool = False
    faults: tuple[str, ...] = ()

    def as_dict(self) -> dict:
        """For `evidence.json`."""
        return dataclasses.asdict(self)


def read_evidence(path: Path) -> Evidence:
    """Evidence that was written before.

    Raises:
        InputError: no such file, or not one that a diagnosis has written.
    """
    try:
        given = json.loads(Path(path).read_text())
        tuples = {"keys", "names", "at_bound", "rest", "scattered", "free"}
        left_out = {"held"}  # what was written once, and never filled
        sets = [
            SetEvidence(**{k: tuple(v) if k in tuples else v for k, v in s.items() if k not in left_out})
            for s in given["sets"]
        ]
        return Evidence(
            tuple(sets),
            given["forms"],
            tuple(given["fitted"]),
            tuple(given["held_out"]),
            given["exhausted"],
            given.get("simulated", False),  # unknown to files of before it was asked
            tuple(given.get("faults", ())),  # the same: there faults are as likely as all else
        )
    except (OSError, KeyError, TypeError, json.JSONDecodeError) as error:
        raise InputError(
            f"{path}: no evidence of a diagnosis ({error}); `tissuejax diagnose FILE --out FOLDER` writes one"
        ) from error


def write_evidence(evidence: Evidence, path: Path) -> Path:
    """Write it, whole or not at all."""
    return write_json(path, evidence.as_dict())

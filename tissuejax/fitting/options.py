"""What can be said about a fit: what is unknown, what a unit of misfit means, how the best values are searched."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Unknowns:
    """What is estimated, by dotted path ("energy.C10"), SI.

    Attributes:
        free: what to estimate; None: all parameters that are neither fixed nor declared frozen.
        fix: values that stay as they are.
        start: where to begin; defaults are the declared ones, moved inside any bounds given here. Of a material test
            moduli are solved for first where no start is given.
        bounds: (lower, upper); relaxation times lie by default between the sampling step and three times the longest
            recording.
        priors: (mean, standard deviation).
        stable: keep the energy stable (Drucker) over the recorded stretches.
    """

    free: tuple[str, ...] | None = None
    fix: Mapping[str, float] | None = None
    start: Mapping[str, float] | None = None
    bounds: Mapping[str, tuple[float, float]] | None = None
    priors: Mapping[str, tuple[float, float]] | None = None
    stable: bool = False


@dataclass(frozen=True)
class Objective:
    """What is made small: squared residuals over what they are expected to be.

    Attributes:
        weights: "auto" (recorded noise, else one estimate), "uniform", "relative" or standard deviations by channel.
        channels: only these channels, e.g. ("force",); all by default.
        loss: "squares", "soft-l1" or "cauchy".
    """

    weights: str | Mapping[str, float] = "auto"
    channels: tuple[str, ...] = ()
    loss: str = "squares"


@dataclass(frozen=True)
class Search:
    """How the best values are looked for.

    Attributes:
        method: "levenberg-marquardt", "adam" or "lbfgs"; for a probing also "stress-curve", the source's iteration.
        multistart: number of starts (the first as given, the others seeded variations); the best end wins. Of a
            probing one, whatever is said.
        seed: of the further starts.
        max_steps: evaluations for each start.
        checkpoint: for probings, a file that keeps the last iterate; a killed fit goes on from there.
    """

    method: str = "levenberg-marquardt"
    multistart: int = 4
    seed: int = 0
    max_steps: int = 200
    checkpoint: Path | None = None

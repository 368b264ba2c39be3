"""What a diagnosis needs of an experiment: measured series, parameters, a prediction and its derivatives.

The engine (score, refit, selection, verdict) knows no mechanics. A `Bench` puts a sample on the table: all its
channels as one long vector cut into `Segment`s, a base model with its parameters, and `Candidate`s, each a set of
parameter paths that are neutral until freed. Material tests and probings are two benches.
"""

import abc
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from tissuejax.effects.form import Placed
from tissuejax.estimation.series import Segment


@dataclass(frozen=True)
class Free:
    """A parameter a refit may move: its range, how it is scaled, and whether in logarithm.

    Attributes:
        lower, upper: range allowed in a fit.
        scale: typical step.
        log: fitted as its logarithm (positive over decades: times, rates, periods).
        prior: (mean, standard deviation) or None, of the logarithm where that is fitted.
        limited: True where a fit that rests on the upper limit has run away and is not to be believed.
        whole: name of what it is a part of, if of anything: parts of one whole never exceed 1 together.
    """

    lower: float
    upper: float
    scale: float
    unit: str = "1"
    log: bool = False
    prior: tuple[float, float] | None = None
    limited: bool = False
    whole: str = ""


@dataclass(frozen=True)
class Candidate:
    """One answer to "what is missing?".

    Attributes:
        name: of the effect (two candidates may share one: forms of one effect compete inside it).
        amplitudes: paths that are zero at neutral.
        shapes: paths that mean nothing while the amplitudes are zero, scanned over `grid`.
        grid: settings of the shapes (and, where the effect has no derivative at zero, of amplitudes) to start from.
        form: tells candidates of one effect apart.
        held: paths that held-out recordings have for themselves (offsets, phases), fitted there.
        nominated: False for forms that are only reached from their neighbours.
        beside: keys of the poorer and the richer form.
        widens: families of the discrepancy that may be far larger where this acts, with the width of their prior; such
            a candidate has no parameters of its own.
        rig: a fault of the rig, and not of the tissue.
        spectral: path of a frequency that is read from the residual's periodogram, and how many of its lines are tried.
        corners: by path, sizes of an amplitude at which what it does is scored as a whole (`effects.form.Form`).
        placed: of probings: settings of the shapes by where the probe went deepest (`effects.form.Form`).
        heard: of probings: the channel whose periodogram `spectral` reads.
        brief: of material tests: it acts within some samples, so that means of them don't tell what it does.
        lacking: by property of the protocol, families that it widens too where the protocol lacks that.
    """

    name: str
    amplitudes: tuple[str, ...]
    shapes: tuple[str, ...] = ()
    grid: tuple[Mapping[str, float], ...] = ({},)
    form: str = ""
    held: tuple[str, ...] = ()
    nominated: bool = True
    beside: tuple[str, ...] = ()
    widens: Mapping[str, float] = field(default_factory=dict)
    rig: bool = False
    spectral: tuple[str, int] | None = None
    corners: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    placed: Placed | None = None
    heard: str = ""
    brief: bool = False
    lacking: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """Unique among candidates."""
        return f"{self.name}/{self.form}" if self.form else self.name

    @property
    def paths(self) -> tuple[str, ...]:
        """All paths a refit frees."""
        return (*self.amplitudes, *self.shapes)


@dataclass
class Spent:
    """A count that a bench shares with all that are made from it (`Bench.nearer`, `Bench.anchored`, ...).

    Attributes:
        cost: of predictions, in those of the plain base model.
    """

    cost: float = 0.0


@dataclass
class Bench(abc.ABC):
    """A sample on the table.

    Attributes:
        segments: all measured series, fitted and held out.
        y, sigma: measurements and standard deviations (noise and numerical error in quadrature), one long vector.
        fitted, held_out: recordings by name; held_out may be empty.
        base: paths of the base model.
        free: every path that any refit may move.
        start: neutral values of all paths.
        candidates: by key.
        warnings: sentences for the reader.
        known: values of effects that the base model has already, by path; they are in every prediction.
        counted: what predictions cost, shared with the benches made from this one.
        estimated: whether `sigma` is a guess from the recordings themselves: standard errors then follow what the
            model leaves, be that more or less.
    """

    segments: Sequence[Segment]
    y: Float[np.ndarray, " N"]
    sigma: Float[np.ndarray, " N"]
    fitted: tuple[str, ...]
    held_out: tuple[str, ...]
    base: tuple[str, ...]
    free: dict[str, Free]
    start: dict[str, float]
    candidates: dict[str, Candidate]
    warnings: list[str] = field(default_factory=list)
    counted: Spent = field(default_factory=Spent)
    known: dict[str, float] = field(default_factory=dict)
    estimated: bool = False

    @abc.abstractmethod
    def predict(self, values: Mapping[str, float], recordings: Sequence[str] | None = None) -> Float[np.ndarray, " N"]:
        """All channels at `values` (absent paths are neutral); with `recordings`, only their rows mean anything."""

    @abc.abstractmethod
    def jacobian(
        self, values: Mapping[str, float], paths: Sequence[str], recordings: Sequence[str] | None = None
    ) -> Float[np.ndarray, "N k"]:
        """Derivative of the prediction with respect to `paths`; with `recordings`, only their rows mean anything."""

    def columns(
        self, values: Mapping[str, float], settings: Sequence[tuple[Mapping[str, float], str]]
    ) -> Float[np.ndarray, "N k"]:
        """Derivatives with respect to one path each, each at its own setting of shapes on top of `values`."""
        return np.stack([self.jacobian({**values, **dict(s)}, [path])[:, 0] for s, path in settings], axis=1)

    def settings(self, candidate: Candidate, prediction: Float[np.ndarray, " N"]) -> Sequence[Mapping[str, float]]:
        """Shapes at which to score a candidate; a bench may read some from the residual (a period, a place)."""
        return candidate.grid

    @property
    def spent(self) -> float:
        """Cost of all predictions so far, in those of the plain base model (see `Effort.spend`)."""
        return self.counted.cost

    @property
    def forms(self) -> dict[str, int]:
        """In how many forms every effect is offered."""
        names = [c.name for c in self.candidates.values()]
        return {n: names.count(n) for n in dict.fromkeys(names)}

    @property
    def faults(self) -> tuple[str, ...]:
        """Names of what may be wrong with a test machine, where one made the recordings."""
        rig = (c.name for c in self.candidates.values() if c.rig and self.machine)
        return tuple(dict.fromkeys(rig))

    machine: ClassVar[bool] = False  # whether a test machine made the recordings, whose faults are rare
    costly: ClassVar[bool] = False  # whether a prediction costs so much that one is saved where nothing hangs on it

    def ahead(self) -> AbstractContextManager[None]:
        """While it is entered, whatever a search will need is made ready beside it; nothing by default."""
        return nullcontext()

    def anchored(self, values: Mapping[str, float]) -> "Bench":
        """The bench with predictions exact at `values`: itself, unless it corrects a cheaper simulation there."""
        return self

    def corrected_as(self, other: "Bench") -> "Bench":
        """The bench with the correction of another one of the same recordings; itself, unless it has any."""
        return self

    def nearer(self, values: Mapping[str, float]) -> "Bench":
        """The bench with a correction taken anew at `values` where it was taken far away."""
        return self

    def rooted(self, values: Mapping[str, float]) -> "Bench":
        """The bench about the base's fit: where predictions are costly, scores take their columns there."""
        return self

    def sharpened(self) -> "Bench":
        """The bench with derivatives of the very place they are asked for; itself, unless it takes them nearby."""
        return self

    @property
    def shared(self) -> Float[np.ndarray, " S"] | None:
        """By segment, standard deviation of an error that all its samples share and that is noise; None for none."""
        return None

    @property
    def numerical(self) -> Mapping[str, Float[np.ndarray, "N ..."]] | None:
        """What mesh and speed of a simulation leave open, by cause, a column for each independent part; None in closed
        form."""
        return None

    @property
    def shown(self) -> "Bench":
        """The bench in SI units: itself, unless it is a view of one."""
        return self

    def natural(self, prediction: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
        """A prediction in SI units."""
        return prediction

    def nested(self, keys: Sequence[str]) -> int:
        """How many searches and memories a prediction with these candidates nests; sets of many are not tried."""
        return 0

    def mask(self, recordings: Sequence[str]) -> np.ndarray:
        """Rows of the long vector that belong to `recordings`."""
        out = np.zeros(len(self.y), bool)
        for s in self.segments:
            if s.recording in recordings:
                out[s.rows] = True
        return out

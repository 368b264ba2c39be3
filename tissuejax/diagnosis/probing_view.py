"""Probings as they are weighed: all channels in units of their size, predicted cheaply and corrected where it counts.

Most predictions come from the coarse simulation, to which is added what the fine one differed from it at one set of
values, the anchor:

    y(theta) = coarse(theta) + [fine(anchor) - coarse(anchor)].

A fit is anchored anew where it came to rest, so its residual is that of the fine simulation, and where both agree on
the slopes it is the fine simulation's fit. The same difference tells what mesh and step leave open at the fine one:
for a mesh of order two and a step whose drag and lag are in proportion to it, `REMAINS` of the change between the two.
That is the known part of the discrepancy.

Source: additive correction of a cheap model, Alexandrov and Lewis 2001, Optimization and Engineering 2; extrapolation,
Richardson 1911, Phil. Trans. R. Soc. A 210.
"""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.bench import Bench, Candidate
from tissuejax.diagnosis.judgement.blocks import Blocks, blocks
from tissuejax.diagnosis.probing import ProbingBench
from tissuejax.diagnosis.probing_runs import COARSE, FINE
from tissuejax.estimation.discrepancy import ALIKE, LAW, SLOW, STATES, Part, loading_states, smooth_factor

BLOCKS = {"force": 80, "markers": 16}  # block means of a series: markers are many and calm
REMAINS = 1.2  # mesh 12 to 16 elements: 1 / (16^2 / 12^2 - 1) = 1.29; step halved: 1


class ProbingView(Bench):
    """A probing bench to be weighed; see the module's text.

    Attributes beyond those of `Bench`:
        source: the probings in SI units.
        origin, unit: of each row: a marker's place at rest, and the largest force or displacement.
        shift: correction of the coarse simulation, SI.
    """

    @classmethod
    def of(cls, source: ProbingBench) -> "ProbingView":
        """The view of probings, not anchored yet: predictions are those of the coarse simulation."""
        origin, unit = np.zeros(len(source.y)), np.ones(len(source.y))
        for s in source.segments:
            if s.channel == "markers":
                early = source.y[s.rows][: max(len(s.time) // 10, 5)]
                origin[s.rows] = np.median(early)
        for channel in dict.fromkeys(s.channel for s in source.segments):
            own = [s for s in source.segments if s.channel == channel]
            largest = max(float(np.quantile(np.abs((source.y - origin)[s.rows]), 0.98)) for s in own)
            for s in own:
                unit[s.rows] = largest or 1.0
        made = cls(
            source.segments,
            (source.y - origin) / unit,
            source.sigma / unit,
            source.fitted,
            source.held_out,
            source.base,
            source.free,
            source.start,
            source.candidates,
            source.warnings,
        )
        made.source, made.origin, made.unit = source, origin, unit
        made.shift, made._open = np.zeros(len(source.y)), None
        return made

    @property
    def spent(self) -> float:
        """Cost of all runs so far, in predictions of the coarse simulation."""
        return 0.0 if not hasattr(self, "source") else self.source.runs.cost / len(self.source.runs.rows)

    @spent.setter
    def spent(self, value: float) -> None:
        pass  # the runs count themselves

    @property
    def shown(self) -> ProbingBench:
        """See `Bench.shown`."""
        return self.source

    def natural(self, prediction: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
        """See `Bench.natural`."""
        return prediction * self.unit + self.origin

    def anchored(self, values: Mapping[str, float]) -> "ProbingView":
        """See `Bench.anchored`; two runs of every recording, one of them on the fine mesh."""
        names = (*self.fitted, *self.held_out)
        at = self.source.at({p: v for p, v in values.items() if p in self.free})
        fine, coarse = self.source.runs.many([(at, names, FINE), (at, names, COARSE)])
        made = copy.copy(self)
        made.shift = fine - coarse
        made._open = self._errors(REMAINS * made.shift / self.unit)
        return made

    @property
    def numerical(self) -> Float[np.ndarray, "N q"] | None:
        """See `Bench.numerical`."""
        return self._open

    def _errors(self, change: Float[np.ndarray, " N"]) -> Float[np.ndarray, "N q"]:
        """A column for every channel of every recording: meshes are graded to their sites and err each in its way."""
        pairs = list(dict.fromkeys((s.recording, s.channel) for s in self.segments))
        out = np.zeros((len(change), len(pairs)))
        for s in self.segments:
            out[s.rows, pairs.index((s.recording, s.channel))] = change[s.rows]
        return np.nan_to_num(out)

    def predict(self, values: Mapping[str, float], recordings: Sequence[str] | None = None) -> Float[np.ndarray, " N"]:
        """See `Bench.predict`; NaN where a simulation broke down."""
        wanted = tuple(recordings or (*self.fitted, *self.held_out))
        told = self.source.runs.many([(self.source.at(values), wanted, COARSE)])[0]
        return (told + self.shift - self.origin) / self.unit

    def jacobian(
        self, values: Mapping[str, float], paths: Sequence[str], recordings: Sequence[str] | None = None
    ) -> Float[np.ndarray, "N k"]:
        """See `Bench.jacobian`."""
        return self.source.jacobian(values, paths, recordings) / self.unit[:, None]

    def columns(
        self, values: Mapping[str, float], settings: Sequence[tuple[Mapping[str, float], str]]
    ) -> Float[np.ndarray, "N k"]:
        """See `Bench.columns`."""
        return self.source.columns(values, settings) / self.unit[:, None]

    def settings(self, candidate: Candidate, prediction: Float[np.ndarray, " N"]) -> Sequence[Mapping[str, float]]:
        """See `Bench.settings`."""
        return self.source.settings(candidate, self.natural(prediction))


def probing_blocks(view: ProbingView) -> Blocks:
    """Block means of forces and markers."""
    return blocks(view, BLOCKS)


@dataclass(frozen=True)
class ProbingDiscrepancy:
    """What any model leaves of probings; forces and markers err apart, so each part has an amplitude of its own.

    Attributes:
        shaped: name, family and factors about a prediction of one, of the parts that scale with what is predicted.
        fixed: the parts that don't.
    """

    shaped: tuple[tuple[str, str, Float[np.ndarray, "M r"]], ...]
    fixed: tuple[Part, ...]

    def about(self, prediction: Float[np.ndarray, " M"]) -> tuple[Part, ...]:
        """The parts beside this prediction; always in the same order."""
        return (*(Part(name, family, prediction[:, None] * f) for name, family, f in self.shaped), *self.fixed)


def probing_discrepancy(view: ProbingView, cut: Blocks) -> ProbingDiscrepancy:
    """The discrepancy of probings, in the families of material tests and one of each marker's own.

    Law: smooth in depth times the prediction, common to all recordings. Gain, own law: of each recording's own.
    Hysteresis (of the force) and slow wander: in units of the channel's largest value. Marker: smooth in depth times
    what the marker moved, of each component's own, since a marker is not quite where it was registered.
    """
    segments = view.segments
    rows = [np.flatnonzero(cut.owner == k) for k in range(len(segments))]
    depth, time = cut.mean(_joined(view, "drive")), cut.mean(_joined(view, "time"))
    span = float(np.ptp(depth)) or 1.0
    channel = np.array([segments[k].channel for k in cut.owner])
    recording = np.array([segments[k].recording for k in cut.owner])
    grid = np.linspace(depth.min(), depth.max(), 60)

    def smooth_in_depth(length: float) -> Float[np.ndarray, "M r"]:
        known = smooth_factor(grid[:, None], length)
        return np.stack([np.interp(depth, grid, f) for f in known.T], axis=1)

    wide, fine, alike = (smooth_in_depth(length) for length in (LAW["law"], LAW["fine law"], ALIKE))
    states = np.zeros((len(cut.starts), len(STATES)))
    for k, s in enumerate(segments):
        own = Blocks(cut.starts[rows[k]] - s.rows.start, cut.counts[rows[k]], np.zeros(0, int))
        states[rows[k]] = own.mean(loading_states(s.drive))
    shaped, fixed = [], []
    for c in dict.fromkeys(channel.tolist()):
        inside = (channel == c)[:, None]
        of = "" if c == "force" else f" of {c}"
        each = [inside * (recording == r)[:, None] for r in dict.fromkeys(recording.tolist())]
        shaped.append((f"law{of}", "law", wide * inside))
        shaped.append((f"gain{of}", "gain", np.concatenate(each, axis=1).astype(float)))
        shaped.append((f"own law{of}", "gain", np.concatenate([wide * e for e in each], axis=1)))
        if c == "force":
            shaped.append(("fine law", "law", fine * inside))
            for i, shape in enumerate(STATES):
                fixed.append(Part(f"hysteresis, {shape}", "hysteresis", alike * inside * states[:, i, None]))
        for name, share in SLOW.items():
            if c == "force" or name == "lasting":
                fixed.append(Part(f"{name}{of}", "slow", within=_within(rows, inside, _wander(time, share))))
        sigma = cut.spread(view.sigma)
        scatter = [np.diag((sigma[o] / max(float(np.median(sigma[o])), 1e-300)) ** 2) * inside[o[0]] for o in rows]
        fixed.append(Part(f"white{of}", "white", within=tuple(scatter)))
    if (channel == "markers").any():
        travel = np.concatenate([_travel(view, s) for s in segments])
        moved = cut.mean(travel)

        def marker(o: np.ndarray) -> np.ndarray:
            near = np.exp(-0.5 * ((depth[o][:, None] - depth[o]) / span / LAW["law"]) ** 2)
            return near * np.outer(moved[o], moved[o])

        fixed.append(Part("marker", "marker", within=_within(rows, (channel == "markers")[:, None], marker)))
    return ProbingDiscrepancy(tuple(shaped), tuple(fixed))


def _within(rows, inside, block) -> tuple[Float[np.ndarray, "n n"], ...]:
    return tuple(block(o) * inside[o[0]] for o in rows)


def _wander(time: Float[np.ndarray, " M"], share: float):
    def block(o: np.ndarray) -> np.ndarray:
        elapsed = time[o] / (float(np.ptp(time[o])) or 1.0)
        return np.exp(-np.abs(elapsed[:, None] - elapsed) / share)

    return block


def _joined(view: ProbingView, what: str) -> Float[np.ndarray, " N"]:
    return np.concatenate([getattr(s, what) for s in view.segments])


def _travel(view: ProbingView, s) -> Float[np.ndarray, " n"]:
    """How far a marker has moved, all components, in units of the largest displacement; 0 for a force."""
    if s.channel != "markers":
        return np.zeros(len(s.time))
    marker = s.component.rsplit(" ", 1)[0]
    own = [o for o in view.segments if o.recording == s.recording and o.component.rsplit(" ", 1)[0] == marker]
    return np.sqrt(sum(np.interp(s.time, o.time, view.y[o.rows]) ** 2 for o in own))

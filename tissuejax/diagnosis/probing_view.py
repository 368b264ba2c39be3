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

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.bench import Bench, Candidate
from tissuejax.diagnosis.judgement.blocks import Blocks, blocks
from tissuejax.diagnosis.probing import ProbingBench
from tissuejax.diagnosis.probing_runs import COARSE, FINE
from tissuejax.estimation.discrepancy import (
    ALIKE,
    LAW,
    SLOW,
    STATES,
    Discrepancy,
    Part,
    loading_states,
    smooth_factor,
)

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


def probing_discrepancy(view: ProbingView, cut: Blocks) -> Discrepancy:
    """What any model leaves of probings; the families are those of material tests, and one of each marker's own.

    Law: smooth in depth times the prediction, common to all recordings. Gain, own law: of each recording's and
    channel's own. Marker: smooth in depth times what the marker moved, of each component's own (a marker is not where
    it was registered). Hysteresis and slow wander: in units of the channel's largest value.
    """
    segments, n = view.segments, len(cut.starts)
    rows = [np.flatnonzero(cut.owner == k) for k in range(len(segments))]
    depth = cut.mean(_drive(view))
    channel = np.array([segments[k].channel for k in cut.owner])
    recording = np.array([segments[k].recording for k in cut.owner])
    channels = list(dict.fromkeys(channel.tolist()))
    sets = [(channel == c) for c in channels]
    each = [(recording == r) & (channel == c) for c in channels for r in dict.fromkeys(recording.tolist())]

    grid = np.linspace(depth.min(), depth.max(), 60)

    def columns(groups: Sequence[np.ndarray], length: float) -> Float[np.ndarray, "M r"]:
        known = smooth_factor(grid[:, None], length)
        factor = np.stack([np.interp(depth, grid, f) for f in known.T], axis=1)
        return np.concatenate([factor * inside[:, None] for inside in groups], axis=1)

    states = np.zeros((n, len(STATES)))
    moved, time = np.zeros(n), cut.mean(_times(view))
    for k, s in enumerate(segments):
        one = Blocks(cut.starts[rows[k]] - s.rows.start, cut.counts[rows[k]], np.zeros(0, int))
        states[rows[k]] = one.mean(loading_states(s.drive))
        if s.channel == "markers":
            moved[rows[k]] = one.mean(_travel(view, s))
    near = columns(sets, ALIKE)
    fixed = [Part(f"hysteresis, {shape}", "hysteresis", near * states[:, i, None]) for i, shape in enumerate(STATES)]
    for name, share in SLOW.items():
        within = []
        for own in rows:
            elapsed = time[own] / (float(np.ptp(time[own])) or 1.0)
            within.append(np.exp(-np.abs(elapsed[:, None] - elapsed) / share))
        fixed.append(Part(name, "slow", within=tuple(within)))
    spans = float(np.ptp(depth)) or 1.0
    alike = [np.exp(-0.5 * ((depth[o][:, None] - depth[o]) / spans / LAW["law"]) ** 2) for o in rows]
    fixed.append(Part("marker", "marker", within=tuple(a * np.outer(moved[o], moved[o]) for a, o in zip(alike, rows))))
    sigma = cut.spread(view.sigma)
    scatter = [np.diag((sigma[o] / max(float(np.median(sigma[o])), 1e-300)) ** 2) for o in rows]
    fixed.append(Part("white", "white", within=tuple(scatter)))
    laws = tuple((name, columns(sets if name == "law" else sets[:1], length)) for name, length in LAW.items())
    belongs = np.stack([e.astype(float) for e in each], axis=1)
    return Discrepancy(laws, belongs, columns(each, LAW["law"]), tuple(fixed))


def _drive(view: ProbingView) -> Float[np.ndarray, " N"]:
    return np.concatenate([s.drive for s in view.segments])


def _times(view: ProbingView) -> Float[np.ndarray, " N"]:
    return np.concatenate([s.time for s in view.segments])


def _travel(view: ProbingView, s) -> Float[np.ndarray, " n"]:
    """How far a marker has moved, all components, in units of the largest displacement."""
    marker = s.component.rsplit(" ", 1)[0]
    own = [o for o in view.segments if o.recording == s.recording and o.component.rsplit(" ", 1)[0] == marker]
    return np.sqrt(sum(np.interp(s.time, o.time, view.y[o.rows]) ** 2 for o in own))

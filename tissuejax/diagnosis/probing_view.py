"""Probings as they are weighed: all channels in units of their size, predicted cheaply and corrected where it counts.

Most predictions come from the coarse simulation: a coarse mesh, run twice as fast as the fine one. At one set of
values, the anchor, the fine mesh is run too, and the coarse one at the speed of the fine one (slow):

    y(theta) = fine + calmed(coarse(theta) - coarse) - late [d slow / dt]    (without theta: at the anchor).

Only what differs slowly between two coarse runs is taken (`ProbingBench.calmed`): their ringing moved the evidence of
one set by 15 nats between two places that describe p02 equally well. The last term takes out what the fine simulation
still errs by its speed. Tissue that is moved faster than life is held back by damping and inertia: loading is too stiff
and unloading too soft, as if the measurement came late, and a late clock or a tissue that remembers would be named for
it. By how much, of each channel of each recording, is read from slow - coarse by least squares; what else the two
differ in is ringing, another one at each speed. An error of first order in the speed (damping) is as large again as
that difference, one of second order (inertia) a third of it: `Simulated.late` takes the middle, `Simulated.open` the
half way to both.

A fit is anchored anew where it came to rest. What is left open is the known part of the discrepancy: of the mesh, of
order two, `Simulated.remains` of the change from coarse to fine; of the speed `Simulated.open` of slow - coarse.

A column of the Jacobian is a simulation of every recording too: those of the base's fit nominate effects, and a descent
takes those it finds nearby (`probing_slopes`).

Source: additive correction of a cheap model, Alexandrov and Lewis 2001, Optimization and Engineering 2; extrapolation,
Richardson 1911, Phil. Trans. R. Soc. A 210.
"""

import copy
from collections.abc import Mapping, Sequence
from typing import ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from tissuejax.diagnosis.bench import Bench, Candidate
from tissuejax.diagnosis.judgement.blocks import Blocks, blocks
from tissuejax.diagnosis.judgement.particular import MEANS, SIMULATED, Simulated
from tissuejax.diagnosis.probing import ProbingBench
from tissuejax.diagnosis.probing_added import added, is_added
from tissuejax.diagnosis.probing_runs import COARSE, FINE, RETIMED
from tissuejax.diagnosis.probing_slopes import Slope
from tissuejax.experiments.probing_sensors import FEWEST


class Here(NamedTuple):
    """Where columns are wanted: all values, for which recordings, and the coarse prediction there, also calmed."""

    values: Mapping[str, float]
    wanted: tuple[str, ...]
    run: Float[np.ndarray, " N"]
    calmed: Float[np.ndarray, " N"]


class ProbingView(Bench):
    """A probing bench to be weighed; see the module's text.

    Attributes beyond those of `Bench`:
        source: the probings in SI units.
        numbers: see `Simulated`.
        origin, unit: of each row: a marker's place at rest, and the largest force or displacement.
        shift: correction of the coarse simulation, SI; `place`: what that simulation predicts where it was taken; None
            before.
        root: the base's fit, where columns of scores are taken; None until it is known.
        reach: change of the prediction up to which a derivative is taken from nearby.
    """

    costly: ClassVar[bool] = True

    @classmethod
    def of(cls, source: ProbingBench, numbers: Simulated = SIMULATED, peak: float = MEANS.peak) -> "ProbingView":
        """The view of probings, not anchored yet: predictions are those of the coarse simulation.

        Args:
            peak: quantile of a channel's size that is its unit.
        """
        origin, unit = np.zeros(len(source.y)), np.ones(len(source.y))
        for s in source.segments:
            if s.channel == "markers":
                early = source.y[s.rows][: max(len(s.time) // numbers.early, numbers.fewest)]
                origin[s.rows] = np.median(early)
        for channel in dict.fromkeys(s.channel for s in source.segments):
            own = [s for s in source.segments if s.channel == channel]
            largest = max(float(np.quantile(np.abs((source.y - origin)[s.rows]), peak)) for s in own)
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
        made.shift, made._open, made.place = np.zeros(len(source.y)), None, None
        made.numbers, made.root, made.reach, made.stays = numbers, None, numbers.reach, numbers.stays
        return made

    @property
    def spent(self) -> float:
        """Cost of all runs so far, in predictions of the coarse simulation."""
        return self.source.runs.cost / len(self.source.runs.rows)

    @property
    def shown(self) -> ProbingBench:
        """See `Bench.shown`."""
        return self.source

    def natural(self, prediction: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
        """See `Bench.natural`."""
        return prediction * self.unit + self.origin

    def anchored(self, values: Mapping[str, float]) -> "ProbingView":
        """See `Bench.anchored`; three runs of every recording, one of them on the fine mesh.

        Where the prediction has hardly changed since the last anchor that one stays: the correction changes in
        proportion to what it corrects.
        """
        names = (*self.fitted, *self.held_out)
        at = self.source.at({p: v for p, v in values.items() if p in self.free})
        if self.place is not None:
            coarse_run = self.source.runs.many([(at, names, COARSE)])[0]
            if self._change(coarse_run, self.source.calmed(self.place - coarse_run), names) < self.stays:
                return self
        fine, slow, coarse = self.source.runs.many([(at, names, k) for k in (FINE, RETIMED, COARSE)])
        made = copy.copy(self)
        late = self._held_back(slow, coarse)
        made.shift, made.place = fine - coarse + self.numbers.late * late, coarse
        made._open = {
            "mesh": self._errors(self.numbers.remains * self.source.calmed(fine - slow) / self.unit),
            "speed": self._errors(self.numbers.open * late / self.unit),
            "ringing": self._ringing(slow - coarse) / self.unit,
        }
        return made

    def corrected_as(self, other: Bench) -> "ProbingView":
        """See `Bench.corrected_as`."""
        if not isinstance(other, ProbingView):
            return self
        made = copy.copy(self)
        made.shift, made.place, made._open = other.shift, other.place, other._open
        return made

    def nearer(self, values: Mapping[str, float]) -> "ProbingView":
        """See `Bench.nearer`."""
        near = copy.copy(self)
        near.stays = self.numbers.far
        made = near.anchored(values)
        made.stays = self.stays
        return made

    def _held_back(self, slow: Float[np.ndarray, " N"], coarse: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
        """The part of slow - coarse that is as if each channel of a recording came late."""
        rate, out = np.zeros(len(slow)), np.zeros(len(slow))
        for s in self.segments:
            rate[s.rows] = gaussian_filter1d(np.gradient(slow[s.rows], s.time), self.numbers.calmed)
        for pair in dict.fromkeys((s.recording, s.channel) for s in self.segments):
            rows = np.concatenate([np.r_[s.rows] for s in self.segments if (s.recording, s.channel) == pair])
            r, size = rate[rows], float(rate[rows] @ rate[rows])
            out[rows] = r * float(r @ (slow - coarse)[rows]) / size if size > 0 else 0.0
        return out

    def _ringing(self, difference: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
        """How much of a fine run rings, where the probe starts or stops: its size there, for its phase is not known.

        What rings of the difference of two speeds, as large as an error of first order in the speed leaves it.
        """
        out, rings = np.zeros(len(difference)), difference - self.source.calmed(difference)
        for s in self.segments:
            out[s.rows] = np.sqrt(gaussian_filter1d(np.nan_to_num(rings[s.rows]) ** 2, self.numbers.calmed))
        return out

    @property
    def numerical(self) -> Mapping[str, Float[np.ndarray, "N ..."]] | None:
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
        at = self.source.at(values)
        coarse_run = self.source.runs.many([(at, wanted, COARSE)])[0]
        if self.place is not None:
            coarse_run = self.place + self.source.calmed(coarse_run - self.place)
        heard = self.mask(wanted) * added(self.source.runs, at)
        return (coarse_run + heard + self.shift - self.origin) / self.unit

    def rooted(self, values: Mapping[str, float]) -> "ProbingView":
        """See `Bench.rooted`."""
        made = copy.copy(self)
        made.root, made.stays = self.source.at({p: v for p, v in values.items() if p in self.free}), self.numbers.common
        return made

    def sharpened(self) -> "ProbingView":
        """See `Bench.sharpened`."""
        made = copy.copy(self)
        made.reach = self.numbers.sharp
        return made

    def jacobian(
        self, values: Mapping[str, float], paths: Sequence[str], recordings: Sequence[str] | None = None
    ) -> Float[np.ndarray, "N k"]:
        """See `Bench.jacobian`; columns taken nearby are taken again."""
        wanted = tuple(recordings or (*self.fitted, *self.held_out))
        at = {**{p: self.source.start[p] for p in paths}, **self.source.at(values)}
        free = {p for p in paths if is_added(self.source.runs, p)}  # exact, and as cheap as a look
        here = None if free.issuperset(paths) else self._here([at], wanted)[0]
        columns = {p: self._nearby(p, here) if here and p not in free else None for p in paths}
        missing = [p for p, c in columns.items() if c is None]
        if missing:
            made = self.source.jacobian(values, missing, wanted)
            for p, column in zip(missing, made.T, strict=True):
                columns[p] = self._kept(p, here, column) if here and p not in free else column
        return np.stack([columns[p] for p in paths], axis=1) / self.unit[:, None]

    def columns(
        self, values: Mapping[str, float], settings: Sequence[tuple[Mapping[str, float], str]]
    ) -> Float[np.ndarray, "N k"]:
        """See `Bench.columns`; about the base's fit once that is known: a score only has to nominate."""
        base = self.source.at(values) if self.root is None else self.root
        asked = [({**base, p: self.source.start[p], **s}, p) for s, p in settings]
        asked = [({**at, p: base.get(p, self.source.start[p])}, p) for at, p in asked]
        free = [is_added(self.source.runs, p) for _, p in asked]
        found = iter(self._here([at for (at, _), alone in zip(asked, free, strict=True) if not alone], self.fitted))
        here = [None if alone else next(found) for alone in free]
        columns = [self._nearby(p, h) if h else None for (_, p), h in zip(asked, here, strict=True)]
        missing = [i for i, c in enumerate(columns) if c is None]
        if missing:
            made = self.source.columns(base, [settings[i] for i in missing])
            for i, column in zip(missing, made.T, strict=True):
                h = here[i]
                columns[i] = self._kept(asked[i][1], h, column) if h else column
        return np.stack(columns, axis=1) / self.unit[:, None]

    def _here(self, places: Sequence[Mapping[str, float]], wanted: Sequence[str]) -> list[Here]:
        runs = self.source.runs.many([(at, tuple(wanted), COARSE) for at in places])
        return [Here(at, tuple(wanted), run, self.source.calmed(run)) for at, run in zip(places, runs, strict=True)]

    def _nearby(self, path: str, here: Here) -> Float[np.ndarray, " N"] | None:
        def change(other: Float[np.ndarray, " N"]) -> float:
            return self._change(here.run, other - here.calmed, here.wanted)

        taken, shape = self.source.slopes_taken, self.numbers.shape
        return taken.find(path, here.values, self.free, here.wanted, change, self.reach, shape)

    def _kept(self, path: str, here: Here, column: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
        self.source.slopes_taken.keep(path, Slope(here.values, here.calmed, frozenset(here.wanted), column))
        return column

    def _change(self, run: Float[np.ndarray, " N"], moved: Float[np.ndarray, " N"], recordings: Sequence[str]) -> float:
        """How far a prediction has `moved`, calmed, over how far it is from the origin, of the channel where that is
        largest: markers feel no stiffness."""
        out = 0.0
        for channel in dict.fromkeys(s.channel for s in self.segments):
            own = [np.r_[s.rows] for s in self.segments if s.channel == channel and s.recording in recordings]
            rows = np.concatenate(own) if own else np.zeros(0, int)
            size = float(np.linalg.norm((run - self.origin)[rows] / self.unit[rows]))
            out = max(out, float(np.linalg.norm(moved[rows] / self.unit[rows])) / max(size, 1e-300))
        return out

    @property
    def shared(self) -> Float[np.ndarray, " S"]:
        """See `Bench.shared`: where a marker rests is measured too, as the mean of the frames out of contact.

        A prediction starts from that mean, so its error stays in the whole series.
        """
        frames = {}
        for s in self.segments:
            if s.channel == "markers":
                touch = float(self.source.ready.setups[s.recording].test.first_touch)
                calm = int(np.sum((s.drive <= 0) & (s.time < touch)))
                frames[s.recording, s.component] = calm if calm >= FEWEST else int(np.sum(s.drive <= 0))
        rests = [np.asarray(self.source.ready.setups[n].test.rest, float) for n, _ in frames]
        pooled = bool(rests) and all(r.shape == rests[0].shape and np.allclose(r, rests[0]) for r in rests)
        out = np.zeros(len(self.segments))
        for i, s in enumerate(self.segments):
            if s.channel == "markers":
                own = frames[s.recording, s.component]
                several = sum(n for (_, c), n in frames.items() if c == s.component) if pooled else own
                out[i] = float(np.median(self.sigma[s.rows])) / np.sqrt(max(several, 1))
        return out

    def settings(self, candidate: Candidate, prediction: Float[np.ndarray, " N"]) -> Sequence[Mapping[str, float]]:
        """See `Bench.settings`."""
        return self.source.settings(candidate, self.natural(prediction))


def probing_blocks(view: ProbingView) -> Blocks:
    """Block means of forces and markers."""
    return blocks(view, view.numbers.means)

"""The simulations behind a probing bench: each run once, remembered, kept on disk, side by side on the cores.

One recording at one set of values is one run. An effect at its neutral value changes no bit, so effects are compiled
together in groups (few programs), and values of an effect whose amplitudes are all zero do not count. A run that
breaks down is done again with smaller steps: values far from the truth, stiff in volume, are on the way to it. A
diagnosis that
was stopped and is started again asks for the same runs in the same order and finds them on disk.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from tissuejax.cache.key import described
from tissuejax.diagnosis.probing_series import picked
from tissuejax.effects.effect import Effect
from tissuejax.estimation.finished import Finished
from tissuejax.estimation.series import Segment
from tissuejax.experiments import workers
from tissuejax.experiments.probing_predictor import ProbingPredictor
from tissuejax.experiments.soundness import checks
from tissuejax.model import Model

# Effects compiled together (`Effect.group`). The first group is in every program; histories take long and stay apart.
TOGETHER = ("rig", "base", "history", "contact", "law")
SMALLER = 2.0  # times: the step of a run that broke down
BATCH = 12  # runs after which progress is reported
ROUGH = (12, 12, 5)  # elements of the mesh for differences
# that counts; the mesh for differences at its speed; the same at twice that speed
FINE, RETIMED, COARSE = "fine", "retimed", "coarse"

Asked = tuple[Mapping[str, float], tuple[str, ...], str]  # values, recordings, which simulation


@dataclass
class Runs:
    """Simulations of one sample.

    Attributes:
        ready: the prepared simulations, by their name (`FINE`, `COARSE`, or a variation to compare with).
        effects: by name.
        segments: of the bench; y its measurements.
        finite: which samples of its channel a segment holds.
        folder: where runs are kept; None keeps them in memory only.
        report: called after every batch with the number of runs done so far.
        checks: how the runs of this process went, by what was asked for.
        count: runs done. cost: runs asked for, done or found on disk, in those of the coarse simulation.
    """

    ready: dict[str, ProbingPredictor]
    effects: Mapping[str, Effect]
    segments: Sequence[Segment]
    y: Float[np.ndarray, " N"]
    finite: Mapping[int, np.ndarray]
    folder: Path | None = None
    report: Callable[[int], None] = lambda _: None
    count: int = 0
    cost: float = 0.0
    checks: dict[tuple, dict[str, float]] = field(default_factory=dict)
    _models: dict[tuple, ProbingPredictor] = field(default_factory=dict)

    def __post_init__(self):
        one = self.ready[FINE]
        self.rows = {
            n: slice(min(s.rows.start for s in own), max(s.rows.stop for s in own))
            for n in one.names
            for own in [[s for s in self.segments if s.recording == n]]
        }
        ready = {k: (p.model, p.settings, p.setups) for k, p in self.ready.items()}
        # mesh, path and radius of the probe, sensors, effects, settings: all that a run depends on
        depends = described((ready, self.effects, self.segments, self.y, self.finite))
        self.finished: Finished[np.ndarray] = Finished(self.folder, depends)

    def many(self, asked: Sequence[Asked]) -> list[Float[np.ndarray, " N"]]:
        """Simulations, one long vector each: as measured where a recording wasn't asked for, NaN where a run failed.

        Without what sensors add to what they report (`probing_added`).
        """
        keys = [[self._key(values, r, kind) for r in recordings] for values, recordings, kind in asked]
        new = self.finished.unknown(k for row in keys for k in row)
        self.cost += sum(self._price(kind) for _, kind, _ in new)
        missing = self.finished.missing(new)
        if missing:
            processes = self.ready[FINE].settings.processes
            for i in range(0, len(missing), BATCH):
                part = missing[i : i + BATCH]
                jobs = [self.job(dict(values), r, kind) for r, kind, values in part]
                done = workers.run_all(jobs, processes)
                broken = [k for k, run in enumerate(done) if int(run.failed) >= 0]
                again = [self.job(dict(values), r, kind, SMALLER) for r, kind, values in (part[k] for k in broken)]
                for k, run in zip(broken, workers.run_all(again, processes) if again else (), strict=True):
                    done[k] = run
                for key, run in zip(part, done, strict=True):
                    self.finished.keep(key, self._cut(key[0], run))
                    reach = float(self.ready[FINE].setups[key[0]].scene.pressed.shape.reach())
                    self.checks[key] = checks(run, reach)
                self.count += len(part)
                self.report(self.count)
        out = []
        for row in keys:
            predicted = self.y.copy()
            for key in row:
                predicted[self.rows[key[0]]] = self.finished[key]
            out.append(predicted)
        return out

    def went(self, values: Mapping[str, float]) -> dict[str, dict[str, float]]:
        """How the fine runs at these values went, by recording; without those that were found on disk."""
        keys = {r: self._key(values, r, FINE) for r in self.rows}
        return {r: self.checks[key] for r, key in keys.items() if key in self.checks}

    def _price(self, kind: str) -> float:
        """Elements times steps, of those of the coarse simulation."""
        one, other = self.ready[kind].settings, self.ready[COARSE].settings
        return math.prod(one.counts) / math.prod(other.counts) * other.compression / one.compression

    def job(self, values: Mapping[str, float], recording: str, kind: str, finer: float = 1.0) -> workers.Job:
        """What simulates one recording; with steps `finer` times smaller than usual."""
        _, _, counted = self._key(values, recording, kind)
        return self._predictor(kind, counted, finer).job(dict(counted), recording)

    def _key(self, values: Mapping[str, float], recording: str, kind: str) -> tuple:
        """Recording, simulation, and the values that count there: those of effects that are on, sorted.

        What sensors add to what they report is no business of a simulation (`probing_added`).
        """
        others = [n for n in self.rows if n != recording]
        own = {p: float(v) for p, v in values.items() if p.rsplit(".", 1)[-1] not in others}
        on = {
            p.split(".")[1]
            for p, v in own.items()
            if v != 0 and p.startswith("effects.") and p.split(".")[2] in self.effects[p.split(".")[1]].amplitudes
        }
        on = {n for n in on if not type(self.effects[n]).added}
        counted = {p: v for p, v in own.items() if not p.startswith("effects.") or p.split(".")[1] in on}
        return recording, kind, tuple(sorted(counted.items()))

    def _predictor(self, kind: str, values: Sequence[tuple[str, float]], finer: float = 1.0) -> ProbingPredictor:
        named = {p.split(".")[1] for p, _ in values if p.startswith("effects.")}
        of = [tuple(n for n in sorted(self.effects) if self.effects[n].group == group) for group in TOGETHER]
        groups = tuple(g for i, g in enumerate(of) if i == 0 or named.intersection(g))
        lone = tuple(sorted(named.difference(*of)))
        if (kind, groups, lone, finer) not in self._models:
            chosen = [self.effects[n] for n in (*sum(groups, ()), *lone) if n in self.effects]
            one = self.ready[kind]
            if finer != 1.0:
                one = one.with_settings(one.settings.changed(step=one.settings.step / finer))
            model = Model(one.model.energy, one.model.volumetric, tuple(chosen)).across(tuple(self.rows))
            made = ProbingPredictor(model, one.sample, one.names, one.settings, one.setups)
            self._models[kind, groups, lone, finer] = made
        return self._models[kind, groups, lone, finer]

    def _cut(self, recording: str, run) -> np.ndarray:
        out = np.empty(self.rows[recording].stop - self.rows[recording].start)
        begin = self.rows[recording].start
        for s in self.segments:
            if s.recording == recording:
                reported = self.ready[FINE].unpadded(recording, s.channel, np.asarray(run.channels[s.channel]))
                out[s.rows.start - begin : s.rows.stop - begin] = picked(reported, s, self.finite)
        return np.full_like(out, np.nan) if int(run.failed) >= 0 else out

    def forget(self) -> None:
        """The diagnosis is finished: remove what was kept on disk."""
        self.finished.forget()

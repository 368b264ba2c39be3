"""The bench of material tests: one compiled model with every effect in it, all neutral until freed.

Compilation would cost more than all the numerics, so no candidate gets a program of its own: the model holds all
effects of the catalogue, and a set of candidates is a choice of which parameters move. Time series are padded,
everything else is an argument: one program for a prediction, whatever the sample. Effects with memory, and those that
turn a prediction into a search (fibres, compressibility, a compliant rig), join the model only where they are freed.

Derivatives are one-sided differences in double precision (relative error 1e-6; a test holds them against forward
mode): a prediction takes about a millisecond, so they cost as much as forward mode to run, and nothing to compile,
where the linearised program takes three times as long to compile as the prediction.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar

import jax
import numpy as np
from jaxtyping import Array, Float

from tissuejax.cache.key import described
from tissuejax.cache.programs import Kept, ahead
from tissuejax.diagnosis.bench import Bench, Candidate, Free
from tissuejax.diagnosis.catalogue import Entry, entries, linked
from tissuejax.diagnosis.judgement.blocks import State, strain
from tissuejax.diagnosis.padding import lengthened, lengths
from tissuejax.diagnosis.periodogram import lines
from tissuejax.effects.form import Sizes
from tissuejax.effects.material_test import MaterialTest
from tissuejax.energies.energy import Energy
from tissuejax.estimation.series import Series, finest
from tissuejax.experiments.catalogue import experiment
from tissuejax.experiments.homogeneous import nominal_stress
from tissuejax.model import Model
from tissuejax.recordings.recording import Sample

STRESS_CHANNEL = "nominal_stress"
STEP = 1e-6  # of a parameter's scale
STRESS = 0.05  # of the largest stress: the scale of a modulus or an offset


@dataclass(frozen=True, eq=False)
class Program:
    """A model that takes part in a search.

    Attributes:
        run: its compiled prediction, from theta (a value for every declared parameter) and a test.
        places: by recording, neutral theta and where values go in it (`MaterialBench._places`).
        price: what a prediction costs beside that of the base model.
    """

    run: Kept
    places: Mapping[str, tuple[np.ndarray, tuple[dict[str, int], ...]]]
    price: float


@lru_cache(maxsize=64)
def compiled(model: Model) -> Kept:
    """One program a model, shared by all benches: hashing it at every call took a tenth of a diagnosis."""

    def predicted(theta: Float[Array, " p"], test: MaterialTest) -> Float[Array, "n ..."]:
        return nominal_stress(model, dict(zip(model.declared, theta)), test)

    return Kept(predicted, described(model))


class MaterialBench(Bench):
    """Material tests of one sample; see `Bench`."""

    machine: ClassVar[bool] = True

    @classmethod
    def of(
        cls,
        sample: Sample,
        energy: Energy,
        fitted: tuple[str, ...],
        held_out: tuple[str, ...],
        sigma: Mapping[str, float],
        names: Sequence[str] | None = None,
        sizes: Sizes | None = None,
    ) -> "MaterialBench":
        """The bench of `sample` with base model `energy`.

        Args:
            sigma: noise standard deviation of each recording, Pa.
            names: effects to try; all that act in material tests by default.
            sizes: of the recordings; worked out by default.
        """
        recordings = (*fitted, *held_out)
        tests = {n: experiment(sample.recordings[n].experiment).test(sample.recordings[n]) for n in recordings}
        to = lengths([len(t.time) for t in tests.values()])
        tests = {n: lengthened(t, k) for (n, t), k in zip(tests.items(), to, strict=True)}
        first = min(float(t.start) for t in tests.values())  # the clock's zero means nothing, only what has passed
        tests = {n: replace(t, start=t.start - first) for n, t in tests.items()}
        measured = Series.of(sample, dict.fromkeys(recordings, (STRESS_CHANNEL,)), lost=True)
        segments = measured.segments
        bench = cls(
            segments=segments,
            y=measured.y,
            sigma=np.concatenate([np.full(len(s.time), sigma[s.recording]) for s in segments]),
            fitted=fitted,
            held_out=held_out,
            base=(),
            free={},
            start={},
            candidates={},
            estimated=not any(sample.recordings[n].channels[STRESS_CHANNEL].noise_std for n in fitted),
        )
        bench._lay(tests)
        bench._of = {n: [s for s in segments if s.recording == n] for n in recordings}
        strain = max(float(np.max(np.abs(np.log(s.drive) if s.drive_name == "stretch" else s.drive))) for s in segments)
        top = bench._top = float(np.quantile(np.abs(bench.y), 0.98))
        ends = [float(t.start + np.ptp(t.time)) for t in tests.values()]
        sizes = sizes or Sizes(
            energy=0.5 * top * strain or 1.0,
            strain=strain or 1.0,
            force=top * float(np.nanmax([*(t.area for t in tests.values()), 1e-6])) or 1.0,
            session=max(ends),
            recording=max(float(np.ptp(t.time)) for t in tests.values()),
            step=max(float(np.median(np.diff(s.time))) for s in segments),
            finest=finest(s.time for s in segments),
        )
        bench.sizes = sizes
        found = [e for e in entries(sizes) if names is None or e.title in names]
        bench._declare(energy, found)
        bench._size_up()
        return bench

    def _lay(self, tests: Mapping[str, MaterialTest]) -> None:
        """Take these tests for what was done, by recording."""
        self._tests = dict(tests)
        self._given = {n: jax.device_put(t) for n, t in tests.items()}  # once, and not at every prediction
        self._ready: dict[tuple[Program, str], tuple[Callable, list]] = {}

    @property
    def starts(self) -> dict[str, float]:
        """When each recording began, s since the first one."""
        return {n: float(t.start) for n, t in self._tests.items()}

    @property
    def isotropic(self) -> bool:
        """Whether the base model, known physics included, knows no direction."""
        acting = {p.split(".")[1] for p in (*self.known, *self.base) if p.startswith("effects.")}
        return self._energy.isotropic and all(e.effect.isotropic for e in self._entries if e.effect.name in acting)

    def _declare(self, energy: Energy, found: list[Entry]) -> None:
        recordings = (*self.fitted, *self.held_out)
        every, found = found, [e for e in found if e.effect.parameters]  # the others have nothing to predict
        self._energy, self._entries = energy, found
        self._built: dict[tuple[str, ...], Program] = {}
        self._full = [e.effect for e in found if e.simple is not None]
        self._searched = {e.effect.name for e in found if e.searches}
        self._remembering = {e.effect.name for e in found if e.effect.history}
        self._added = tuple(f"effects.{e.effect.name}." for e in found if e.effect.added)
        heavy = self._searched | self._remembering
        self._heavy = {f"effects.{e.effect.name}.": e.effect.name for e in found if e.effect.name in heavy}
        whole = Model(energy, None, tuple(e.effect for e in found)).across(recordings)
        self._needs_full = {
            f"effects.{e.effect.name}.{p.name}": e.effect.name
            for e in found
            if e.simple is not None
            for p in e.effect.parameters
            if p.name not in {q.name for q in e.simple.parameters}
        }
        self._neutral = {p: d.default for p, d in whole.declared.items()}
        for entry in found:
            self._neutral |= {f"effects.{entry.effect.name}.{k}": v for k, v in entry.effect.neutral.items()}
        for path, p in whole.declared.items():
            if path.startswith("energy.") and not p.frozen:
                self.free[path] = self._fitting(Free(p.lower, p.upper, p.typical, p.unit))
                self.start[path] = p.default
        self.base = tuple(self.free)
        for entry in every:
            free, start, candidates = entry.declare(whole, self.fitted, self.held_out)
            self.free.update({path: self._fitting(f) for path, f in free.items()})
            self.start.update(start)
            self.candidates.update({c.key: c for c in candidates})
        self.candidates = linked(found, self.candidates)
        self._amplitudes = {p for c in self.candidates.values() for p in c.amplitudes}

    def _fitting(self, f: Free) -> Free:
        """The same with a scale that fits the recordings' stress, whatever the declared one was made for: beside what
        changes all of the stress by a tenth a step by a soft tissue's modulus is no more than the error of a difference
        in skin, tendon or rubber, and would never be taken."""
        usual = STRESS * self._top
        units = {"Pa": usual, "Pa/s": usual / self.sizes.recording, "1/Pa": STRESS / (self._top or 1.0)}
        return f if f.log or not usual else replace(f, scale=units.get(f.unit, f.scale))

    def _size_up(self) -> None:
        """Bring the base's moduli to the size that the recordings ask for.

        A descent that starts at soft tissue doesn't find rubber: with a law that ends at a limiting stretch it stops.
        """
        rows = self.mask(self.fitted)
        p = self.predict({}, self.fitted)[rows]
        ratio = float(p @ self.y[rows] / max(p @ p, 1e-300)) if np.all(np.isfinite(p)) else 1.0
        if ratio > 0:
            for path in self.base:
                self.start[path] *= ratio if self.free[path].unit == "Pa" else 1.0

    def _program(self, values: Mapping[str, float]) -> Program:
        """The program for a set of moving paths: all that costs nothing at once, and of the others what takes part."""
        parts = {d for p in values for prefix, d in self._heavy.items() if p.startswith(prefix)}
        if parts & self._remembering:  # together: one program fewer to compile
            parts |= self._remembering
        full = {self._needs_full[p] for p in values if p in self._needs_full}
        key = (*sorted(parts), *sorted(full))
        if key not in self._built:
            light = [e for e in self._entries if e.effect.name not in self._heavy.values()]
            taking = [*light, *(e for e in self._entries if e.effect.name in parts)]
            effects = tuple(
                e.simple if e.simple is not None and e.effect.name not in full else e.effect for e in taking
            )
            model = Model(self._energy, None, effects)
            places = {n: self._places(model, n) for n in self._tests}
            self._built[key] = Program(compiled(model), places, self._price(model))
        return self._built[key]

    def ahead(self) -> AbstractContextManager[None]:
        """See `Bench.ahead`: the programs of the base and of every candidate by itself, for each length of a series."""
        wanted = (self.base, *(c.paths for c in self.candidates.values()))
        programs = dict.fromkeys(self._program(dict.fromkeys((*self.known, *paths), 0.0)) for paths in wanted)
        return ahead(call for program in programs for call in self._calls(program))

    def _calls(self, program: Program) -> list[tuple[Kept, tuple]]:
        """A program with arguments of every shape that these recordings have."""
        tests = {(t.mode, np.shape(t.drive)): n for n, t in self._tests.items() if n in self.fitted}
        return [(program.run, (program.places[n][0], self._tests[n])) for n in tests.values()]

    def _places(self, model: Model, name: str) -> tuple[np.ndarray, tuple[dict[str, int], ...]]:
        """Neutral theta, and where values go in it: the recording's own, which count more, after the common ones."""
        declared = model.declared
        neutral = np.array([self._neutral[p] for p in declared], float)
        both = [model.source_of(p, name)[::-1] for p in declared]
        return neutral, tuple({s[k]: i for i, s in enumerate(both) if len(s) > k} for k in (0, 1))

    def _theta(self, program: Program, values: Mapping[str, float], name: str) -> np.ndarray:
        neutral, places = program.places[name]
        theta = neutral.copy()
        for place in places:
            for path, value in values.items():
                if path in place:
                    theta[place[path]] = value
        return theta

    def predict(self, values: Mapping[str, float], recordings: Sequence[str] | None = None) -> Float[np.ndarray, " N"]:
        """See `Bench.predict`."""
        values = {**self.known, **values}
        program = self._program(values)
        out, names = self.y.copy(), list(recordings or self._tests)
        runs = [(program, self._theta(program, values, name), name) for name in names]
        for name, stress in zip(names, self._run(runs), strict=True):
            self._put(out, name, stress)
        return out

    def _run(self, runs: Sequence[tuple[Program, Float[np.ndarray, " p"], str]]) -> list[Float[np.ndarray, "n ..."]]:
        """Predictions of recordings; NaN where the faces of a specimen could not be found at such parameters. All are
        begun before the first is waited for: they run beside each other where there are cores."""
        self.counted.cost += sum(program.price for program, _, _ in runs)
        begun = [self._found(lambda p=p, t=t, n=n: self._begun(p, t, n), n) for p, t, n in runs]
        return [self._found(lambda y=y: np.asarray(y), name) for y, (_, _, name) in zip(begun, runs, strict=True)]

    def _begun(self, program: Program, theta: Float[np.ndarray, " p"], name: str) -> Array:
        key = program, name
        if key not in self._ready:
            test = self._given[name]
            self._ready[key] = program.run.compiled(theta, test), jax.tree.leaves(test)
        run, leaves = self._ready[key]
        return run(theta, *leaves)

    def _found(self, get: Callable[[], Array | np.ndarray], name: str) -> Array | np.ndarray:
        try:
            return get()
        except (ValueError, RuntimeError) as error:  # raised inside the compiled program by its linear solver
            if "non-finite" not in str(error):
                raise
            return np.full_like(self._tests[name].drive, np.nan)

    def _price(self, model: Model) -> float:
        """What a prediction costs beside that of the base model, from measured times: searches multiply."""
        full = [e for e in model.effects if e in self._full]
        memory, fibres = any(e.history for e in model.effects), any(not e.isotropic for e in model.effects)
        inner = 1.0 + 1.5 * memory + 4 * fibres + 3 * bool(full)
        if fibres and any(e.isotropic for e in full):  # powers of principal stretches, which fibres take off the axes
            inner = 90.0
        searches = [e.price for e in model.effects]
        return inner * math.prod(max(p.alone, memory * p.memory, fibres * p.fibres) for p in searches)

    def _put(self, out: Float[np.ndarray, " N"], name: str, stress: Float[np.ndarray, "n ..."]) -> None:
        for s in self._of[name]:
            part = stress[: len(s.time)]
            out[s.rows] = part[:, int(s.component.split()[1]) - 1] if s.component else part

    def _differences(
        self, pairs: Sequence[tuple[Mapping[str, float], Mapping[str, float]]], recordings: Sequence[str] | None
    ) -> Float[np.ndarray, "N k"]:
        """Second less first prediction of every pair of settings, equal ones run once; zero where both are the same."""
        out = np.zeros((len(pairs), len(self.y)))
        programs = [self._program(moved) for _, moved in pairs]
        runs, ends = {}, {}
        for name in recordings or self._tests:
            for i, program in enumerate(programs):
                two = [self._theta(program, values, name) for values in pairs[i]]
                ends[i, name] = [(id(program), name, theta.tobytes()) for theta in two]
                if ends[i, name][0] != ends[i, name][1]:
                    runs |= {key: (program, theta, name) for key, theta in zip(ends[i, name], two, strict=True)}
        known = dict(zip(runs, self._run([*runs.values()]), strict=True))
        for (i, name), (before, after) in ends.items():
            if before != after:
                self._put(out[i], name, known[after] - known[before])
        return out.T

    def nested(self, keys: Sequence[str]) -> int:
        """See `Bench.nested`: memories run side by side and count once."""
        paths = [p for key in keys for p in self.candidates[key].paths]
        heavy = {d for p in paths for prefix, d in self._heavy.items() if p.startswith(prefix)}
        full = any(self._needs_full.get(p, "anisotropy") != "anisotropy" for p in paths)
        return len(heavy - self._remembering) + bool(heavy & self._remembering) + full

    def _step(self, path: str, value: float) -> float:
        f = self.free[path]
        h = STEP * (abs(value) if f.log else max(f.scale, abs(value)))
        return -h if value + h > f.upper else h

    def jacobian(
        self, values: Mapping[str, float], paths: Sequence[str], recordings: Sequence[str] | None = None
    ) -> Float[np.ndarray, "N k"]:
        """See `Bench.jacobian`."""
        at = {**{p: self.start[p] for p in paths}, **self.known, **values}
        steps = np.array([self._step(p, at[p]) for p in paths])
        pairs = []
        for p, h in zip(paths, steps):
            known = {k: v for k, v in at.items() if k.startswith(self._added)} if p.startswith(self._added) else at
            pairs.append((known, {**known, p: at[p] + h}))
        return self._differences(pairs, recordings) / steps

    def columns(
        self, values: Mapping[str, float], settings: Sequence[tuple[Mapping[str, float], str]]
    ) -> Float[np.ndarray, "N k"]:
        """See `Bench.columns`. While an effect is neutral its shapes mean nothing: all start from one prediction."""
        pairs, steps, values = [], [], {**self.known, **values}
        for setting, path in settings:
            known = (
                {k: v for k, v in values.items() if k.startswith(self._added)}
                if path.startswith(self._added)
                else values
            )
            at = {path: self.start[path], **known, **setting}
            steps.append(self._step(path, at[path]))
            acting = {k: v for k, v in setting.items() if k in self._amplitudes and v != self.start[k]}
            pairs.append(({**known, path: at[path], **acting}, {**at, path: at[path] + steps[-1]}))
        return self._differences(pairs, self.fitted) / np.array(steps)

    def settings(self, candidate: Candidate, prediction: Float[np.ndarray, " N"]) -> Sequence[Mapping[str, float]]:
        """Frequencies are read from the periodogram of the residual; see `Bench.settings`."""
        if candidate.spectral is None:
            return candidate.grid
        path, most = candidate.spectral
        series = [
            ((s.time - s.time[0]), (self.y - prediction)[s.rows] / self.sigma[s.rows])
            for s in self.segments
            if s.recording in self.fitted
        ]
        return [{path: f} for f in lines(series, most)]


def strain_states(bench: MaterialBench) -> list[State]:
    """The strain of every segment: ln of the stretch along its own axis and of the second one, free faces without
    change of volume; in shear the amount, and ln of the stretch that it is done at.

    A base that knows no direction lacks none either: what it has wrong is one function of (own, second) for all kinds
    of extension and all axes. Else kinds and axes have laws of their own.
    """
    out = []
    for s in bench.segments:
        t, own = bench._tests[s.recording], strain(s)
        if t.mode == "biaxial":
            second = next(strain(o) for o in bench._of[s.recording] if o is not s)
        else:
            second = np.full_like(own, np.log(t.axial)) if t.mode == "shear" else float(t.second) * own
        kind = "shear" if t.mode == "shear" else "extension"
        axes = (t.mode, float(t.second), s.component, tuple(np.round(t.frame, 6).ravel().tolist()))
        out.append(State(kind if bench.isotropic else axes, np.stack([own, second], axis=1)))
    return out

"""The bench of probings: every prediction is a set of simulations, so derivatives are few and shared.

Differences of forward runs, not tangents: a forward program compiles in seconds and runs in one, a tangent program
compiles ten times as long, and the tangents of an explicit run ring where its differences do not. What costs nothing
is not run: effects that only change what the sensors say are applied to the base prediction; a moving support, of any
waveform and in every recording another, comes from a run with the probe displaced, by multiplication, as long as the
tissue has no memory (the refit then simulates the motion itself).

The numerical error (mesh, step, penalty) is part of sigma, a share of the signal in quadrature to the noise.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.bench import Bench, Candidate, Free, Segment
from tissuejax.diagnosis.catalogue import Entry
from tissuejax.diagnosis.periodogram import lines
from tissuejax.diagnosis.probing_catalogue import PRIORS, places, probing_entries
from tissuejax.effects.effect import Effect
from tissuejax.energies.catalogue import volumetric
from tissuejax.energies.energy import Energy
from tissuejax.errors import UnstableSimulation
from tissuejax.experiments.predictor import predictor
from tissuejax.experiments.probing_predictor import ProbingPredictor
from tissuejax.experiments.probing_setup import site
from tissuejax.model import Model
from tissuejax.recordings.recording import Channel, Recording, Sample

NUMERICAL = {"force": 0.012, "markers": 0.02}  # share of the signal that mesh, step and penalty leave open
STEP, LOG_STEP = 0.15, 0.04  # of a parameter's scale; of its logarithm


class ProbingBench(Bench):
    """Probings of one sample; see `Bench`."""

    @classmethod
    def of(
        cls,
        sample: Sample,
        energy: Energy,
        fitted: tuple[str, ...],
        held_out: tuple[str, ...],
        names: Sequence[str] | None = None,
        **settings,
    ) -> "ProbingBench":
        """The bench of `sample` with base model `energy` and U = K/2 (J-1)^2.

        Args:
            names: effects to try; all that act in probings by default.
            settings: of the simulations (`ProbingSettings`), e.g. compression=10.
        """
        model = Model(energy, volumetric("quadratic"))
        ready = predictor(model, sample, (*fitted, *held_out), **({"compression": 10.0} | settings))
        segments, y, sigma = _series(sample, ready)
        bench = cls(
            segments=segments,
            y=y,
            sigma=sigma,
            fitted=fitted,
            held_out=held_out,
            base=(),
            free={},
            start={},
            candidates={},
            dear=True,
        )
        bench._ready, bench._model_ = ready, model
        bench._finite = _kept_samples(sample, segments)
        bench._predictors: dict[tuple, ProbingPredictor] = {}
        bench._kept: dict[tuple, np.ndarray] = {}
        bench._declare(names)
        return bench

    def _declare(self, names: Sequence[str] | None) -> None:
        recordings = (*self.fitted, *self.held_out)
        for path, p in self._model_.parameters.items():
            log = p.lower >= 0 and p.default > 0
            low, high = (p.default / 50, p.default * 50) if log else (p.lower, p.upper)
            self.free[path] = Free(max(low, p.lower), min(high, p.upper), p.typical, p.unit, log=log)
            self.start[path] = p.default
        self.base = tuple(self.free)
        guess = self._scaled()
        for path in self.base:
            self.start[path] = guess[path]
        modulus = float(self._model_.energy.initial_shear_modulus({p.split(".")[1]: v for p, v in guess.items()}))
        entries = [e for e in probing_entries(0.1 * modulus) if names is None or e.effect.name in names]
        whole = Model(self._model_.energy, None, tuple(e.effect for e in entries)).across(recordings)
        self._entries: dict[str, Entry] = {e.effect.name: e for e in entries}
        for entry in entries:
            free, start, candidates = entry.declare(whole, self.fitted, self.held_out)
            for path, f in free.items():
                prior = PRIORS.get(path.removeprefix("effects."))
                free[path] = f if prior is None else Free(f.lower, f.upper, f.scale, f.unit, f.log, (0.0, prior))
            self.free.update(free)
            self.start.update(start)
            self.candidates.update({c.key: c for c in candidates})

    def _scaled(self) -> dict[str, float]:
        """The base's defaults with all moduli scaled so that the force has the measured size."""
        start = dict(self.start)
        p = self.predict(start, self.fitted)
        rows = np.concatenate([np.arange(s.rows.start, s.rows.stop) for s in self.segments if s.label == "force z"])
        inside = np.isin(rows, np.flatnonzero(self.mask(self.fitted)))
        a, b = p[rows[inside]], self.y[rows[inside]]
        ratio = float(np.clip(a @ b / max(a @ a, 1e-30), 0.05, 20.0)) if np.all(np.isfinite(a)) else 1.0
        return {path: v * ratio if self.free[path].unit == "Pa" else v for path, v in start.items()}

    def _effects(self, values: Mapping[str, float], paths: Sequence[str] = ()) -> tuple[str, ...]:
        """Effects that take part: every one that a path names."""
        named = {p.split(".")[1] for p in (*values, *paths) if p.startswith("effects.")}
        return tuple(sorted(named))

    def _predictor(self, names: tuple[str, ...], recordings: tuple[str, ...]) -> ProbingPredictor:
        key = (names, recordings)
        if key not in self._predictors:
            model = Model(
                self._model_.energy, self._model_.volumetric, tuple(self._entries[n].effect for n in names)
            ).across(recordings)
            setups = {r: self._ready.setups[r] for r in recordings}
            self._predictors[key] = ProbingPredictor(
                model, self._ready.sample, recordings, self._ready.settings, setups
            )
        return self._predictors[key]

    def predict(self, values: Mapping[str, float], recordings: Sequence[str] | None = None) -> Float[np.ndarray, " N"]:
        """See `Bench.predict`; NaN where a simulation broke down. The last few results are kept."""
        wanted = tuple(recordings or (*self.fitted, *self.held_out))
        whole = {p: self.start[p] for p in self.base} | dict(values)
        key = (wanted, tuple(sorted(whole.items())))
        if key in self._kept:
            return self._kept[key]
        names = self._effects(values)
        given = {p: v for p, v in whole.items() if p.rsplit(".", 1)[-1] not in self._foreign(wanted)}
        out = self.y.copy()
        try:
            told = self._predictor(names, wanted).predict(given)
        except UnstableSimulation:
            out[self.mask(wanted)] = np.nan
            return out
        self._fill(out, told)
        if len(self._kept) > 40:
            self._kept.pop(next(iter(self._kept)))
        self._kept[key] = out
        return out

    def _foreign(self, wanted: tuple[str, ...]) -> set[str]:
        return {r for r in (*self.fitted, *self.held_out) if r not in wanted}

    def _fill(self, out: np.ndarray, told: Mapping[str, Recording]) -> None:
        for s in self.segments:
            if s.recording in told:
                out[s.rows] = picked(np.asarray(told[s.recording].channels[s.channel].values), s, self._finite)

    def jacobian(
        self, values: Mapping[str, float], paths: Sequence[str], recordings: Sequence[str] | None = None
    ) -> Float[np.ndarray, "N k"]:
        """See `Bench.jacobian`."""
        at = {**{p: self.start[p] for p in paths}, **values}
        origin, out = self.predict(at, recordings), np.empty((len(self.y), len(paths)))
        for i, p in enumerate(paths):
            h = self._step(p, at[p])
            moved = self._sensed(at, p, h, origin)
            moved = self.predict({**at, p: at[p] + h}, recordings) if moved is None else moved
            out[:, i] = (moved - origin) / h
        return out

    def _step(self, path: str, value: float) -> float:
        f = self.free[path]
        h = LOG_STEP * abs(value) if f.log else STEP * max(f.scale, abs(value) if path in self.base else 0.0)
        return -h if value + h > f.upper else h

    def _sensed(self, at: Mapping[str, float], path: str, h: float, origin: np.ndarray) -> np.ndarray | None:
        """The prediction after a small change of what sensors report, from the prediction before; None if not such."""
        if not path.startswith("effects."):
            return None
        effect = self._entries[path.split(".")[1]].effect
        silent = type(effect).scene is Effect.scene and type(effect).energy is Effect.energy
        if not silent and path != "effects.registration.turn":
            return None
        out = origin.copy()
        for name in (*self.fitted, *self.held_out):
            before, after = (self._reported(effect, {**at, path: at[path] + d}, name, origin) for d in (0.0, h))
            for s in self.segments:
                if s.recording == name and s.channel in after:
                    change = after[s.channel] - before[s.channel]
                    out[s.rows] += picked(change, s, self._finite)
        return out

    def _reported(self, effect: Effect, values: Mapping[str, float], name: str, origin: np.ndarray) -> dict:
        """What the sensors report of the prediction `origin` under one effect, full arrays."""
        measured, channels = self._ready.sample.recordings[name].channels, {}
        for channel, ch in measured.items():
            if channel not in ("force", "markers"):
                continue
            full = np.nan_to_num(np.asarray(ch.values, float))
            for s in self.segments:
                if s.recording == name and s.channel == channel:
                    put(full, s, self._finite, origin)
            channels[channel] = Channel(np.asarray(ch.time, float), full, ch.unit)
        p = {}
        for d in effect.parameters:
            generic = f"effects.{effect.name}.{d.name}"
            p[d.name] = values.get(f"{generic}.{name}", values.get(generic, effect.neutral[d.name]))
        told = effect.channels(p, self._ready.setups[name].test, channels)
        out = {}
        for channel, ch in told.items():
            t = np.asarray(measured[channel].time, float)
            flat = np.asarray(ch.values, float).reshape(len(t), -1)
            read = np.stack([np.interp(t, np.asarray(ch.time), flat[:, i]) for i in range(flat.shape[1])], axis=1)
            out[channel] = read.reshape(np.shape(ch.values))
        return out

    def columns(
        self, values: Mapping[str, float], settings: Sequence[tuple[Mapping[str, float], str]]
    ) -> Float[np.ndarray, "N k"]:
        """See `Bench.columns`; one run a column, none for sensors and for the motion of the support."""
        base, out = self.predict(values, self.fitted), np.empty((len(self.y), len(settings)))
        for i, (setting, path) in enumerate(settings):
            if path.startswith("effects.periodic."):
                out[:, i] = self._moving(values, setting, path)
                continue
            at = {**values, **setting, path: 0.0}
            h = 0.5 * self.free[path].scale
            moved = self._sensed(at, path, h, base)
            moved = self.predict({**at, path: h}, self.fitted) if moved is None else moved
            out[:, i] = (moved - base) / h
        return out

    def _moving(self, values: Mapping[str, float], setting: Mapping[str, float], path: str) -> np.ndarray:
        """Change of all channels by a lift of the support, from the change by a probe set lower."""
        name, recording = path.split(".")[2], path.split(".")[3]
        h = 3e-4
        lowered = self.predict({**values, "effects.contact-offset.depth": h}, self.fitted)
        slope = (lowered - self.predict(values, self.fitted)) / h
        frequency, out = setting["effects.periodic.frequency"], np.zeros(len(self.y))
        for s in self.segments:
            if s.recording == recording:
                angle = 2 * np.pi * frequency * s.time * (2 if name.endswith("2") else 1)
                wave = np.sin(angle) if name.startswith("sin") else np.cos(angle)
                lifted = wave if s.channel == "markers" and s.component.endswith("z") else 0.0
                out[s.rows] = slope[s.rows] * wave + lifted
        return out

    def settings(self, candidate: Candidate, prediction: Float[np.ndarray, " N"]) -> Sequence[Mapping[str, float]]:
        """Frequencies from the markers' periodogram (from the force without markers); inclusions under every site."""
        if candidate.name == "periodic":
            vertical = [s for s in self.segments if s.recording in self.fitted and s.component.endswith("z")]
            marks = [s for s in vertical if s.channel == "markers"] or vertical
            series = [(s.time - s.time[0], (self.y - prediction)[s.rows] / self.sigma[s.rows]) for s in marks]
            return [{"effects.periodic.frequency": f} for f in lines(series, 1)]
        if candidate.name == "inclusion":
            recordings = self._ready.sample.recordings
            sites = {n: site(np.asarray(recordings[n].inputs["probe/position"], float)) for n in self.fitted}
            heights = {n: float(self._ready.setups[n].test.height) for n in self.fitted}
            return places(sites, heights)
        return candidate.grid


def _series(sample: Sample, ready: ProbingPredictor) -> tuple[list[Segment], np.ndarray, np.ndarray]:
    """All force and marker series cut into segments, with measurement and sigma."""
    segments, ys, sigmas, at = [], [], [], 0
    for name in ready.names:
        r = sample.recordings[name]
        t, z = np.asarray(r.inputs["probe/time"], float), np.asarray(r.inputs["probe/position"], float)[:, 2]
        touch = float(np.interp(float(ready.setups[name].test.first_touch), t, z))
        for channel in ("force", "markers"):
            if channel not in r.channels:
                continue
            ch = r.channels[channel]
            values, time = np.asarray(ch.values, float), np.asarray(ch.time, float)
            flat = values.reshape(len(time), -1)
            noise = float(ch.noise_std or 0.01 * np.nanstd(flat))
            for j in range(flat.shape[1]):
                good = np.isfinite(flat[:, j])
                if good.sum() < 8:
                    continue
                axis = "xyz"[j % 3]
                component = axis if channel == "force" else f"marker {j // 3} {axis}"
                if channel == "force":
                    signal = np.linalg.norm(flat, axis=1)[good]
                else:
                    here = flat[:, 3 * (j // 3) : 3 * (j // 3) + 3]
                    signal = np.linalg.norm(here - np.nanmedian(here[: max(len(here) // 10, 5)], axis=0), axis=1)[good]
                    signal = np.nan_to_num(signal)
                rows = slice(at, at + int(good.sum()))
                at = rows.stop
                depth = np.maximum(touch - np.interp(time[good], t, z), 0.0)
                segments.append(Segment(name, channel, component, rows, time[good], ch.unit, depth, "depth", "m"))
                ys.append(flat[good, j])
                sigmas.append(np.hypot(noise, NUMERICAL[channel] * signal))
    return segments, np.concatenate(ys), np.concatenate(sigmas)


def _kept_samples(sample: Sample, segments: Sequence[Segment]) -> dict[int, np.ndarray]:
    """Which samples of its channel a segment holds, by the start of its rows."""
    out = {}
    for s in segments:
        values = np.asarray(sample.recordings[s.recording].channels[s.channel].values, float)
        out[s.rows.start] = np.isfinite(values.reshape(len(values), -1)[:, column(s)])
    return out


def picked(values: np.ndarray, s: Segment, finite: Mapping) -> np.ndarray:
    """The rows of a segment out of a channel's full array."""
    flat = values.reshape(len(values), -1)
    return flat[finite[s.rows.start], column(s)]


def put(full: np.ndarray, s: Segment, finite: Mapping, vector: np.ndarray) -> None:
    """The reverse: a segment's rows of the long vector into a channel's full array."""
    full.reshape(len(full), -1)[finite[s.rows.start], column(s)] = vector[s.rows]


def column(s: Segment) -> int:
    """Column of a segment in its channel's array, all trailing axes flat."""
    axis = "xyz".index(s.component[-1])
    return axis if s.channel == "force" else 3 * int(s.component.split()[1]) + axis

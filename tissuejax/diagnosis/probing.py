"""The bench of probings: every prediction is a set of simulations, so derivatives are few, coarse and shared.

Differences of forward runs, not tangents: a forward program compiles in seconds and runs in one, a tangent program
compiles ten times as long, and the tangents of an explicit run ring where its differences do not. Residuals come from
the run that counts, differences from one on a coarser mesh and twice as fast, at a tenth of its price: they need a
direction, and the errors of both ends of a difference cancel.

What costs nothing is not run (`probing_free`): effects that only change what the sensors say are applied to the base
prediction; a moving support, of any waveform and in every recording another, a rig that gives way and a probe set
aside, too low or too late come from three runs with the probe displaced, by multiplication, as long as the tissue has
no memory.

Runs ring with waves that go to and fro under the probe, at other values in another way; what differs between two runs
is smoothed over the time that such a wave takes through the tissue (`calmed`). Left in, a tenth of the force in p02,
it passed for a slope in the bulk modulus, whose steps came out three times too short and stopped half way.
"""

import copy
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis import probing_free
from tissuejax.diagnosis.bench import Bench, Candidate, Free
from tissuejax.diagnosis.catalogue import Entry
from tissuejax.diagnosis.periodogram import lines
from tissuejax.diagnosis.probing_added import added, is_added, slope
from tissuejax.diagnosis.probing_catalogue import probing_entries
from tissuejax.diagnosis.probing_runs import COARSE, FINE, RETIMED, ROUGH, Runs
from tissuejax.diagnosis.probing_series import calmed, kept_samples, series
from tissuejax.diagnosis.probing_slopes import Slopes
from tissuejax.effects.catalogue import effects
from tissuejax.effects.form import Probed
from tissuejax.energies.catalogue import volumetric
from tissuejax.energies.energy import Energy
from tissuejax.estimation.series import finest
from tissuejax.experiments.predictor import predictor
from tissuejax.experiments.probing_setup import DENSITY, site
from tissuejax.model import Model
from tissuejax.recordings.recording import Sample

# Elements of the mesh that counts. 16 x 16 x 6 are 2 to 5 % too stiff in p02, most where a press is shallow, and were
# named as a tissue 4 % thinner; with these the true constants leave 1.07 in chi-square of the force and not 1.72.
MESH = (22, 22, 8)
STEP_OF_SCALE, LOG_STEP = 0.15, 0.04  # of a parameter's scale; of its logarithm
COLUMN = 0.5  # step of a score's column, of the amplitude's scale


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
        keep: Path | None = None,
        **settings,
    ) -> "ProbingBench":
        """The bench of `sample` with base model `energy` and U = K/2 (J-1)^2.

        Args:
            names: effects to try; all that act in probings by default.
            keep: folder for finished runs, so that a stopped diagnosis goes on.
            settings: of the simulations (`ProbingSettings`), e.g. compression=10.
        """
        model = Model(energy, volumetric("quadratic"))
        ready = predictor(model, sample, (*fitted, *held_out), **({"compression": 10.0, "counts": MESH} | settings))
        rough = ready.settings.changed(counts=ROUGH, compression=2 * ready.settings.compression)
        segments, y, sigma = series(sample, ready)
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
        )
        bench.ready, bench.model = ready, model
        bench.finite = kept_samples(sample, segments)
        coarse = ready.with_settings(rough)
        slow = coarse.with_settings(rough.changed(compression=ready.settings.compression))
        bench.runs = Runs({FINE: ready, RETIMED: slow, COARSE: coarse}, {}, segments, y, bench.finite, keep)
        bench.slopes, bench.slopes_taken = COARSE, Slopes()
        bench._declare(names)
        return bench

    def narrowed(
        self, fitted: tuple[str, ...], held_out: tuple[str, ...], names: Sequence[str] | None = None
    ) -> "ProbingBench":
        """The same probings and runs with other recordings fitted; `names`: effects to try."""
        made = copy.copy(self)
        made.fitted, made.held_out, made.warnings = fitted, held_out, list(self.warnings)
        made.free, made.start, made.candidates, made.known = {}, {}, {}, {}
        made._declare(names)
        return made

    def _declare(self, names: Sequence[str] | None) -> None:
        recordings = (*self.fitted, *self.held_out)
        for path, p in self.model.parameters.items():
            log = p.lower >= 0 and p.default > 0
            low, high = (p.default / 50, p.default * 50) if log else (p.lower, p.upper)
            self.free[path] = Free(max(low, p.lower), min(high, p.upper), p.typical, p.unit, log=log)
            self.start[path] = p.default
        self.base = tuple(self.free)
        guess = self.model.energy.initial_shear_modulus({p.split(".")[1]: v for p, v in self.start.items()})
        every = {e.effect.name: e.effect for e in probing_entries(Probed(1.0, 1.0, 1.0))}
        lone = {n: e() for n, e in effects("probing").items() if n not in every}  # only ever stated
        self.runs.effects = every | lone
        ratio = self._scale()
        for path in self.base:
            self.start[path] *= ratio if self.free[path].unit == "Pa" else 1.0
        tests = [setup.test for setup in self.ready.setups.values()]
        session = max(float(t.start) for t in tests) + max(float(np.max(s.time)) for s in self.segments)
        mu, height = ratio * float(guess), float(max(t.height for t in tests))
        forces = [np.asarray(s.time, float) for s in self.segments if s.channel == "force"]
        forces = forces or [np.asarray(s.time, float) for s in self.segments]
        longest, step = max(np.ptp(t) for t in forces), max(np.median(np.diff(t)) for t in forces)
        found = probing_entries(Probed(mu, height, session, float(longest), float(step), finest(forces)))
        entries = [e for e in found if names is None or e.effect.name in names]
        whole = Model(self.model.energy, None, tuple(e.effect for e in entries)).across(recordings)
        self.entries: dict[str, Entry] = {e.effect.name: e for e in entries}
        for entry in entries:
            free, start, candidates = entry.declare(whole, self.fitted, self.held_out)
            self.free.update(free)
            self.start.update(start)
            self.candidates.update({c.key: c for c in candidates})

    def _scale(self) -> float:
        """By how much all moduli have to grow for the force to have the measured size."""
        p = self.runs.many([(self.start, self.fitted, COARSE)])[0]
        rows = np.concatenate([np.arange(s.rows.start, s.rows.stop) for s in self.segments if s.label == "force z"])
        rows = rows[np.isin(rows, np.flatnonzero(self.mask(self.fitted)))]
        a, b = p[rows], self.y[rows]
        return float(np.clip(a @ b / max(a @ a, 1e-30), 0.05, 20.0)) if np.all(np.isfinite(a)) else 1.0

    def at(self, values: Mapping[str, float]) -> dict[str, float]:
        """`values` with the base's own where they say nothing."""
        return {p: self.start[p] for p in self.base} | self.known | dict(values)

    def predict(self, values: Mapping[str, float], recordings: Sequence[str] | None = None) -> Float[np.ndarray, " N"]:
        """See `Bench.predict`; NaN where a simulation broke down."""
        wanted = tuple(recordings or (*self.fitted, *self.held_out))
        at = self.at(values)
        return self.runs.many([(at, wanted, FINE)])[0] + self.mask(wanted) * added(self.runs, at)

    def jacobian(
        self, values: Mapping[str, float], paths: Sequence[str], recordings: Sequence[str] | None = None
    ) -> Float[np.ndarray, "N k"]:
        """See `Bench.jacobian`."""
        wanted = tuple(recordings or (*self.fitted, *self.held_out))
        at = {**{p: self.start[p] for p in paths}, **self.at(values)}
        here = self._near(at) if "effects.inclusion.x" in at else ()
        here = tuple(n for n in wanted if n in here) or wanted
        felt = {p: here if p.startswith("effects.inclusion.") else wanted for p in paths}
        return self._columns([(at, p, self._step(p, at[p]), felt[p]) for p in paths])

    def columns(
        self, values: Mapping[str, float], settings: Sequence[tuple[Mapping[str, float], str]]
    ) -> Float[np.ndarray, "N k"]:
        """See `Bench.columns`; an inclusion is only looked for in the recordings above it."""
        asked = []
        for setting, path in settings:
            wanted = self._near(setting) if path == "effects.inclusion.contrast" else self.fitted
            neutral = self.at(values).get(path, self.start[path])
            asked.append(({**self.at(values), **setting, path: neutral}, path, COLUMN * self.free[path].scale, wanted))
        return self._columns(asked)

    def _columns(self, asked: Sequence[tuple[dict, str, float, tuple[str, ...]]]) -> Float[np.ndarray, "N k"]:
        """Derivatives, one a (values, path, step, recordings); everything that has to run is run side by side."""
        out, left = np.zeros((len(self.y), len(asked))), []
        displaced = []
        for at, path, h, wanted in asked:
            if is_added(self.runs, path):
                continue
            if probing_free.moves(self, at, path):
                displaced += probing_free.displaced(self, at, path, wanted)
            elif not probing_free.sensed(self, path):
                own = tuple(r for r in wanted if r == path.rsplit(".", 1)[-1]) or wanted
                displaced += [(at, own, self.slopes), ({**at, path: at[path] + h}, own, self.slopes)]
        self.runs.many(displaced)  # all at once; what follows finds them
        for i, (at, path, h, wanted) in enumerate(asked):
            if is_added(self.runs, path):
                out[:, i] = self.mask(wanted) * slope(self.runs, at, path)
            elif probing_free.moves(self, at, path):
                out[:, i] = self.calmed(probing_free.moving(self, at, path, wanted))
            elif probing_free.sensed(self, path):
                out[:, i] = probing_free.reported(self, at, path, h, self.runs.many([(at, wanted, self.slopes)])[0])
            else:
                own = tuple(r for r in wanted if r == path.rsplit(".", 1)[-1]) or wanted
                left = self.runs.many([(at, own, self.slopes), ({**at, path: at[path] + h}, own, self.slopes)])
                out[:, i] = self.calmed((left[1] - left[0]) / h)
        return out

    def calmed(self, difference: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
        """What differs between two coarse runs, without what rings."""
        tests = [setup.test for setup in self.ready.setups.values()]
        speed = np.sqrt(self.start["volumetric.K"] / (self.ready.sample.density or DENSITY))
        passage = max(float(t.height) for t in tests) / speed
        return calmed(self.segments, difference, passage * self.runs.ready[COARSE].settings.compression)

    def _step(self, path: str, value: float) -> float:
        f = self.free[path]
        size = abs(value) if path in self.base else 0.3 * abs(value)
        h = LOG_STEP * abs(value) if f.log else STEP_OF_SCALE * max(f.scale, size)
        return -h if value + h > f.upper else h

    def _near(self, setting: Mapping[str, float]) -> tuple[str, ...]:
        """The fitted recordings whose site is the nearest to an inclusion, or hardly farther."""
        place = np.array([setting["effects.inclusion.x"], setting["effects.inclusion.y"]])
        away = {n: float(np.linalg.norm(s - place)) for n, s in self.sites.items()}
        return tuple(n for n, d in away.items() if d < min(away.values()) + 3e-3)

    @property
    def sites(self) -> dict[str, Float[np.ndarray, "2"]]:
        """Where the probe went deepest in each fitted recording."""
        recordings = self.ready.sample.recordings
        return {n: site(np.asarray(recordings[n].inputs["probe/position"], float)) for n in self.fitted}

    def settings(self, candidate: Candidate, prediction: Float[np.ndarray, " N"]) -> Sequence[Mapping[str, float]]:
        """Frequencies from the periodogram of the channel in which they are heard (by default the markers', the force's
        without markers); inclusions under every site."""
        if candidate.spectral is not None:
            path, most = candidate.spectral
            vertical = [s for s in self.segments if s.recording in self.fitted and s.component.endswith("z")]
            marks = [s for s in vertical if s.channel == (candidate.heard or "markers")] or vertical
            series = [(s.time - s.time[0], (self.y - prediction)[s.rows] / self.sigma[s.rows]) for s in marks]
            return [{path: f} for f in lines(series, most)]
        if candidate.placed is not None:
            effect = candidate.amplitudes[0].rsplit(".", 1)[0]
            heights = {n: float(self.ready.setups[n].test.height) for n in self.fitted}
            return [{f"{effect}.{k}": v for k, v in s.items()} for s in candidate.placed(self.sites, heights)]
        return candidate.grid

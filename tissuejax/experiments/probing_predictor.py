"""The predictor of probings: recordings side by side on the cores, compiled programs shared and kept on disk.

One compiled forward program serves all recordings of like padded size; the Jacobian runs in programs of a few forward
tangents each, because one program with everything in it is slower to compile and to run. A prediction that is not
finite is refused with the time and the element, never masked.
"""

from collections.abc import Mapping, Sequence
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.arrays import Given, traced
from tissuejax.cache.programs import keep_programs
from tissuejax.errors import UnstableSimulation, unknown
from tissuejax.experiments import programs, workers
from tissuejax.experiments.homogeneous import local
from tissuejax.experiments.predictor import Predictor, Tangents
from tissuejax.experiments.probing import Simulated, simulated
from tissuejax.experiments.probing_settings import ProbingSettings
from tissuejax.experiments.probing_setup import Setup, retimed, setups
from tissuejax.experiments.soundness import NUMERICS, checks
from tissuejax.model import Model
from tissuejax.parameters import Values
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.tled.contact import PIERCED


class ProbingPredictor(Predictor):
    """Predicts probings; see `Predictor`.

    Attributes:
        settings: numerical choices.
        setups: each recording made ready.
    """

    name: ClassVar[str] = "probing"
    model: Model
    sample: Sample
    names: tuple[str, ...]
    settings: ProbingSettings = eqx.field(static=True)
    setups: Mapping[str, Setup]

    @classmethod
    def prepare(
        cls, model: Model, sample: Sample, names: tuple[str, ...], settings: ProbingSettings | None = None, **options
    ) -> "ProbingPredictor":
        """See `predictor`; `settings`, or single settings by name (`compression=10`)."""
        keep_programs()
        settings = (settings or ProbingSettings()).changed(**options)
        return cls(model.across(names), sample, names, settings, setups(model, sample, names, settings))

    def of(self, names: Sequence[str]) -> "ProbingPredictor":
        """The same model for other recordings of the sample."""
        return self.prepare(self.model, self.sample, tuple(names), self.settings)

    def with_settings(self, settings: ProbingSettings) -> "ProbingPredictor":
        """The same recordings simulated otherwise."""
        if settings == self.settings.changed(compression=settings.compression, step=settings.step):
            # another speed or step needs no other mesh
            scenes = {name: retimed(setup, settings) for name, setup in self.setups.items()}
            return ProbingPredictor(self.model, self.sample, self.names, settings, scenes)
        return self.prepare(self.model, self.sample, self.names, settings)

    def with_model(self, model: Model) -> "ProbingPredictor":
        """Another model (further effects) in the same prepared scenes."""
        if type(model.volumetric) is not type(self.model.volumetric) or model.energy != self.model.energy:
            return self.prepare(model, self.sample, self.names, self.settings)
        return ProbingPredictor(model.across(self.names), self.sample, self.names, self.settings, self.setups)

    def predict(self, values: Values) -> dict[str, Recording]:
        """Predicted recordings by name; see `Predictor.predict`.

        Raises:
            UnstableSimulation: a run broke down (unless the values are traced: then the prediction is NaN).
        """
        return {name: self._reported(name, out) for name, out in self.run(values).items()}

    def run(self, values: Values) -> dict[str, Simulated]:
        """The simulations behind `predict`, with their checks."""
        jobs = [self.job(values, name) for name in self.names]
        out = dict(zip(self.names, self._side_by_side(jobs), strict=True))
        for name, run in out.items():
            self._refuse_failed(name, run)
        return out

    def job(self, values: Values, name: str) -> workers.Job:
        """What simulates one recording, for `workers.run_all`: many predictions side by side. Gives a `Simulated`."""
        return _predict, self.model.across(()), _vector(local(self.model, values, name)), self.setups[name]

    def jacobian(self, values: Values, paths: Sequence[str]) -> tuple[dict[str, Recording], Tangents]:
        """Prediction and derivatives; see `Predictor.jacobian`."""
        for path in paths:
            if path not in self.model.parameters:
                raise unknown("parameter", path, self.model.parameters)
        jobs, place = self.derivative_jobs(values, paths)
        recordings, tangents = {}, {path: {} for path in paths}
        for (name, part), (run, slopes) in zip(place, self._side_by_side(jobs), strict=True):
            self._refuse_failed(name, run)
            recordings[name] = self._reported(name, run)
            for row, i in enumerate(part):
                tangents[paths[int(i)]][name] = {c: self.unpadded(name, c, slope[row]) for c, slope in slopes.items()}
        for name in self.names:
            if name not in recordings:  # no path acts in this recording
                recordings |= self.of([name]).predict(values)
            zero = {c: np.zeros(np.shape(ch.values)) for c, ch in recordings[name].channels.items()}
            for path in paths:
                tangents[path].setdefault(name, zero)
        return recordings, tangents

    def derivative_jobs(self, values: Values, paths: Sequence[str]) -> tuple[list[workers.Job], list[tuple]]:
        """What simulates and differentiates every recording, a few paths at a time, and (recording, paths) of each."""
        bare, declared, jobs, place = self.model.across(()), list(self.model.declared), [], []
        for name in self.names:
            theta = _vector(local(self.model, values, name))
            basis = np.zeros((len(paths), len(declared)))
            for i, path in enumerate(paths):
                basis[i] = [path in self.model.source_of(generic, name) for generic in declared]
            felt = np.flatnonzero(basis.any(1))
            for part in _parts(felt, self.settings.tangents):
                jobs.append((_linearised, bare, theta, self.setups[name], basis[part]))
                place.append((name, part))
        return jobs, place

    def _side_by_side(self, jobs: list) -> list:
        """Run the jobs on as many processes as the settings say; in order and here where values are traced."""
        if traced(*(theta for _, _, theta, *_ in jobs)):
            return [programs.run(*job) for job in jobs]
        return workers.run_all(jobs, self.settings.processes)

    def _refuse_failed(self, name: str, run: Simulated) -> None:
        if traced(run.failed):
            return
        finite = all(np.isfinite(v[..., 0]).any() for v in run.channels.values())
        if int(run.failed) < 0 and int(run.pierced) < 0 and finite:
            return
        setup = self.setups[name]
        if int(run.failed) < 0 and int(run.pierced) >= 0:
            probe, when = setup.scene.pressed, float(setup.scene.clock.ends[int(run.pierced)])
            at = [1e3 * np.interp(when, np.asarray(probe.time), axis) for axis in np.asarray(probe.position).T]
            raise UnstableSimulation(
                f"recording {name}: by t = {when:.3g} s the surface had sunk into the probe by more than {PIERCED:.0%} "
                f"of its radius ({1e3 * float(run.depth):.2g} mm at worst), the probe at ({at[0]:.1f}, {at[1]:.1f}, "
                f"{at[2]:.1f}) mm; raise the setting `penalty` (now {self.settings.penalty:.2g} Pa/m), or start from "
                "softer parameters"
            )
        cells = np.asarray(setup.scene.body.cells)
        x, y, z = 1e3 * np.asarray(setup.scene.body.points)[cells[int(run.element)]].mean(0)
        when = float(setup.scene.clock.ends[int(run.failed)])
        raise UnstableSimulation(
            f"recording {name}: the simulation broke down by t = {when:.3g} s at element {int(run.element)} near "
            f"({x:.1f}, {y:.1f}, {z:.1f}) mm; lower `compression` or `step`, or start from softer, "
            "more stable parameters"
        )

    def _reported(self, name: str, run: Simulated) -> Recording:
        """A prediction as a recording: the checks of its simulation are attributes `numerics/...`."""
        measured = self.sample.recordings[name]
        reported = {
            c: Channel(measured.channels[c].time, self.unpadded(name, c, v), measured.channels[c].unit)
            for c, v in run.channels.items()
        }
        went = {} if traced(run.depth) else checks(run, float(self.setups[name].scene.pressed.shape.reach()))
        told = {f"{NUMERICS}{check}": value for check, value in went.items()}
        return Recording(name, measured.experiment, measured.inputs, reported, {**measured.attributes, **told})

    def unpadded(self, name: str, channel: str, values: Array) -> Array:
        """Values as simulated, cut to the samples (and markers) that recording and channel have."""
        shape = np.shape(self.sample.recordings[name].channels[channel].values)
        return values[tuple(slice(n) for n in shape)]


def predict_all(predictors: Sequence[ProbingPredictor], values: Values) -> list[dict[str, Recording]]:
    """`predict` of several predictors, all their simulations side by side; put the longest ones first.

    Raises:
        UnstableSimulation: a run broke down.
    """
    jobs = [p.job(values, name) for p in predictors for name in p.names]
    done = iter(workers.run_all(jobs, max((p.settings.processes for p in predictors), default=1)))
    runs_reported = []
    for p in predictors:
        runs = {name: next(done) for name in p.names}
        for name, run in runs.items():
            p._refuse_failed(name, run)
        runs_reported.append({name: p._reported(name, run) for name, run in runs.items()})
    return runs_reported


def make_ready(
    derivatives: Sequence[ProbingPredictor],
    predictions: Sequence[ProbingPredictor],
    values: Values,
    paths: Sequence[str],
) -> None:
    """Compile the programs of a fit ahead, different ones on different cores; later each is found on disk.

    With one process nothing is gained, and nothing is done.
    """
    jobs = {}
    for p in derivatives:
        for job, (_, part) in zip(*p.derivative_jobs(values, paths), strict=True):
            jobs.setdefault(("derivative", p.settings.counts, len(part)), job)
    for p in predictions:
        jobs.setdefault(("prediction", p.settings.counts), p.job(values, p.names[0]))
    processes = max(p.settings.processes for p in derivatives)
    if processes > 1:
        workers.run_all(list(jobs.values()), processes, programs.compiled)


def _parts(indices: np.ndarray, size: int) -> list[np.ndarray]:
    """Indices in even parts of at most `size`: few different sizes, so few programs."""
    return np.array_split(indices, -(-len(indices) // size)) if len(indices) else []


def _predict(model: Model, theta: Float[Array, " p"], setup: Setup) -> Simulated:
    return simulated(model, dict(zip(model.declared, theta)), setup)


def _linearised(
    model: Model, theta: Float[Array, " p"], setup: Setup, basis: Float[Array, "k p"]
) -> tuple[Simulated, dict[str, Float[Array, "k ..."]]]:
    """Prediction and its derivative along each row of `basis`; the primal runs once."""

    def channels(x):
        out = simulated(model, dict(zip(model.declared, x)), setup)
        return out.channels, out

    def along(direction):
        _, slopes, out = jax.jvp(channels, (theta,), (direction,), has_aux=True)
        return slopes, out

    slopes, out = jax.vmap(along, out_axes=(0, None))(basis)
    return out, slopes


def _vector(values: Mapping[str, Given]) -> Float[Given, " p"]:
    """One array for all values: on the host unless one of them is traced."""
    if traced(*values.values()):
        return jnp.stack([jnp.asarray(v) for v in values.values()])
    return np.array([float(v) for v in values.values()])

"""The predictor of cuts: by the balance of energies (microseconds) or by simulation of a slice."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.arrays import Given, traced
from tissuejax.errors import InputError, UnstableSimulation, unknown
from tissuejax.experiments.cutting import balance_force
from tissuejax.experiments.cutting_blocks import Blocks
from tissuejax.experiments.cutting_record import FORCE, Path, drawn, path_of
from tissuejax.experiments.cutting_run import CuttingSettings, Ran, Slice, prepare, run_slice
from tissuejax.experiments.homogeneous import local
from tissuejax.experiments.predictor import Predictor, Tangents
from tissuejax.model import Model
from tissuejax.parameters import Values, under
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.tled.simulate import COMPILER_OPTIONS

WAYS = ("balance", "simulation")
CUT_DENSITY = 1000.0


class CuttingPredictor(Predictor):
    """Predicts `cutting_force`, the force against the motion; see `Predictor`.

    Attributes:
        by: "balance" or "simulation". settings: of a simulation.
        paths_of: each recording's path. slices: each recording's slice (simulation).
        lenient, blocks_of: see `prepare`.
    """

    name: ClassVar[str] = "cutting"
    model: Model
    sample: Sample
    names: tuple[str, ...]
    by: str = eqx.field(static=True)
    settings: CuttingSettings = eqx.field(static=True)
    paths_of: Mapping[str, Path]
    slices: Mapping[str, Slice]
    lenient: bool = eqx.field(static=True, default=False)
    blocks_of: Mapping[str, Blocks] = eqx.field(default_factory=dict)

    @classmethod
    def prepare(
        cls,
        model: Model,
        sample: Sample,
        names: tuple[str, ...],
        by: str = "balance",
        settings: CuttingSettings | None = None,
        start: Mapping[str, float] | None = None,
        lenient: bool = False,
        blocks: Mapping[str, Blocks] | None = None,
    ) -> "CuttingPredictor":
        """See `predictor`.

        Args:
            by: "balance" or "simulation". settings: of a simulation.
            start: values for which a simulation's step and stiffness are chosen (declared ones by default).
            lenient: a run that breaks down is a prediction of NaN (for a descent that tries values) and no error.
            blocks: of recordings whose force is a mean over blocks of the way (`blocked`).

        Raises:
            InputError: no cohesive law or volumetric energy, an unknown way, a recording that can't be cut.
        """
        if by not in WAYS:
            raise unknown("way to predict a cut", by, WAYS)
        if model.cohesion is None or model.volumetric is None:
            raise InputError("a cut needs a cohesive law and a volumetric energy in its model (bilinear, quadratic)")
        sample, model = drawn(sample), model.across(names)
        geometry = sample.geometry
        assert geometry is not None  # `drawn` refuses a sample without
        paths = {n: path_of(sample.recordings[n], geometry) for n in names}
        settings, slices = settings or CuttingSettings(), {}
        made = cls(model, sample, names, by, settings, paths, slices, lenient, dict(blocks or {}))
        return made.prepared(start) if by == "simulation" else made

    def prepared(self, start: Mapping[str, float] | None = None) -> "CuttingPredictor":
        """The same with slices whose step, stiffness and penalty are chosen for `start`. Compiled programs serve both
        as long as the number of steps is the same.

        Raises:
            InputError: see `experiments.cutting_run.prepare`.
        """
        at, slices = self.model.defaults | dict(start or {}), {}
        for n in self.names:
            values = local(self.model, at, n)
            density = self.sample.density or CUT_DENSITY
            slices[n] = prepare(self.model.across(()), values, density, self.paths_of[n], self.settings)
        return replace(self, slices=slices)

    def of(self, names: Sequence[str]) -> "CuttingPredictor":
        """The same model for other recordings of the sample."""
        return self.prepare(self.model, self.sample, tuple(names), self.by, self.settings)

    def force(
        self, name: str, vector: Float[Array, " p"], model: Model | None = None, ready: Slice | None = None
    ) -> tuple[Float[Array, " f"], Ran | None]:
        """Force of one recording at its sensor's times, from a vector of declared values. Pure JAX.

        Args:
            model: the active part of the predictor's own, whose values the vector holds; all of it by default.
            ready: the recording's slice, where it is an argument of the compiled program.
        """
        model, path, ran = model or self.model.across(()), self.paths_of[name], None
        values = dict(zip(model.declared, vector, strict=True))
        if self.by == "balance":
            force = balance_force(model, values, path)
        else:
            ran = run_slice(model, values, self.slices[name] if ready is None else ready, path)
            force = ran.force
        seen = self.sample.recordings[name].channels[FORCE]
        channels: Mapping[str, Channel] = {FORCE: Channel(jnp.asarray(path.time), force, "N")}
        for effect in reversed(model.ordered):
            channels = effect.channels(under(f"effects.{effect.name}", values), None, channels)
        made = channels[FORCE]
        if name in self.blocks_of:
            blocks = self.blocks_of[name]
            return blocks.mean(jnp.interp(jnp.asarray(blocks.time), made.time, made.values)), ran
        return jnp.interp(jnp.asarray(seen.time), made.time, made.values), ran

    def predict(self, values: Values) -> dict[str, Recording]:
        """See `Predictor.predict`.

        Raises:
            UnstableSimulation: a run broke down.
        """
        return self.simulated(values)[0]

    def run(self, values: Values) -> dict[str, Ran]:
        """The simulations behind `predict`, with their checks."""
        return {name: _compiled(self, name, local(self.model, values, name))[1] for name in self.names}

    def simulated(self, values: Values) -> tuple[dict[str, Recording], dict[str, Ran | None]]:
        """Prediction and the simulations behind it.

        Raises:
            UnstableSimulation: a run broke down (not of a lenient predictor).
        """
        out, runs = {}, {}
        for name in self.names:
            force, runs[name] = _compiled(self, name, local(self.model, values, name))
            self._refuse_failed(name, runs[name])
            out[name] = self._reported(name, force)
        return out, runs

    def jacobian(self, values: Values, paths: Sequence[str]) -> tuple[dict[str, Recording], Tangents]:
        """See `Predictor.jacobian`."""
        return self.linearised(values, paths)[:2]

    def linearised(
        self, values: Values, paths: Sequence[str]
    ) -> tuple[dict[str, Recording], Tangents, dict[str, Ran | None]]:
        """Prediction, its derivatives, and the simulations behind them, in one program."""
        for path in paths:
            if path not in self.model.parameters:
                raise unknown("parameter", path, self.model.parameters)
        recordings, tangents, runs = {}, {path: {} for path in paths}, {}
        for name in self.names:
            at = local(self.model, values, name)
            generic = [d for p in paths for d in self.model.declared if p in self.model.source_of(d, name)]
            model = self.model.across(()).active(at, generic)
            basis = np.array([[p in self.model.source_of(d, name) for d in model.declared] for p in paths], float)
            force, ran, slopes = _linearised(self, name, at, basis, model)
            runs[name] = ran
            self._refuse_failed(name, ran)
            recordings[name] = self._reported(name, force)
            for row, path in enumerate(paths):
                tangents[path][name] = {FORCE: np.asarray(slopes[row])}
        return recordings, tangents, runs

    def _reported(self, name: str, force) -> Recording:
        r = self.sample.recordings[name]
        seen = r.channels[FORCE]
        made = Channel(seen.time, force if traced(force) else np.asarray(force), "N", seen.noise_std)
        return Recording(name, r.experiment, r.inputs, {FORCE: made}, r.attributes)

    def _refuse_failed(self, name: str, ran: Ran | None) -> None:
        if self.lenient or ran is None or traced(ran.failed) or int(ran.failed) < 0:
            return
        scene = self.slices[name].scene
        x, y, _ = 1e3 * np.asarray(scene.body.points)[np.asarray(scene.body.cells)[int(ran.element)]].mean(0)
        clock, path = scene.clock, self.paths_of[name]
        ran_for = float(clock.interval) * (int(ran.failed) + 1)  # on the run's own clock
        when = float(np.interp(ran_for, self.slices[name].runtime, path.time))
        reached = float(np.interp(when, path.time, path.x))
        raise UnstableSimulation(
            f"recording {name}: an element inverted at ({x:.1f}, {y:.1f}) mm from the entry, by {when:.3g} s, when the "
            f"edge stood at {1e3 * reached:.1f} mm: take smaller elements (--h), tissue that resists compression "
            "(volumetric.K ten times the shear modulus), or a strength that the mesh carries (`tissuejax cut resolve`)"
        )


_programs: dict = {}


def _program(predictor: CuttingPredictor, name: str, kind: str, make):
    """Compiled once for each predictor, recording and use; predictors are immutable."""
    key = (id(predictor.paths_of), id(predictor.blocks_of), name, kind)
    if key not in _programs:
        kept = (
            jax.jit(make, compiler_options=COMPILER_OPTIONS),
            predictor,
        )  # holds the predictor: its id stays its own
        _programs[key] = kept
    return _programs[key][0]


def _vector(model: Model, at: Mapping[str, Given]):
    return jnp.stack([jnp.asarray(at[path], float) for path in model.declared])


def _compiled(predictor: CuttingPredictor, name: str, at: Mapping[str, Given]):
    model = predictor.model.across(())
    if not traced(*at.values()):  # what is off costs nothing and changes no bit
        model = model.active(at)
    program = _program(predictor, name, f"run {model}", lambda v, ready: predictor.force(name, v, model, ready))
    return program(_vector(model, at), predictor.slices.get(name))


def _linearised(predictor: CuttingPredictor, name: str, at: Mapping[str, Given], basis, model: Model):
    def both(v, basis, ready):
        def along(direction):
            force, slope, ran = jax.jvp(
                lambda x: predictor.force(name, x, model, ready), (v,), (direction,), has_aux=True
            )
            return slope, force, ran

        return jax.vmap(along, out_axes=(0, None, None))(basis)

    kind = f"slope {basis.shape} {model}"
    program = _program(predictor, name, kind, both)
    slopes, force, ran = program(_vector(model, at), jnp.asarray(basis), predictor.slices.get(name))
    return force, ran, slopes

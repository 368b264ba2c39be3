"""Material tests: the same strain everywhere in the specimen, so that a prediction is algebra at every sample.

One route serves all kinds. The driven stretch or shear passes the rig's effects; the kind of test and the free faces
give the deformation gradient

    F = [[a, g, 0], [0, b, 0], [0, 0, c]]   (axes: loaded, second, free),

the isochoric PK2 stress is twice the derivative of the whole strain energy by C, effects with memory change its
history, the pressure follows from the free third face (P33 = 0), and the nominal stress passes the rig and the
sensor. All functions are pure; time is the trailing axis of every tensor component.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.arrays import Given
from tissuejax.effects.effect import Effect
from tissuejax.effects.material_test import MaterialTest, Stress
from tissuejax.energies.strain import Strain
from tissuejax.errors import InputError, unknown
from tissuejax.experiments.catalogue import experiment
from tissuejax.experiments.experiment import Experiment
from tissuejax.experiments.free_faces import lateral, unlike
from tissuejax.experiments.kinematics import Gradient, deformation, hydrostatic, in_sample, nominal, right_cauchy_green
from tissuejax.model import Model
from tissuejax.parameters import Constants, Parameter, under
from tissuejax.recordings.recording import Channel, Recording
from tissuejax.tensors import Sym, determinant

Values = Constants  # by dotted path


class Homogeneous(Experiment):
    """A material test. Members are data: how the specimen is driven and what its free faces do.

    Class data:
        mode: "extension", "biaxial" or "shear".
        driven: the recorded input, "stretch" or "shear".
        columns: number of driven (and recorded) directions.
        second, swell: exponents of the second stretch, where one stretch is driven.
    """

    kind: ClassVar[str] = "homogeneous"
    mode: ClassVar[str]
    driven: ClassVar[str]
    columns: ClassVar[int]
    second: ClassVar[float] = 0.0
    swell: ClassVar[float] = 0.0

    def test(self, recording: Recording) -> MaterialTest:
        """`recording` as arrays, without the measurement.

        Raises:
            InputError: no "time" or driven input, wrong shape, or a stretch that is not positive.
        """
        time, drive = (self._input(recording, name) for name in ("time", self.driven))
        expected = time.shape if self.columns == 1 else (*time.shape, self.columns)
        if drive.shape != expected:
            raise InputError(f"recording {recording.name}: {self.driven} has shape {drive.shape}, expected {expected}")
        if self.driven == "stretch" and not np.all(drive > 0):
            raise InputError(
                f"recording {recording.name}: stretch {drive.min():g}; it must be positive (1 is undeformed)"
            )
        known = {k: float(v) for k, v in recording.attributes.items() if k in ("start", "area", "height", "diameter")}
        area = known.get("area", np.nan)
        numbers = {
            "second": self.second,
            "swell": self.swell,
            "axial": float(recording.attributes.get("axial_stretch", 1.0)),
            "start": known.get("start", 0.0),
            "area": area,
            "height": known.get("height", np.nan),
            "diameter": known.get("diameter", 2 * np.sqrt(area / np.pi)),
        }
        frame = axes(recording.attributes.get("direction"), recording.attributes.get("normal"))
        arrays = {name: np.asarray(value, float) for name, value in numbers.items()}
        return MaterialTest(time=time, drive=drive, frame=frame, mode=self.mode, **arrays)

    def _input(self, recording: Recording, name: str) -> np.ndarray:
        if name not in recording.inputs:
            found = ", ".join(sorted(recording.inputs))
            raise InputError(f"recording {recording.name} ({self.name}) has no {name!r}; it has {found}")
        return np.asarray(recording.inputs[name], float)

    def predict(self, model: Model, values: Values, recording: Recording) -> Recording:
        """The recording that `model` would have given; see `Experiment.predict`."""
        known = local(model, values, recording.name)
        return reported(recording, _compiled(model.across(()), known, self.test(recording)))


def material_test_kind(name: str) -> Homogeneous:
    """The kind of material test called `name`.

    Raises:
        InputError: no such kind of experiment, or one that needs a body.
    """
    found = experiment(name)
    if not isinstance(found, Homogeneous):
        raise InputError(f"{name} is no material test; a probing needs the body it is made on")
    return found


def axes(
    direction: Sequence[float] | np.ndarray | None, normal: Sequence[float] | np.ndarray | None = None
) -> np.ndarray:
    """Rows: loaded, second and free axis of a test in the sample's frame.

    The second axis is the one given as `normal`: of the sheared planes, or of the second loaded direction. Without it
    the free axis is the one closest to the sample's z (to its y if loaded along z); without a direction the test's axes
    are the sample's.

    Raises:
        InputError: a normal without a direction, or not at right angles to it (to 5 degrees).
    """
    if direction is None:
        if normal is not None:
            raise InputError("normal is given without direction; give the direction of shear or of the first load too")
        return np.eye(3)
    first = np.asarray(direction, float) / np.linalg.norm(direction)
    if normal is not None:
        second = np.asarray(normal, float) / np.linalg.norm(normal)
        if abs(float(second @ first)) > np.sin(np.radians(5)):
            raise InputError(
                f"normal {np.round(second, 3).tolist()} is not at right angles to direction "
                f"{np.round(first, 3).tolist()}: shear runs along direction in planes across normal"
            )
        second -= (second @ first) * first
        second /= np.linalg.norm(second)
        return np.stack([first, second, np.cross(first, second)])
    near = np.array([0.0, 0.0, 1.0]) if abs(first[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    third = near - (near @ first) * first
    third /= np.linalg.norm(third)
    return np.stack([first, np.cross(third, first), third])


def local(model: Model, values: Values, recording: str) -> dict[str, Given]:
    """Every declared parameter's value in one recording: its own, the common one, or the default.

    Raises:
        InputError: a path that the model doesn't know.
    """
    declared = _declared(model)
    found: dict[str, Given] = {}
    for path, parameter in declared.items():
        own = f"{path}.{recording}"
        source = own if parameter.each and own in values else path
        found[path] = values.get(source, parameter.default)
    for path in values:
        if path not in declared and not any(path.startswith(f"{d}.") and p.each for d, p in declared.items()):
            raise unknown("parameter", path, model.parameters)
    return found


@lru_cache(maxsize=64)
def _declared(model: Model) -> dict[str, Parameter]:
    return model.declared


def reported(recording: Recording, stress: Float[Given, "n ..."]) -> Recording:
    """`recording` with predicted nominal stress in place of the measured one."""
    channel = Channel(recording.inputs["time"], stress, "Pa")
    return Recording(
        recording.name, recording.experiment, recording.inputs, {"nominal_stress": channel}, recording.attributes
    )


def nominal_stress(model: Model, values: Values, test: MaterialTest) -> Float[Array, "n ..."]:
    """Nominal stress that the load cell would report, Pa; (n,), or (n, 2) for a biaxial test.

    Args:
        model: energy and effects.
        values: one value for every declared parameter (`Model.declared`).
        test: what was done.
    """
    effects = [(effect, under(f"effects.{effect.name}", values)) for effect in model.ordered]

    def seen_from(i: int, drive: Array) -> Array:
        """Stress of the specimen if the rig, from its i-th effect inwards, is driven by `drive`."""
        for j, (effect, p) in enumerate(effects[i:], start=i):
            drive = effect.stretch(p, test, drive, lambda d, after=j + 1: seen_from(after, d))
        return specimen_stress(model, values, test, drive)

    stress = seen_from(0, test.drive)
    for effect, p in reversed(effects):
        stress = effect.stress(p, test, stress)
    return stress


_compiled = jax.jit(nominal_stress, static_argnums=0)


def specimen_stress(
    model: Model, values: Values, test: MaterialTest, drive: Float[Array, "n ..."]
) -> Float[Array, "n ..."]:
    """Nominal stress of the specimen itself, rig and sensor left out, Pa."""
    effects = [(effect, under(f"effects.{effect.name}", values)) for effect in model.ordered]

    def isochoric(C: Sym) -> Stress:
        return elastic(model, values, test, C)

    lasting = [(effect, p) for effect, p in effects if type(effect).memory is not Effect.memory]

    def at(ln_J: Array, skew: Array, lasting: list = lasting) -> tuple[Gradient, Sym]:
        F = deformation(test, drive, ln_J, skew)
        state = isochoric(right_cauchy_green(F))
        for effect, p in lasting:
            state = effect.memory(p, test, state)
        return F, state.S

    ln_J, skew = lateral(model, values, test, drive, isochoric)
    swelling = [(effect, p) for effect, p in effects if type(effect).volume is not Effect.volume]
    if swelling:
        turned = test.mode == "extension" and not model.isotropic

        def across(ln_J: Array, skew: Array) -> Array:
            return test.swell * unlike(test, drive, ln_J, skew, isochoric)

        ln_J, skew = _swollen(swelling, test, (ln_J, skew), at, bool(lasting), across if turned else None)
    F, S = at(ln_J, skew)
    stress = nominal(test, S, F)
    for effect, p in effects:
        stress = effect.exerted(p, test, stress)
    return stress


def elastic(model: Model, values: Values, test: MaterialTest, C: Sym) -> Stress:
    """Elastic isochoric PK2 stress 2 dpsi/dC in the test's axes, psi being the base energy plus what effects add."""

    def density(C: Sym, J: Array) -> Array:
        strain = Strain(C, J)
        turned = strain if model.isotropic else Strain(in_sample(C, test.frame), J)
        psi = model.energy.isochoric(under("energy", values), strain if model.energy.isotropic else turned)
        for effect in model.ordered:
            psi = psi + effect.energy(under(f"effects.{effect.name}", values), strain if effect.isotropic else turned)
        return psi

    def total(C: Sym) -> tuple[Array, Array]:
        psi = density(C, jnp.sqrt(determinant(C)))
        return jnp.sum(psi), psi

    # An off-diagonal component stands for two entries of C, so its derivative is doubled already.
    (_, psi), g = jax.value_and_grad(total, has_aux=True)(C)
    J = jnp.sqrt(determinant(C))
    # Growing C with J held sees what the projection removes: d psi / dk at k C is (2 dpsi/dCbar) : C / 2.
    _, growth = jax.jvp(lambda k: density(Sym(*(k * c for c in C)), J), (jnp.ones_like(J),), (jnp.ones_like(J),))
    return Stress(Sym(2 * g.xx, 2 * g.yy, 2 * g.zz, g.xy, g.xz, g.yz), psi, C, 2 * growth / 3)


def _swollen(
    effects: Sequence[tuple[Effect, Values]],
    test: MaterialTest,
    before: tuple[Float[Array, " n"], Float[Array, " n"]],
    at: Callable[..., tuple[Gradient, Sym]],
    lasting: bool,
    across: Callable[[Array, Array], Array] | None,
) -> tuple[Float[Array, " n"], Float[Array, " n"]]:
    """(ln J, skew) with the volume strain that effects add under the mean stress, which itself depends on both.

    Eight Newton steps with the elastic slope of the mean stress (all of it without memory; with it, a step leaves the
    relaxed share times mu/K of the error, and costs a third of one with the slope through the memory). Where the
    lateral faces differ (`across`: the stress between them), a step of the skew follows each; it stays where it was
    `before` where nothing swells.
    """
    ln_J, skew = before
    still = 0.0 if across is None else across(ln_J, skew)

    def added(guess: Array, skew: Array, *elastic: list) -> Array:
        F, S = at(guess, skew, *elastic)
        mean = hydrostatic(S, F) * jnp.exp(-guess)
        return ln_J + sum(effect.volume(p, test, mean, guess) for effect, p in effects)

    def newton(state: tuple[Array, Array], _: None) -> tuple[tuple[Array, Array], None]:
        (guess, skew), pull = state, across
        target, slope = jax.jvp(lambda x: added(x, skew, []), (guess,), (jnp.ones_like(guess),))
        target = added(guess, skew) if lasting else target
        step = (guess - target) / (1 - jnp.minimum(slope, 0.5))
        guess = jnp.clip(guess - step, -1.5, 1.5)
        if pull is not None:
            pulled, slope = jax.jvp(lambda x: pull(guess, x), (skew,), (jnp.ones_like(skew),))
            free = slope > 0  # never elsewhere than in tests whose second face is free
            skew = skew - jnp.where(free, jnp.clip((pulled - still) / jnp.where(free, slope, 1.0), -0.2, 0.2), 0.0)
        return (guess, skew), None

    return jax.lax.scan(newton, (ln_J, skew), None, length=8)[0]

"""Probing: a rigid tip pressed into an organ. One pure function from parameter values to force and markers.

The prepared scene (`probing_setup`) gets the model's energies and effects, is simulated, and read at the sensors'
times.
"""

from collections.abc import Mapping
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from tissuejax.effects.effect import Effect
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.energies.strain import Strain
from tissuejax.errors import InputError
from tissuejax.experiments.experiment import Experiment
from tissuejax.experiments.probing_sensors import read_at
from tissuejax.experiments.probing_setup import Setup
from tissuejax.model import Model
from tissuejax.parameters import under
from tissuejax.recordings.recording import Channel, Recording
from tissuejax.tled.internal import mesh as reference
from tissuejax.tled.scene import Scene
from tissuejax.tled.simulate import simulate
from tissuejax.tled.stable import critical_steps

SAFETY = 0.85  # share of an element's own critical step; elements below it are given mass


class Probing(Experiment):
    """A rigid spherical tip pressed into a sample: force on the tip, and markers on the surface."""

    name: ClassVar[str] = "probing"
    kind: ClassVar[str] = "probing"

    def predict(self, model: Model, values: Mapping[str, Array], recording: Recording) -> Recording:
        """A probing can't be predicted from its recording alone.

        Raises:
            InputError: always; the body is needed.
        """
        raise InputError(f"recording {recording.name}: a probing needs the body; use predictor(model, sample)")


class Added(eqx.Module):
    """The strain energy of an effect, as the simulation wants it: a function of strain with its values inside."""

    effect: Effect = eqx.field(static=True)
    values: Mapping[str, Array]

    def __call__(self, strain: Strain) -> Float[Array, "..."] | float:
        return self.effect.energy(self.values, strain)


class Simulated(NamedTuple):
    """A prediction and how it went.

    Attributes:
        channels: "force" (n, 3) N and "markers" (m, k, 3) m at the sensors' times; NaN throughout if the run failed.
        failed, element: -1, or the frame by which the run broke down and the element.
        inertia: greatest kinetic over greatest internal energy. depth: greatest penetration, m.
        pierced: -1, or the frame by which the surface was too deep in the probe (`tled.contact.PIERCED`).
        hourglass: greatest energy of the hourglass control over the greatest internal energy.
        corner: least volume ratio at a corner of any element: 0 or less where one is folded.
        ballast: mass added to hold the step, over the mass of the body.
        displacement: of the nodes at the end, m.
    """

    channels: dict[str, Float[Array, "..."]]
    failed: Int[Array, ""]
    element: Int[Array, ""]
    inertia: Float[Array, ""]
    depth: Float[Array, ""]
    ballast: Float[Array, ""]
    displacement: Float[Array, "N 3"] | None = None
    pierced: Int[Array, ""] | int = -1
    hourglass: Float[Array, ""] | float = 0.0
    corner: Float[Array, ""] | float = 1.0


def assembled(model: Model, values: Mapping[str, Array], setup: Setup) -> tuple[Scene, Float[Array, ""]]:
    """The scene with these parameter values and all effects in it, and its ballast.

    Args:
        model: energy and effects; `across(())`.
        values: a value for every declared parameter, by dotted path.
        setup: the recording made ready.
    """
    energy, bulk = under("energy", values), under("volumetric", values)
    scene = setup.scene
    dtype = scene.body.points.dtype
    shear = model.energy.initial_shear_modulus(energy)
    changes = {
        "tissue.energy_values": {k: jnp.asarray(v, dtype) for k, v in energy.items()},
        "settings.mass_damping": setup.damping * jnp.sqrt(jnp.maximum(shear, 1e-9)),
    }
    if bulk:
        changes["tissue.volumetric_values"] = {k: jnp.asarray(v, dtype) for k, v in bulk.items()}
    scene = scene.put(changes)
    for effect in model.ordered:
        p = under(f"effects.{effect.name}", values)
        if type(effect).energy is not Effect.energy:
            scene = scene.put({"tissue.added": (*scene.tissue.added, Added(effect, p))})
        scene = effect.scene(p, setup.test, scene)
    scene = scene.cast(dtype)
    ballast = _ballast(scene)
    share = jnp.sum(ballast) / jnp.sum(setup.test.mass) / scene.body.cells.shape[1]
    return scene.put({"probe.mass": scene.pressed.mass + ballast}), share


def _ballast(scene: Scene) -> Float[Array, " N"]:
    """Mass that lengthens the critical step of each element to the step of the clock, kg.

    An element's critical step grows with the root of its mass. Probing is slow, so some mass in a few small or stiff
    elements is harmless, and the step count stays fixed whatever values a fit visits.
    """
    frozen = scene.put(
        {"body.points": jax.lax.stop_gradient(scene.body.points)}
    )  # eigenvalues of cubes have no derivative
    mesh = reference(frozen)
    beta, h = frozen.settings.stiffness_damping, frozen.clock.step
    critical = critical_steps(frozen.put({"settings.stiffness_damping": jnp.zeros_like(beta)}), mesh)
    # y^2 + 2 xi y = 1 with y = omega h / (2 safety), xi = omega beta / 2: the highest omega that the step allows
    allowed = 1 / jnp.sqrt((h / (2 * SAFETY)) ** 2 + beta * h / (2 * SAFETY))
    factor = (2 / critical / allowed) ** 2
    count, nodes = frozen.body.cells.shape
    extra = frozen.tissue.density * mesh.reference.volume[:count] / nodes * jnp.maximum(factor - 1.0, 0.0)
    return jnp.zeros_like(frozen.pressed.mass).at[frozen.body.cells].add(extra[:, None])


def simulated(model: Model, values: Mapping[str, Array], setup: Setup) -> Simulated:
    """Force and markers that the sensors would report. Pure JAX: jit, jvp, vjp and vmap work from outside."""
    scene, ballast = assembled(model, values, setup)
    out = simulate(scene)
    channels: Mapping[str, Channel] = {"force": Channel(out.time, out.force, "N")}
    placed = setup.scene.markers
    if out.markers is not None and placed is not None and len(setup.marker_times):
        channels = {**channels, "markers": Channel(out.end_time, _about_rest(out.markers, placed.rest, setup), "m")}
    outwards = tuple(reversed(model.ordered))
    for effect in (e for e in outwards if not type(e).added):
        channels = effect.channels(under(f"effects.{effect.name}", values), setup.test, channels)
    times = {"force": setup.force_times, "markers": setup.marker_times}
    pierced = out.pierced(scene)
    bad = (out.failed >= 0) | (pierced >= 0)
    poison = jnp.where(bad, jnp.nan, 0.0)  # a broken run must never look like a prediction
    read = {name: read_at(times[name], ch.time, ch.values) + poison for name, ch in channels.items()}
    shown: Mapping[str, Channel] = {name: Channel(times[name], read[name], channels[name].unit) for name in read}
    for effect in (e for e in outwards if type(e).added):  # of time alone: at the sensors' own, not between frames
        shown = effect.channels(under(f"effects.{effect.name}", values), setup.test, shown)
    reported = {name: jnp.asarray(ch.values) for name, ch in shown.items()}
    return Simulated(
        reported, out.failed, out.element, out.inertia, out.depth, ballast, out.state.u.T, pierced, out.hourglass,
        out.corner,
    )  # fmt: skip


def _about_rest(markers: Float[Array, "n k 3"], rest: Float[Array, "k 3"], setup: Setup) -> Float[Array, "n k 3"]:
    """Markers such that their mean over the frames out of contact is the measured one, also on a moving support."""
    moved = markers - rest
    calm = jnp.tensordot(setup.calm.astype(moved.dtype), moved, 1)
    return markers - jnp.where(jnp.sum(setup.calm) > 0, calm, 0.0)


__all__ = ["Added", "Probing", "ProbingTest", "Simulated", "assembled", "simulated"]

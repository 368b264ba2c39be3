"""Cutting: a blade drawn through tissue. What its force must be, from the balance of energies.

In the steady state the blade's work goes into parting (toughness G), into the two layers that it leaves squeezed behind
it, and into friction on its flats. Per depth of cut,

    F = (G + 2 W psi(1 - b / 2W)) (1 + mu / t) / (1 - mu t) + 2 mu p L,

t the slope of a bevel (what parts and squeezes the tissue presses on the bevels, and rubs there: 2 N (cos - mu sin) t
is the work across the cut, 2 N (sin + mu cos) the force along it; at 14 degrees and mu 0.1 they add 44 %), psi the
strain energy of a layer of height W (half the tissue's width) pressed together by half the thickness b, p
its pressure, L the length of blade in contact (all that is cut, or `reach`). On the way back, and in a cut made before,
only friction is left. This is exact for any law of parting and any strain (virtual work), and holds no strength: that
is in the entry, which only the simulation has (`cutting_run.py`); here the force sets in over a length.
Atkins 2009, The Science and Engineering of Cutting, ch. 3; Lister 2012, 3.1.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.arrays import Given
from tissuejax.effects.cutting_test import Cut
from tissuejax.errors import InputError
from tissuejax.experiments.cutting_layers import ages, layer, relaxed
from tissuejax.experiments.cutting_record import Path
from tissuejax.experiments.experiment import Experiment
from tissuejax.model import Model
from tissuejax.parameters import under
from tissuejax.recordings.recording import Recording

ONSET = 2e-3  # m: length over which the force sets in, where nothing says otherwise
ROUNDS = 4  # of Newton's method, of a rig that gives way


class Cutting(Experiment):
    """A blade drawn through a sample: force on the blade, and markers beside the path."""

    name: ClassVar[str] = "cutting"
    kind: ClassVar[str] = "cutting"

    def predict(self, model: Model, values: Mapping[str, Array], recording: Recording) -> Recording:
        """A cut can't be predicted from its recording alone.

        Raises:
            InputError: always; the body is needed.
        """
        raise InputError(f"recording {recording.name}: a cut needs the body; use predictor(model, sample)")


def met(model: Model, values: Mapping[str, Array], path: Path, at, pace, elapsed, depth) -> Cut:
    """What the blade meets at stations along a path, all effects included."""
    one = jnp.ones_like(jnp.asarray(at, float))
    cut = Cut(
        at=jnp.asarray(at, float), share=jnp.clip(jnp.asarray(at) / path.length, 0, 1),
        pace=jnp.asarray(pace),
        elapsed=jnp.asarray(elapsed), energy=values["cohesion.energy"] * one,
        strength=values["cohesion.strength"] * one,
        depth=jnp.asarray(depth), friction=jnp.asarray(0.0), onset=jnp.asarray(ONSET),
    )  # fmt: skip
    for effect in model.ordered:
        cut = effect.cut(under(f"effects.{effect.name}", values), cut)
    return cut


def balance_force(
    model: Model, values: Mapping[str, Array], path: Path, since: Float[Given, "n s"] | None = None
) -> Float[Array, " n"]:
    """Force against the motion at the times of the path, N, by the balance of energies. Pure JAX, of the path too.

    Where the rig gives way the edge stands compliance * force behind the path (Newton's method; exact for a force that
    follows from where the edge stands).

    Args:
        since: `cutting_layers.ages` of the path, worked out here by default (the path is then no tracer).
    """
    given, path = path, Path(*(jnp.asarray(x) for x in path))
    begun = path.time[jnp.argmax(path.x > 0)]
    layers = layer(model, values, path.half, path.thickness)

    def force(x, front):
        cut = met(model, values, path, front, path.speed, path.time - begun, path.depth)
        wedge, pressure = layers[:2]
        if cut.relaxing is not None:
            wedge, pressure = relaxed(layers, cut.relaxing, path, ages(given) if since is None else since)
        fresh = 1 - jnp.exp(-jnp.maximum(cut.at - path.notch, 0.0) / cut.onset)
        inside = 1 - jnp.exp(-jnp.maximum(jnp.asarray(x), 0.0) / cut.onset)
        parting = path.fresh * cut.energy * fresh + wedge * cut.squeezing * inside
        contact = jnp.clip(jnp.asarray(x), 0, path.length)
        way = jnp.tanh(jnp.asarray(path.speed) / 1e-4)  # at rest the springs of friction hold what they held
        slope, rub = jnp.tan(0.5 * path.angle), cut.friction * way
        bevel = (1 + rub / slope) / (1 - rub * slope)
        return cut.depth * (parting * bevel + 2 * rub * pressure * contact), cut.compliance

    plain, compliance = force(path.x, path.front)
    if compliance is None:
        return plain

    onward = path.x >= jax.lax.cummax(path.x)
    farthest = jax.lax.cummax(jnp.where(onward, jnp.arange(len(path.x)), 0))

    def behind(by):
        x = path.x - by
        return force(x, jnp.clip(jnp.maximum(x[farthest], path.notch), 0, path.length))[0]

    def round_(by, _):
        at, slope = jax.jvp(behind, (by,), (jnp.ones_like(by),))
        return by - (by - compliance * at) / jnp.maximum(1 - compliance * slope, 0.5), None

    return behind(jax.lax.scan(round_, jnp.zeros_like(plain), None, length=ROUNDS)[0])

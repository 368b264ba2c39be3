"""Where the work of a cut goes: the energy balance of a run, frame by frame.

work of the blade + work of the support = elastic + hourglass + viscous + stored and lost in the faces + penalty + stick
springs + friction + damping + kinetic. Every term is taken for itself (energies from the state, losses summed over the
steps), so what is left over says how well a run was resolved. Only `viscous` (tissue with memory) is what the internal
forces did beyond the elastic energy: there is no closed form of it to compare with.

All terms belong to one time, half a step before the frame's end: forces are known at whole steps and act on the mean of
the speeds before and after, so summed works reach from the start to where the last speed is known, as the kinetic
energy does. Displacements are brought back there by half a step; taken at the frame's end they would hold half a step
more of work than was counted, an error of the first order in the step instead of the second.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.tensors import total
from tissuejax.tled import capsule, contact, faces, internal


class Spent(NamedTuple):
    """Summed over steps, J: lost in faces, by friction, by mass damping, done on the tissue, done by the support."""

    lost: Float[Array, ""]
    friction: Float[Array, ""]
    damping: Float[Array, ""]
    tissue: Float[Array, ""]
    support: Float[Array, ""]


class Balance(NamedTuple):
    """Energies half a step before the end of each frame, J, and the crack; n frames.

    Attributes:
        work: of the blade. support: of held nodes that move.
        kinetic, elastic, hourglass: of the tissue (elastic without memory; with skin and weight).
        viscous: gone into the tissue's memory and stiffness damping; zero where there is neither.
        stored, lost: in the faces. penalty: of contact. sticking: in friction's stick springs.
        friction, damping: lost.
        area: parted, m^2. front: farthest parted point along the cut, m (-inf where nothing is parted).
    """

    work: Float[Array, " n"]
    support: Float[Array, " n"]
    kinetic: Float[Array, " n"]
    elastic: Float[Array, " n"]
    hourglass: Float[Array, " n"]
    viscous: Float[Array, " n"]
    stored: Float[Array, " n"]
    lost: Float[Array, " n"]
    penalty: Float[Array, " n"]
    sticking: Float[Array, " n"]
    friction: Float[Array, " n"]
    damping: Float[Array, " n"]
    area: Float[Array, " n"]
    front: Float[Array, " n"]

    @property
    def accounted(self) -> Float[Array, " n"]:
        """Sum of where the work went, J."""
        return total(self[2:12])

    @property
    def error(self) -> Float[Array, " n"]:
        """Work less what it went into, over the work put in so far."""
        given = self.work + self.support
        scale = jnp.maximum(jax.lax.cummax(jnp.abs(given)), 1e-6 * jnp.max(jnp.abs(given)) + 1e-30)
        return (given - self.accounted) / scale


class Look(NamedTuple):
    """Energies of one state, J, and the crack."""

    kinetic: Float[Array, ""]
    elastic: Float[Array, ""]
    hourglass: Float[Array, ""]
    stored: Float[Array, ""]
    penalty: Float[Array, ""]
    sticking: Float[Array, ""]
    area: Float[Array, ""]
    front: Float[Array, ""]


def midway(m, state) -> Float[Array, "3 N"]:
    """Displacements at the time of the state's speeds, half a step back, m: (u(n) + u(n+1)) / 2."""
    return state.u - 0.5 * m.scene.clock.step * state.v


def look(m, state, centre: Float[Array, " 3"] | None) -> Look:
    """Energies at the time of the state's speeds; not differentiated. `centre`: the blade's reference point then."""
    m, state = jax.lax.stop_gradient((m, state))
    scene, u = m.scene, midway(m, state)
    elastic, _, hourglass = internal.internal_energy(scene, m.mesh, u)
    if m.skin is not None:
        elastic = elastic + capsule.energy(m.skin, scene.tissue.capsule, u.at[:, m.skin.nodes].get())
    if m.weight is not None:
        elastic = elastic - jnp.sum(m.weight * u)
    penalty = sticking = jnp.zeros((), u.dtype)
    if centre is not None:
        centre = jax.lax.stop_gradient(centre)
        penalty = contact.energy(scene.probe, m.patch, u, centre)
        if scene.probe.friction is not None:
            sticking = contact.gripped(scene.probe, m.patch, u, centre, state.grip)
    crack = faces.cracked(scene.faces, m.seam, u, state.opening)
    kinetic = 0.5 * jnp.sum(m.mass * state.v * state.v)
    return Look(kinetic, elastic, hourglass, crack.stored, penalty, sticking, crack.area, crack.front)


def balance(scene, work, spent: Spent, looks: Look) -> Balance:
    """Series by frame from what each frame did and looked like at its end."""
    total = Spent(*(jnp.cumsum(x) for x in spent))
    memory = scene.tissue
    remembers = any(x is not None for x in (memory.prony, memory.drain, memory.damage))
    kept = looks.elastic + looks.hourglass
    damped = scene.settings.stiffness_damping > 0
    beyond = jnp.where(remembers | damped, total.tissue - kept, 0.0)
    return Balance(
        jnp.cumsum(work), total.support, looks.kinetic, looks.elastic, looks.hourglass, beyond, looks.stored,
        total.lost, looks.penalty, looks.sticking, total.friction, total.damping, looks.area, looks.front,
    )  # fmt: skip

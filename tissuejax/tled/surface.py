"""Forces on the surface, of probe and cohesive faces together: corners are gathered once and summed at the nodes once.

On a split slice both are small beside the body, and a step's cost is the number of its operations: one gather and one
sum in place of five and five, and no sum over the points before the frame is over (`Acting` holds what each facet or
point does).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from tissuejax.arrays import barrier
from tissuejax.tensors import total
from tissuejax.tled import contact, faces, native
from tissuejax.tled.scene import Probe, filled


class Acting(NamedTuple):
    """What acts on the surface in one step.

    Attributes:
        nodal: on the tissue, N (3, N), of what runs in C; None where `at` has all.
        at: on corners, N, to be added to the flattened forces at `index`, or None.
        force, torque: on the probe, N and N m, of each facet (3, n); sum over n.
        grip: contact's memory. rubbed: lost by friction at each point, J, or None.
        memory: of the faces. lost: in the faces at each point, J, or None.
    """

    nodal: Float[Array, "3 N"] | None
    at: Float[Array, "3 v P"] | None
    index: Int[Array, "3 v P"] | None
    force: Float[Array, "3 n"] | None
    torque: Float[Array, "3 n"] | None
    grip: contact.Grip | None
    rubbed: Float[Array, "..."] | None
    memory: faces.Memory | None
    lost: Float[Array, "q F"] | None


def corners(patch: contact.Patch | None, joint: faces.Faces | None, count: int) -> Int[Array, "3 v P"]:
    """Corners of the probe's facets, then of the faces' plus and minus sides: places in the flattened displacements
    (3, N) of `count` nodes."""
    nodes = [] if patch is None else [patch.nodes]
    nodes += [] if joint is None else [joint.plus.T, joint.minus.T]
    every = jnp.concatenate(nodes, 1)
    return every + count * jnp.arange(3, dtype=every.dtype)[:, None, None]


def forces(
    probe: Probe | None,
    patch: contact.Patch | None,
    joint: faces.Faces | None,
    seam: faces.Seam | None,
    index: Int[Array, "3 v P"],
    u: Float[Array, "3 N"],
    centre: Float[Array, " 3"] | None,
    grip: contact.Grip | None,
    memory: faces.Memory | None,
) -> Acting:
    """Forces of a probe whose reference point is at `centre`, and of the faces, at displacements u."""
    touch = None if probe is None else native.contact(contact.by_facet, probe, patch, grip)
    hold = None if joint is None else native.faces(faces.by_face, joint, filled(seam), memory)
    sizes = [] if probe is None else [(filled(patch).nodes.shape[1], touch is None)]
    sizes += [] if joint is None else [(len(side), hold is None) for side in (joint.plus, joint.minus)]
    left = [n for n, mine in sizes if mine]  # what runs in C gathers and sums by itself
    begun, parted = 0 if touch is None else sizes[0][0], []
    if left:
        index = index[:, :, begun : begun + sum(left)]
        ue = barrier(u.reshape(-1).at[index].get(mode="promise_in_bounds"))
        parted = list(jax.lax.split(ue, left, 2))
    force = torque = rubbed = lost = None
    nodal, done = [], []
    if touch is not None:
        f, force, torque, rubbed, grip = touch(u, centre)
        force, torque = -force[:, None], -torque[:, None]
        nodal.append(f)
    elif probe is not None:
        pressed = contact.by_facet(probe, filled(patch).x, parted.pop(0), filled(centre), filled(grip))
        f, x, grip, rubbed = pressed.f, pressed.x, pressed.grip, pressed.lost
        force = -jnp.sum(f, 1)
        torque = -jnp.stack([jnp.sum(x[i - 2] * f[i - 1] - x[i - 1] * f[i - 2], 0) for i in range(3)])
        done.append(pressed.at_nodes)
    if hold is not None:
        f, memory, lost = hold(u)
        nodal.append(f)
    elif joint is not None:
        high, low = parted
        held = faces.by_face(joint, filled(seam).x, high, low, filled(memory))
        memory, lost = held.memory, held.lost
        done += [held.at, -held.at]
    at = barrier(jnp.concatenate(done, 2)) if done else None
    own = total(nodal) if nodal else None
    return Acting(own, at, index if done else None, force, torque, grip, rubbed, memory, lost)


def added(acting: Acting, f: Float[Array, "3 N"]) -> Float[Array, "3 N"]:
    """Nodal forces with what acts on the surface."""
    f = f if acting.nodal is None else f + acting.nodal
    if acting.at is None:
        return f
    return f.reshape(-1).at[acting.index].add(acting.at, mode="promise_in_bounds").reshape(f.shape)

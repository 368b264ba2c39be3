"""Cohesive faces in the simulation: the two sides of a split held together by a law, at points of the faces.

Traction acts at 2 x 2 Gauss points of each quadrilateral (three of a triangle) over reference areas, never at nodes:
nodal springs drive the hourglass modes of one-point elements. The opening is that of the two sides against each other;
its normal is the present one of the surface midway. `seam.py` chooses stiffness and static mass.
"""

from collections.abc import Mapping
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from tissuejax.arrays import barrier
from tissuejax.cohesion.engine import Memory, Vector, pull, stored, whole
from tissuejax.cohesion.law import Law
from tissuejax.tensors import total


class Faces(eqx.Module):
    """Faces of a split body.

    Attributes:
        law: static; its parameters by name in `values`, each a number or one a face (P,).
        minus, plus: nodes of either side.
        area: reference area of each point, m^2 (q, P).
        stiffness: of unbroken faces, Pa/m. contact: of closing gaps, Pa/m.
        mass: static mass on the faces' nodes, kg (N,), so that they never limit the step.
        along: unit vector by which the front is measured.
        notch: 1 where a face has been parted before the start (a cut made earlier), else 0; None is whole.
    """

    law: Law = eqx.field(static=True)
    values: Mapping[str, Array]
    minus: Int[Array, "P v"]
    plus: Int[Array, "P v"]
    area: Float[Array, "q P"]
    stiffness: Float[Array, ""]
    contact: Float[Array, ""]
    mass: Float[Array, " N"]
    along: Float[Array, " 3"]
    notch: Float[Array, " P"] | None = None


class Seam(NamedTuple):
    """Worked out once a run: reference corners (3, v, P) and places of the points along the front's direction."""

    x: Float[Array, "3 v P"]
    ahead: Float[Array, "q P"]


class Held(NamedTuple):
    """What the faces do in one step: forces on the corners of their plus sides (3, v, P), memory, and the energy that
    each point lost in the step, J (q, P)."""

    at: Float[Array, "3 v P"]
    memory: Memory
    lost: Float[Array, "q P"]


def quadrature(corners: int, points: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Shape functions (q, corners), weights (q,): 2 x 2 Gauss points over [-1, 1]^2, or with `points` 2 those on the
    middle line from edge 3-0 to edge 1-2 (enough in a plane slice); three inner ones of a triangle (sum 1/2)."""
    if corners == 4:
        a, b = local(points)
        shape = np.stack([(1 - a) * (1 - b), (1 + a) * (1 - b), (1 + a) * (1 + b), (1 - a) * (1 + b)], -1) / 4
        return shape, np.full(len(a), 4.0 / len(a))
    return np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6, np.full(3, 1 / 6)


def local(points: int) -> tuple[np.ndarray, np.ndarray]:
    """Places of a quadrilateral's points in [-1, 1]^2, see `quadrature`."""
    g = 1 / np.sqrt(3)
    if points == 2:
        return np.array([-g, g]), np.zeros(2)
    return np.array([-g, g, g, -g]), np.array([-g, -g, g, g])


def seam(faces: Faces, points: Float[Array, "N 3"]) -> Seam:
    """Reference places of the faces."""
    x = points.T[:, faces.minus.T]
    shape = jnp.asarray(quadrature(faces.minus.shape[1], len(faces.area))[0], x.dtype)
    return Seam(x, jnp.einsum("qv,ivp,i->qp", shape, x, faces.along.astype(x.dtype)))


def unopened(faces: Faces) -> Memory:
    """Memory at the start; notched faces carry nothing."""
    memory = whole(faces.law, faces.values, faces.stiffness, faces.area)
    return memory if faces.notch is None else memory._replace(secant=memory.secant * (1 - faces.notch))


def gaps(
    x: Float[Array, "3 v P"], points: int, low: Float[Array, "3 v P"], high: Float[Array, "3 v P"]
) -> tuple[Vector, Vector]:
    """Opening of the points (three arrays (q, P), m) and the normals midway (three arrays (P,)), from the corners at
    rest and the displacements of those of the minus and the plus sides."""
    shape = jnp.asarray(quadrature(low.shape[1], points)[0], low.dtype)[:, :, None]
    jump, middle = high - low, barrier(x + 0.5 * (high + low))
    gap = barrier(sum(shape[:, a] * jump[:, a][:, None] for a in range(shape.shape[1])))
    if shape.shape[1] == 4:
        one, two = middle[:, 2] - middle[:, 0], middle[:, 3] - middle[:, 1]
    else:
        one, two = middle[:, 1] - middle[:, 0], middle[:, 2] - middle[:, 0]
    x, y, z = (one[i - 2] * two[i - 1] - one[i - 1] * two[i - 2] for i in range(3))
    size = jax.lax.rsqrt(x * x + y * y + z * z)
    return tuple(gap), barrier((x * size, y * size, z * size))


def by_face(
    faces: Faces, x: Float[Array, "3 v P"], high: Float[Array, "3 v P"], low: Float[Array, "3 v P"], memory: Memory
) -> Held:
    """What the faces do, `x` their corners at rest, at displacements `high` and `low` of those of their plus and minus
    sides."""
    gap, normal = gaps(x, len(faces.area), low, high)
    acting = pull(faces.law, faces.values, faces.stiffness, faces.contact, gap, normal, memory)
    f = barrier(jnp.stack(acting.traction) * faces.area)
    shape = jnp.asarray(quadrature(low.shape[1], len(faces.area))[0], f.dtype)[:, :, None]
    at = total(shape[q] * f[:, q][:, None] for q in range(shape.shape[0]))
    return Held(at, acting.memory, acting.lost * faces.area)


class Cracked(NamedTuple):
    """Energy stored in the faces (J), area parted so far (m^2), and the farthest parted point along `along` (m)."""

    stored: Float[Array, ""]
    area: Float[Array, ""]
    front: Float[Array, ""]


def cracked(faces: Faces, seam: Seam, u: Float[Array, "3 N"], memory: Memory) -> Cracked:
    """How far the crack has come. Parted: opened as far as the law's end, or notched before; -inf where nothing is."""
    low, high = (u.at[:, nodes.T].get(mode="promise_in_bounds") for nodes in (faces.minus, faces.plus))
    gap, normal = gaps(seam.x, len(faces.area), low, high)
    energy = jnp.sum(faces.area * stored(memory.secant, faces.contact, gap, normal))
    parted = memory.reached >= faces.law.end(faces.values, faces.stiffness)
    ahead = parted if faces.notch is None else parted | (faces.notch > 0)
    front = jnp.max(jnp.where(ahead, seam.ahead, -jnp.inf))
    return Cracked(energy, jnp.sum(faces.area * parted), front)

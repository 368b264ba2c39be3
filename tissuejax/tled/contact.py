"""Contact of a rigid probe at quadrature points of the surface facets: penalty, friction, adhesion.

Contact at the nodes drives the hourglass modes of one-point elements and loses up to half the force, so pressure acts
at 3 x 3 Gauss points of each quadrilateral (six points of a triangle), over reference areas. The pressure is
p = penalty * softness * softplus(-gap / softness). Friction is Coulomb's law made regular by a tangential spring of the
same stiffness, in series with what `give` says: a point sticks until the spring carries mu p, then it slides. Adhesion
pulls at points that have touched, sigma (gap/reach) exp(1 - gap/reach), until the gap is five times `reach`.
"""

from math import factorial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from tissuejax import tensors
from tissuejax.arrays import barrier
from tissuejax.elements.element import parts
from tissuejax.tled import native
from tissuejax.tled.internal import add, take
from tissuejax.tled.scene import Probe, Scene, filled
from tissuejax.tled.shapes import Vector

BONDED = 4.0  # a point that comes as near as zero gap is bonded by 98 %, however lightly it is pressed
PIERCED = 0.05  # penetration over the probe's radius from which contact no longer holds
FAINT = 40.0  # softplus(-40) = 4e-18 is set to zero: smaller numbers underflow, which processors do slowly, one by one
BERNOULLI = tuple(  # B_2k and (2k + 1)!
    (b, factorial(2 * k + 1))
    for k, b in enumerate((1 / 6, -1 / 30, 1 / 42, -1 / 30, 5 / 66, -691 / 2730, 7 / 6, -3617 / 510), start=1)
)
BREAK = 5.0  # gap over reach at which a bond is gone: exp(1 - 5) * 5 = 9 % of the greatest pull


def quadrature(corners: int, points: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Shape functions (q, corners) and weights (q,) of the contact points of a facet, weights on the reference facet.

    Quadrilaterals: 3 x 3 Gauss points over [-1, 1]^2, or with `points` 3 those on the middle line from edge 3-0 to edge
    1-2 (enough where nothing changes across it, in a plane slice). Triangles: six points of degree 4 (Dunavant 1985),
    sum 1/2.
    """
    if corners == 4:
        place, weight = np.polynomial.legendre.leggauss(3)
        a, b = (g.ravel() for g in np.meshgrid(place, [0.0] if points == 3 else place))
        shape = np.stack([(1 - a) * (1 - b), (1 + a) * (1 - b), (1 + a) * (1 + b), (1 - a) * (1 + b)], -1) / 4
        return shape, 2 * weight if points == 3 else np.outer(weight, weight).ravel()
    one, two = 0.445948490915965, 0.091576213509771
    bary = [np.roll([1 - 2 * x, x, x], i) for x in (one, two) for i in range(3)]
    return np.array(bary), np.repeat([0.111690794839005, 0.054975871827661], 3)


class Grip(NamedTuple):
    """What contact remembers at each point: where it sticks (three arrays, or None), whether it is bonded (or None)."""

    anchor: tuple[Float[Array, "q P"], ...] | None
    bond: Float[Array, "q P"] | None


class Patch(NamedTuple):
    """Reference positions of the patch's nodes, (3, v, P), and their numbers, (v, P)."""

    x: Float[Array, "3 v P"]
    nodes: Int[Array, "v P"]


def patch(scene: Scene) -> Patch:
    """The facets of the scene's contact patch."""
    nodes = scene.pressed.patch.T
    return Patch(scene.body.points.T.at[:, nodes].get(mode="promise_in_bounds"), nodes)


def untouched(probe: Probe) -> Grip:
    """Memory before the first contact."""
    zero = jnp.zeros_like(probe.area)
    return Grip(None if probe.friction is None else (zero, zero, zero), None if probe.adhesion is None else zero)


class Touch(NamedTuple):
    """Result of `forces`: `nodal` (3, N) on the tissue, `force` and `torque` on the probe, the memory, and what
    friction lost by sliding in this step, J (None without friction)."""

    nodal: Float[Array, "3 N"]
    force: Float[Array, " 3"]
    torque: Float[Array, " 3"]
    grip: Grip
    rubbed: Float[Array, ""] | None = None


def places(patch: Patch, u: Float[Array, "3 N"], centre: Float[Array, " 3"], shape: np.ndarray) -> Vector:
    """Contact points relative to the probe's reference point, three arrays (q, P); one component at a time, see
    `internal.take`."""
    return _placed(patch.x, take(u, patch.nodes), centre, shape)


def _placed(x, ue, centre, shape) -> Vector:
    """`places` of corners at rest `x` and their displacements `ue`, each (3, v, P)."""
    weights = jnp.asarray(shape, ue[0].dtype)[:, :, None]
    at = barrier(sum(weights[:, a] * (x[:, a] + ue[:, a])[:, None] for a in range(x.shape[1])) - centre[:, None, None])
    x, y, z = parts(at)
    return x, y, z


def total(x: Float[Array, "r n"]) -> Float[Array, ""]:
    """Sum in two steps, first down the columns: in one long sum each addition waits for the one before."""
    return jnp.sum(barrier(jnp.sum(x, 0)))


def softplus(z):
    """log(1 + exp z), zero below -`FAINT`.

    The logarithm of 1 + t is 2 artanh(t / (2 + t)), a series in a ninth at most: its 16 terms are exact to 1e-15 and
    cost less than half of what a processor's own logarithm does, most of a blade's contact.
    """
    t = jnp.exp(-jnp.minimum(jnp.abs(z), FAINT))
    s = t / (2 + t)
    series = jnp.zeros_like(s)
    for k in range(31, 0, -2):
        series = series * (s * s) + 1.0 / k
    return jnp.where(z > -FAINT, jnp.maximum(z, 0.0) + 2 * s * series, 0.0)


def approached(z):
    """Integral of `softplus` up to z: -Li2(-exp z), and zero below -`FAINT`, where nothing pushes.

    With w = log(1 + exp z) it is the sum over k of B_k w^(k+1) / (k+1)! with the Bernoulli numbers, B_1 = 1/2: for
    z <= 0 a series in (w / 2 pi)^2, a hundredth at most, whose eight terms are exact to 1e-17. Above, Li2's reflection
    z^2/2 + pi^2/6 less the same at -z.
    """
    w = softplus(-jnp.abs(z))
    square, series = w * w, jnp.zeros_like(w)
    for b, over in reversed(BERNOULLI):
        series = series * square + b / over
    below = w + square / 4 + w * square * series
    return jnp.where(z > 0, z * z / 2 + jnp.pi**2 / 6 - below, jnp.where(z > -FAINT, below - np.exp(-FAINT), 0.0))


class Pressed(NamedTuple):
    """What each facet does: forces at its points and its corners, N, where the points are from the probe, m, the
    memory, and what friction lost by sliding, J (None without friction)."""

    f: Float[Array, "3 q P"]
    at_nodes: Float[Array, "3 v P"]
    x: Vector
    grip: Grip
    lost: Float[Array, "q P"] | None


def forces(probe: Probe, patch: Patch, u: Float[Array, "3 N"], centre: Float[Array, " 3"], grip: Grip) -> Touch:
    """Contact forces with the probe's reference point at `centre`."""
    touch = native.contact(by_facet, probe, patch, grip)
    if touch is not None:
        nodal, force, torque, rubbed, grip = touch(u, centre)
        return Touch(nodal, -force, -torque, grip, rubbed)
    f, at_nodes, x, grip, lost = by_facet(probe, patch.x, take(u, patch.nodes), centre, grip)
    force = jnp.stack([total(t) for t in f])
    torque = jnp.stack([total(x[i - 2] * f[i - 1] - x[i - 1] * f[i - 2]) for i in range(3)])
    nodal = jnp.stack(barrier(tuple(add(t, patch.nodes, u.shape[1]) for t in at_nodes)))
    return Touch(nodal, -force, -torque, grip, None if lost is None else total(lost))


def by_facet(probe: Probe, x, ue, centre: Float[Array, " 3"], grip: Grip) -> Pressed:
    """Facet by facet, from the places of the corners at rest `x` and their displacements `ue`, each (3, v, P)."""
    shape, _ = quadrature(len(x[0]), len(probe.area))
    x = _placed(x, ue, centre, shape)
    gap, normal = probe.shape.distance(x)
    pressure = barrier(probe.penalty * probe.softness * softplus(-gap / probe.softness))  # once, not once a component
    push, bond = pressure, grip.bond
    if probe.adhesion is not None:
        touched = jax.nn.sigmoid(BONDED - gap / probe.softness)
        bond = jnp.where(gap > BREAK * probe.reach, 0.0, jnp.maximum(filled(bond), touched))
        opening = jnp.maximum(gap, 0.0) / probe.reach
        push = pressure - probe.adhesion * bond * opening * jnp.exp(1.0 - opening)
    traction, anchor = tuple(push * n for n in normal), grip.anchor  # on the tissue: away from the probe
    lost = None
    if probe.friction is not None:
        drag, anchor, lost = _friction(probe, x, normal, pressure, anchor)
        lost = lost * probe.area
        traction = tuple(t + d for t, d in zip(traction, drag, strict=True))
    f = barrier(jnp.stack(traction) * probe.area)
    weights = jnp.asarray(shape, gap.dtype)[:, :, None]
    at_nodes = tensors.total(weights[q] * f[:, q][:, None] for q in range(shape.shape[0]))
    return Pressed(f, at_nodes, x, Grip(anchor, bond), lost)


def _friction(probe, x, normal, pressure, anchor):
    """Traction of the tangential springs after sliding, where they are anchored now (relative to the probe), and the
    energy that they gave up by sliding, J/m^2."""
    stretch = tuple(a - b for a, b in zip(x, anchor, strict=True))
    along = sum(s * n for s, n in zip(stretch, normal, strict=True))
    stretch = barrier(tuple(s - along * n for s, n in zip(stretch, normal, strict=True)))
    square = sum(s * s for s in stretch)
    some = square > 0
    length = jnp.sqrt(jnp.where(some, square, 1.0))
    spring = probe.penalty / (1.0 + probe.penalty * probe.give)
    limit = probe.friction * pressure / spring
    kept = barrier(jnp.where(some, jnp.minimum(1.0, limit / length), 1.0))
    kept_stretch = tuple(kept * s for s in stretch)
    anchor = tuple(a - s for a, s in zip(x, kept_stretch, strict=True))
    lost = spring * square * kept * (1.0 - kept)  # traction times slide; none where nothing presses
    return tuple(-spring * s for s in kept_stretch), anchor, lost


def breadth(scene: Scene) -> Float[Array, ""]:
    """Radius of the probe, or a tenth of the body's height under one without (a platen), m."""
    reach = jnp.asarray(scene.pressed.shape.reach(), scene.body.points.dtype)
    return jnp.where(jnp.isfinite(reach), reach, 0.1 * jnp.ptp(scene.body.points[:, 2]))


def depth(probe: Probe, patch: Patch, u: Float[Array, "3 N"], centre: Float[Array, " 3"]) -> Float[Array, ""]:
    """Greatest penetration of a contact point into the probe, m; negative where nothing touches."""
    shape, _ = quadrature(patch.nodes.shape[0], len(probe.area))
    gap, _ = probe.shape.distance(places(patch, u, centre, shape))
    return jnp.max(jnp.where(probe.area > 0, -gap, -jnp.inf))


def energy(probe: Probe, patch: Patch, u: Float[Array, "3 N"], centre: Float[Array, " 3"]) -> Float[Array, ""]:
    """Energy stored in the normal penalty, J: the integral of the pressure over the approach."""
    shape, _ = quadrature(patch.nodes.shape[0], len(probe.area))
    gap, _ = probe.shape.distance(places(patch, u, centre, shape))
    return jnp.sum(probe.area * probe.penalty * probe.softness**2 * approached(-gap / probe.softness))


def gripped(probe: Probe, patch: Patch, u: Float[Array, "3 N"], centre: Float[Array, " 3"], grip: Grip):
    """Energy stored in the stick springs, J."""
    shape, _ = quadrature(patch.nodes.shape[0], len(probe.area))
    x = places(patch, u, centre, shape)
    gap, normal = probe.shape.distance(x)
    pressure = probe.penalty * probe.softness * softplus(-gap / probe.softness)
    drag, _, _ = _friction(probe, x, normal, pressure, grip.anchor)
    spring = probe.penalty / (1.0 + probe.penalty * probe.give)
    return 0.5 * jnp.sum(probe.area * sum(d * d for d in drag)) / spring

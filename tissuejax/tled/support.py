"""What the support does to the fixed nodes: prescribed motion, and slip over a bedding that gives way.

Held components follow u = pattern * displacement(t) + slip. The slip (tangential: x and y) answers the pull of the
tissue: an elastic part, a node of its own mass on a spring of area / compliance taken implicitly (stable from bonded to
free, and as quick as the tissue itself), and a viscous part that creeps at fluidity * traction. Both are zero at their
neutral value: the bonded support to the last bit.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from tissuejax.tled.scene import Scene, filled


class Hold(NamedTuple):
    """Held components, (3, N) True where held, and the pattern of the motion, (3, N); area and stiffness (F,)."""

    held: Bool[Array, "3 N"]
    pattern: Float[Array, "3 N"]
    area: Float[Array, " F"] | None
    pull: Float[Array, " F"] | None


class Slip(NamedTuple):
    """Slip of the fixed nodes, (2, F): elastic and viscous; None where the scene has none. `speed` of the elastic."""

    elastic: Float[Array, "2 F"] | None
    viscous: Float[Array, "2 F"] | None
    speed: Float[Array, "2 F"] | None = None


def hold(scene: Scene, stiffness: Float[Array, " N"] | None) -> Hold:
    """Dense masks from the scene's node lists; `stiffness` of the nodes (N/m) is needed with a bedding only."""
    body, support = scene.body, scene.support
    zero = jnp.zeros_like(body.points.T)
    held = zero.at[:, body.fixed].set(body.held.T) > 0
    pattern = jnp.ones_like(body.held) if support.pattern is None else support.pattern
    pattern = zero.at[:, body.fixed].set(pattern.T)
    if not slips(scene):
        return Hold(held, pattern, None, None)
    return Hold(held, pattern, footprint(scene), filled(stiffness)[body.fixed])


def slips(scene: Scene) -> bool:
    """Whether the support has a bedding."""
    return scene.support.compliance is not None or scene.support.fluidity is not None


def footprint(scene: Scene) -> Float[Array, " F"]:
    """Area of the support that each fixed node stands for, m^2: a share of the facets all of whose nodes are fixed."""
    body = scene.body
    fixed = jnp.zeros_like(body.points[:, 0]).at[body.fixed].set(1.0)
    x = body.points[body.facets]
    diagonals = (x[:, 2] - x[:, 0], x[:, -1] - x[:, 1])
    area = 0.5 * jnp.linalg.norm(jnp.cross(*diagonals), axis=-1)
    share = area * jnp.prod(fixed[body.facets], axis=1) / body.facets.shape[1]
    nodal = jnp.zeros_like(body.points[:, 0]).at[body.facets].add(share[:, None])
    return nodal[body.fixed]


def bonded(scene: Scene) -> Slip:
    """No slip yet."""
    support, zero = scene.support, jnp.zeros_like(scene.body.held.T[:2])
    gives = None if support.compliance is None else zero
    return Slip(gives, None if support.fluidity is None else zero, gives)


def slide(
    scene: Scene, hold: Hold, slip: Slip, f: Float[Array, "3 N"], moving: Float[Array, "3 N"], mass: Float[Array, " N"]
) -> Slip:
    """Slip one step later; `mass` of the nodes, kg.

    Elastic, with spring k = area / c, step h and mass damping a: v <- (c ((1 - a h/2) m v + h f) - h area s) /
    (c (1 + a h/2) m + h^2 area), s <- s + h v; at c = 0 nothing moves.

    Args:
        f: net internal and external force on the tissue, N: what creeps follows it.
        moving: the same with what makes up for the body's inertia (`glide`): what has mass follows that.
    """
    support, clock = scene.support, scene.clock
    h, half = clock.step, 0.5 * scene.settings.mass_damping * clock.step
    whole = filled(hold.area)
    bare = whole <= 0
    area = jnp.where(bare, 1.0, whole)
    elastic, viscous, speed = slip
    if elastic is not None:
        m, c = mass[scene.body.fixed], filled(support.compliance)
        push = c * ((1.0 - half) * m * filled(speed) + h * moving[:2, scene.body.fixed]) - h * area * elastic
        speed = jnp.where(bare, 0.0, push / (c * (1.0 + half) * m + h * h * area))
        elastic = elastic + h * speed
    if viscous is not None:
        traction = jnp.where(bare, 0.0, f[:2, scene.body.fixed] / area)
        stiffness = filled(hold.pull) / area  # Pa/m, an upper estimate: what the tissue gives back per slip
        creep = filled(support.fluidity) * h * clock.compression
        viscous = viscous + creep * traction / (1.0 + creep * stiffness)
    return Slip(elastic, viscous, speed)


def target(scene: Scene, hold: Hold, slip: Slip, motion: Float[Array, " 3"] | None) -> Float[Array, "3 N"]:
    """Prescribed displacement of the held components, (3, N)."""
    u = jnp.zeros_like(hold.pattern) if motion is None else hold.pattern * motion[:, None]
    for part in (slip.elastic, slip.viscous):
        if part is not None:
            u = u.at[:2, scene.body.fixed].add(part, mode="promise_in_bounds")
    return u

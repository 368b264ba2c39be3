"""The slide of the whole body over a bedding that gives way, kept from lagging in a run faster than life.

On a soft bedding the slowest motion is the body's own slide in the plane (two translations and a turn): a mass M on a
spring A / c, far slower than anything inside the tissue. Played f times faster than life its inertia counts f^2
times, and the body would trail behind the probe. So the mass of these three modes alone is divided by s (selective
mass scaling: Olovsson, Simonsson & Unosson, Int. J. Numer. Meth. Engng 63, 2005): by as much as makes the slide as
quick as the first shear mode, 2 a (a the mass damping), and at most by f^2, which leaves the inertia that it has in
life. A bedding that is stiffer than that, and a run at the speed of life, have s = 1: nothing is added, to the last
bit.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.tled.scene import Scene, filled


class Glide(NamedTuple):
    """Rigid motions in the plane, (3, 2, N), with `inertia` (3,) kg (kg m^2), and by how much their mobility grows."""

    modes: Float[Array, "3 2 N"]
    inertia: Float[Array, " 3"]
    extra: Float[Array, ""]


def glide(scene: Scene, mass: Float[Array, " N"], area: Float[Array, " F"]) -> Glide:
    """The modes of a scene with an elastic bedding; `area` of the fixed nodes as in `support.footprint`."""
    x, y = (p - jnp.sum(mass * p) / jnp.sum(mass) for p in (scene.body.points[:, 0], scene.body.points[:, 1]))
    one, zero = jnp.ones_like(x), jnp.zeros_like(x)
    modes = jnp.stack([jnp.stack([one, zero]), jnp.stack([zero, one]), jnp.stack([-y, x])])
    inertia = jnp.sum(mass * modes**2, axis=(1, 2))
    first = 2 * scene.settings.mass_damping
    s = first**2 * filled(scene.support.compliance) * jnp.sum(mass) / jnp.sum(area)
    return Glide(modes, inertia, jnp.clip(s, 1.0, scene.clock.compression**2) - 1.0)


def spurred(
    scene: Scene,
    glide: Glide,
    f: Float[Array, "3 N"],
    elastic: Float[Array, "2 F"],
    area: Float[Array, " F"],
    mass: Float[Array, " N"],
) -> Float[Array, "3 N"]:
    """f (N) with what the lighter rigid modes are moved by in addition: mass times their extra acceleration.

    Args:
        f: net internal and external force on the nodes.
        elastic: slip of the fixed nodes on the bedding's springs, m; these pull back with area / compliance.
    """
    c = filled(scene.support.compliance)
    back = jnp.where(c > 0, area * elastic / jnp.where(c > 0, c, 1.0), 0.0)
    net = f[:2].at[:, scene.body.fixed].add(-back, mode="promise_in_bounds")
    push = glide.extra * jnp.einsum("kcn,cn->k", glide.modes, net) / glide.inertia
    return f.at[:2].add(mass * jnp.einsum("k,kcn->cn", push, glide.modes))

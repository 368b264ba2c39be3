"""Friction and adhesion of the ball on top of a surrogate's force.

Friction: one tangential spring between ball and tissue that slides at a limit. Its stiffness is the tissue's own
against a sideways pull, 2 (1 - nu) / (2 - nu) = 2/3 of the normal one (Mindlin 1949, incompressible), in series with
what `give` says. Its limit is that of steady sliding, in which the hand's power is what friction takes: tissue passes a
point of contact as much faster than the ball moves as its surface is stretched there, so

    limit = mu sum_i f_i |F_i e| = mu N slip(d),    slip(d) = 1 + q (c_1 + q (c_2 + q c_3)),   q = d / D,

f_i the contact forces normal to the ball, N their vertical sum and F_i e the deformed surface along the way; the three
numbers are fitted to the equilibria that are tabulated (`ramp.slip`). When the spring stiffens it keeps its force, when
it softens its length: it never gains energy.

Adhesion: bonds over the ring that has been touched pull back, sigma (g / reach) exp(1 - g / reach) at gap g. Around a
ball (Derjaguin 1934) the ring sums up to 2 pi R times the integral of that over the gaps present, from the smallest
to half of what the ball has been lifted since its deepest; bonds are gone five reaches away. That is the sum over a
surface that stays where it is. Soft tissue follows the ball in a neck, and the pull at which it lets go falls from
2 pi w R to 1.5 pi w R (w = e sigma reach, the work of separation). Between the two `neck` takes the share that Carpick,
Ogletree and Salmeron (1999, J. Colloid Interface Sci. 211, 395) fitted to Maugis's equations (1992, 150, 243), which it
meets to 1.7 % for any modulus (a test solves them); sigma is the greatest stress of a bond.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

MINDLIN = 2 / 3
BREAK = 5.0  # gap over reach at which a bond is gone, as in `tled/contact.py`


class Rub(eqx.Module):
    """Coulomb coefficient, give (m/Pa) and c_1 to c_3 (`slip`); strength (Pa) and reach (m) of adhesion; zero: none.
    `modulus`, Pa: E / (1 - nu^2) of the tissue at rest, by which it follows in a neck; zero: it does not."""

    friction: Float[Array, ""]
    give: Float[Array, ""]
    strength: Float[Array, ""]
    reach: Float[Array, ""]
    slip: Float[Array, "3"]
    modulus: Float[Array, ""]


class Grip(NamedTuple):
    """Stretch of the tangential spring, m, its stiffness, N/m, where the ball was, m; the deepest since it last let
    go, m (minus one where nothing is bonded)."""

    stretch: Float[Array, "2"]
    stiffness: Float[Array, ""]
    at: Float[Array, "2"]
    deepest: Float[Array, ""]


def start(at: Float[Array, "2"]) -> Grip:
    """Untouched, the ball above `at`."""
    return Grip(jnp.zeros(2), jnp.zeros(()), jnp.asarray(at), -jnp.ones(()))


def pull(gap: Float[Array, ""], reach: Float[Array, ""]) -> Float[Array, ""]:
    """Integral of (g / reach) exp(1 - g / reach) from 0 to gap, m."""
    g = jnp.clip(gap / reach, 0.0, BREAK)
    return reach * (jnp.e - (1 + g) * jnp.exp(1 - g))


def neck(rub: Rub, radius, factor):
    """Share of the pull of a rigid surface that is left to a soft one, 1 to 3/4; of numbers or arrays.

    (7 - (4.04 l^1.4 - 1) / (4.04 l^1.4 + 1)) / 8 with l = 2 sigma (R / (pi w K^2))^(1/3), K = 4/3 of the modulus.

    Args:
        radius: of the ball, m. factor: on the tissue's modulus.
    """
    work = np.e * rub.strength * rub.reach
    soft = (rub.strength > 0) & (rub.modulus > 0)
    square = jnp.where(soft, np.pi * work * (4 / 3 * factor * rub.modulus) ** 2, 1.0)
    power = 4.04 * (2 * jnp.where(soft, rub.strength, 1.0) * jnp.cbrt(radius / square)) ** 1.4
    return jnp.where(soft, (7 - (power - 1) / (power + 1)) / 8, 1.0)


def slipping(slip: Float[Array, "3"], q: Float[Array, ""]) -> Float[Array, ""]:
    """slip(d) at q = d / D."""
    return 1 + q * (slip[0] + q * (slip[1] + q * slip[2]))


def tick(rub: Rub, grip: Grip, at, depth, normal, stiffness, radius, most, factor) -> tuple[Float[Array, "3"], Grip]:
    """Force of friction and adhesion on the ball, N, and the memory; `most` is the depth of the tables, m, `factor` on
    the tissue's modulus."""
    touching = depth > 0
    deepest = jnp.where(touching, jnp.maximum(grip.deepest, depth), grip.deepest)
    near = jnp.maximum(-depth, 0.0)
    far = jnp.where(deepest >= 0, near + jnp.maximum(deepest - jnp.maximum(depth, 0.0), 0.0) / 2, near)
    bonds = jnp.where(deepest >= 0, pull(far, rub.reach) - pull(near, rub.reach), 0.0)
    adhesion = -2 * jnp.pi * radius * rub.strength * neck(rub, radius, factor) * bonds
    deepest = jnp.where(near > BREAK * rub.reach, -1.0, deepest)

    area = jnp.pi * radius * jnp.maximum(depth, 1e-9)
    k = MINDLIN * stiffness
    k = k / (1 + k * rub.give / area)
    keep = jnp.where(k > grip.stiffness, grip.stiffness / jnp.where(k > 0, k, 1.0), 1.0)
    stretch = grip.stretch * keep + at - grip.at
    length = jnp.sqrt(jnp.sum(stretch**2) + 1e-30)
    limit = rub.friction * jnp.maximum(normal, 0.0) * slipping(rub.slip, jnp.clip(depth / most, 0.0, 1.0))
    slid = jnp.minimum(1.0, limit / jnp.maximum(k * length, 1e-30))
    stretch = jnp.where(touching & (k > 0), slid * stretch, 0.0)
    force = jnp.append(-k * stretch, adhesion)
    return force, Grip(stretch, k, at, deepest)

"""What all laws share: memory, unloading to the origin, closing, and what is stored and lost.

A point of a face remembers its secant stiffness k, which only ever falls: k <- min(k, T(d)/d), d the effective opening
(<d_n>^2 + d_s^2)^1/2. The traction is k times the opening, so unloading goes to the origin; a closing gap is held by a
stiffness that is never damaged. Stored is k d^2 / 2, and what is lost in a step is -d^2 dk / 2 >= 0, whatever path
opening and sliding take. Over a step from d_a to d_b that is d_a d_b (k_a - k_b) / 2, exact for the straight branches.
Neutral: an infinite energy never softens; the face stays an elastic layer of stiffness K.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.cohesion.law import Law
from tissuejax.cohesion.mixity import mixed
from tissuejax.parameters import Constants

Vector = tuple[Float[Either, "..."], Float[Either, "..."], Float[Either, "..."]]


class Memory(NamedTuple):
    """Secant stiffness now (Pa/m) and the opening at which it was last lowered (m), at each point."""

    secant: Float[Either, "q P"]
    reached: Float[Either, "q P"]


class Pull(NamedTuple):
    """Traction of the minus on the plus side (three arrays, Pa), memory, and energy lost in this step, J/m^2."""

    traction: Vector
    memory: Memory
    lost: Float[Either, "q P"]


def whole(law: Law, p: Constants, K: Float[Either, "..."], like: Float[Either, "q P"]) -> Memory:
    """Memory of faces that have never been opened."""
    one = jnp.ones_like(like)
    return Memory(one * _unbroken(law, p, K), 0.0 * one)


def _unbroken(law, p, K):
    endless = jnp.isinf(p["energy"])
    tame = {**p, "energy": jnp.where(endless, 1.0, p["energy"])}
    return jnp.where(endless, K, law.initial(tame, K))


def pull(
    law: Law,
    p: Constants,
    K: Float[Either, "..."],
    contact: Float[Either, "..."],
    gap: Vector,
    normal: Vector,
    memory: Memory,
) -> Pull:
    """One step of every point.

    Args:
        p: strength, energy, shape and ratios; scalars or one a face.
        K: stiffness of unbroken faces, Pa/m. contact: of closing gaps, Pa/m.
        gap: displacement of the plus side against the minus side, m. normal: unit, from minus to plus.
    """
    across = sum(g * n for g, n in zip(gap, normal, strict=True))
    shut = jnp.minimum(across, 0.0)
    free = tuple(g - shut * n for g, n in zip(gap, normal, strict=True))
    square = sum(g * g for g in free)
    some = square > 0
    opening = jnp.where(some, jnp.sqrt(jnp.where(some, square, 1.0)), 0.0)
    opened = across - shut
    sliding = jnp.where(some, jnp.clip(1 - opened**2 / jnp.where(some, square, 1.0), 0.0, 1.0), 0.0)
    endless = jnp.isinf(p["energy"])
    strength, energy = mixed({**p, "energy": jnp.where(endless, 1.0, p["energy"])}, sliding)
    now = {**p, "strength": strength, "energy": energy}
    envelope = jnp.where(endless, K, law.secant(now, K, opening))
    lowered = envelope < memory.secant
    secant = jnp.minimum(memory.secant, envelope)
    last = law.end(now, K)
    before, after = jnp.maximum(memory.reached, law.onset(now, K)), jnp.minimum(opening, last)
    lost = jnp.where(lowered, 0.5 * before * after * (memory.secant - secant), 0.0)
    reached = jnp.where(lowered, opening, memory.reached)
    x, y, z = (-(secant * f + contact * shut * n) for f, n in zip(free, normal, strict=True))
    return Pull((x, y, z), Memory(secant, reached), lost)


def stored(
    secant: Float[Either, "..."], contact: Float[Either, "..."], gap: Vector, normal: Vector
) -> Float[Either, "..."]:
    """Energy stored in the pull and in closing gaps, J/m^2."""
    across = sum(g * n for g, n in zip(gap, normal, strict=True))
    shut = jnp.minimum(across, 0.0)
    square = sum(g * g for g in gap) - shut**2
    return 0.5 * secant * square + 0.5 * contact * shut**2

"""Functions of energies that end somewhere, continued so that no value and no gradient is ever NaN or infinite.

An optimiser or a time step may ask beyond the valid range. There -ln(m) and exp(x) are continued by their quadratic at
the limit, twice continuously differentiable: a steep, finite wall that leads back. `Energy.margin` says which side a
strain is on, and `validity.py` refuses a concrete input beyond it.
"""

import jax.numpy as jnp
from jaxtyping import Float

from tissuejax.arrays import Either

LIMIT = 1e-3  # of the distance to the singularity, 1 at rest: below it the formula gives way to its continuation
LARGEST_EXPONENT = 50.0  # exp(50) = 5e21, beyond any tissue and well inside float32 with two derivatives


def minus_log(m: Float[Either, "..."]) -> Float[Either, "..."]:
    """-ln(m) for m >= LIMIT, below that its Taylor quadratic at LIMIT."""
    inside = m >= LIMIT
    x = (m - LIMIT) / LIMIT
    return jnp.where(inside, -jnp.log(jnp.where(inside, m, 1.0)), -jnp.log(LIMIT) - x + 0.5 * x * x)


def expm1(x: Float[Either, "..."]) -> Float[Either, "..."]:
    """exp(x) - 1 for x <= LARGEST_EXPONENT, above that its Taylor quadratic there."""
    inside = x <= LARGEST_EXPONENT
    over = x - LARGEST_EXPONENT
    top = jnp.exp(LARGEST_EXPONENT)
    return jnp.where(inside, jnp.expm1(jnp.where(inside, x, 0.0)), top * (1 + over + 0.5 * over * over) - 1)

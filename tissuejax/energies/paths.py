"""The homogeneous, incompressible ways to stretch a block along its axes, one stretch each."""

from collections.abc import Callable

import jax.numpy as jnp
from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.strain import Strain
from tissuejax.errors import unknown
from tissuejax.tensors import Sym

# The second principal stretch for a first one of l; the third follows from l1 l2 l3 = 1.
SECOND: dict[str, Callable[[Either], Either]] = {
    "uniaxial": lambda l: l**-0.5,
    "planar": lambda l: l**0.0,
    "equibiaxial": lambda l: l,
}


def along(path: str, stretch: Float[Either, "..."]) -> Strain:
    """The strain at `stretch` (ratio, 1 at rest) along "uniaxial", "planar" or "equibiaxial".

    Raises:
        InputError: an unknown path.
    """
    if path not in SECOND:
        raise unknown("path", path, SECOND)
    stretch = jnp.asarray(stretch)
    return principal(stretch, SECOND[path](stretch))


def principal(l1: Float[Either, "..."], l2: Float[Either, "..."]) -> Strain:
    """The incompressible strain with principal stretches l1, l2, 1/(l1 l2) along axes 1, 2, 3."""
    zero = jnp.zeros_like(l1)
    return Strain(Sym(l1**2, l2**2, (l1 * l2) ** -2, zero, zero, zero), jnp.ones_like(l1))

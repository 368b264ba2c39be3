"""A cheap contact law for probing where no body was recorded: a ball on a bonded incompressible layer.

Hertz' force times the correction for a layer of thickness h bonded to a rigid base (Dimitriadis et al. 2002, Biophys.
J. 82, eq. 12, Poisson's ratio 1/2), times an exponential stiffening with the mean strain 0.2 a / R under the ball:

    F = 16/9 E sqrt(R) d^(3/2) (1 + 1.133 x + 1.283 x^2 + 0.769 x^3 + 0.0975 x^4) exp(b 0.2 a / R),

x = sqrt(R d) / h, a = sqrt(R d). Good for d up to about R / 2 and x up to 1; it knows no shape and no neighbour.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

BONDED = (1.133, 1.283, 0.769, 0.0975)
TABOR = 0.2  # mean strain under a ball over a / R


def force(
    depth: Float[Array, "..."],
    radius: float,
    modulus: Float[Array, "..."],
    thickness: Float[Array, "..."],
    stiffening: Float[Array, "..."] | float = 0.0,
) -> Float[Array, "..."]:
    """Force on the ball, N; zero out of contact.

    Args:
        depth: of the ball below first touch, m.
        radius: of the ball, m.
        modulus: Young's modulus at rest, Pa (three times the shear modulus).
        thickness: of the layer, m; infinity is Hertz.
        stiffening: b, 0 for a linear material.
    """
    touching = depth > 0
    d = jnp.where(touching, depth, 1e-12)
    contact = jnp.sqrt(radius * d)
    x = contact / thickness
    layer = 1.0 + x * (BONDED[0] + x * (BONDED[1] + x * (BONDED[2] + x * BONDED[3])))
    hertz = 16 / 9 * modulus * jnp.sqrt(radius) * d**1.5
    return jnp.where(touching, hertz * layer * jnp.exp(stiffening * TABOR * contact / radius), 0.0)

"""Laws that are not split into shape and volume, as other programs write them: what is added to a split one.

A scene's `tissue.added` takes any energy of the whole strain. Bonet and Wood's neo-Hookean law,

    psi = mu/2 (tr C - 3) - mu ln J + lambda/2 ln(J)^2,

is `NeoHookean` with mu, `Logarithmic` with K = lambda, and `Unsplit(mu)`; its bulk modulus at rest is lambda + 2/3 mu.

    scene = scene.put({"tissue.added": (Unsplit(jnp.asarray(600.0)),)})

Source: Bonet and Wood 2008, Nonlinear Continuum Mechanics for Finite Element Analysis, eq. 6.27.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.strain import Strain
from tissuejax.tensors import trace


class Unsplit(eqx.Module):
    """mu/2 (tr C - I1bar) - mu ln J, Pa: takes mu/2 (I1bar - 3) to mu/2 (tr C - 3) - mu ln J; neutral mu = 0."""

    mu: Float[Either, ""]

    def __call__(self, strain: Strain) -> Float[Either, "..."]:
        """Energy per stress-free volume, Pa; zero with zero slope at rest."""
        return self.mu * (0.5 * (trace(strain.C) - strain.I1) - jnp.log(strain.J))

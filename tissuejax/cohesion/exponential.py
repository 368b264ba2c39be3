"""Exponential: smooth from the first opening on, with a long tail."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.cohesion.law import Law
from tissuejax.parameters import Constants

TAIL = 6.638352  # (1 + x) exp(-x) = 0.01: by then 99 % of the energy is spent


class Exponential(Law):
    """T = tau (d / d0) exp(1 - d / d0), d0 = G / (e tau); greatest at d0, area G.

    Its own initial stiffness e tau / d0 = e^2 tau^2 / G takes the place of the mesh's. Unloading goes to the origin
    from every opening, so a little is lost on the way up too.
    """

    name: ClassVar[str] = "exponential"
    formula: ClassVar[str] = "tau (d/d0) exp(1 - d/d0), d0 = G / (e tau)"
    source: ClassVar[str] = "Lister 2012, fig. 3.2; Xu & Needleman 1993, Modelling Simul. Mater. Sci. Eng. 1"

    def initial(self, p: Constants, K: Float[Either, "..."]) -> Float[Either, "..."]:
        return self.secant(p, K, jnp.zeros_like(K))

    def onset(self, p: Constants, K: Float[Either, "..."]) -> Float[Either, "..."]:
        return 0.0 * self._peak(p)

    def end(self, p: Constants, K: Float[Either, "..."]) -> Float[Either, "..."]:
        return TAIL * self._peak(p)

    def secant(self, p: Constants, K: Float[Either, "..."], opening: Float[Either, "..."]) -> Float[Either, "..."]:
        peak = self._peak(p)
        return p["strength"] / peak * jnp.exp(1 - opening / peak)

    def work(self, p: Constants, K: Float[Either, "..."], opening: Float[Either, "..."]) -> Float[Either, "..."]:
        x = opening / self._peak(p)
        return p["energy"] * (1 - (1 + x) * jnp.exp(-x))

    def _peak(self, p):
        return p["energy"] / (jnp.e * p["strength"])

"""Bilinear: straight up to the strength, straight down to nothing."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.cohesion.law import Law
from tissuejax.parameters import Constants


class Bilinear(Law):
    """T = K d up to d0 = tau / K, then tau (d1 - d) / (d1 - d0), d1 = 2 G / tau.

    Needs d0 < d1, that is K > tau^2 / (2 G).
    """

    name: ClassVar[str] = "bilinear"
    formula: ClassVar[str] = "K d to tau, then straight to 0 at 2 G / tau"
    source: ClassVar[str] = "Lister 2012, fig. 3.2; Camanho & Davila 2002, NASA/TM-2002-211737"

    def initial(self, p: Constants, K: Float[Either, "..."]) -> Float[Either, "..."]:
        return K

    def onset(self, p: Constants, K: Float[Either, "..."]) -> Float[Either, "..."]:
        return p["strength"] / K

    def end(self, p: Constants, K: Float[Either, "..."]) -> Float[Either, "..."]:
        return 2 * p["energy"] / p["strength"]

    def secant(self, p: Constants, K: Float[Either, "..."], opening: Float[Either, "..."]) -> Float[Either, "..."]:
        first, last = self.onset(p, K), self.end(p, K)
        beyond = jnp.maximum(opening, first)
        falling = p["strength"] * jnp.maximum(last - beyond, 0.0) / ((last - first) * beyond)
        return jnp.where(opening <= first, K, falling)

    def work(self, p: Constants, K: Float[Either, "..."], opening: Float[Either, "..."]) -> Float[Either, "..."]:
        first, last = self.onset(p, K), self.end(p, K)
        left = jnp.clip(last - opening, 0.0, last - first)
        return jnp.where(
            opening <= first, 0.5 * K * opening**2, p["energy"] - 0.5 * p["strength"] * left**2 / (last - first)
        )

"""Bilinear: straight up to the strength, straight down to nothing."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.cohesion.law import Law


class Bilinear(Law):
    """T = K d up to d0 = tau / K, then tau (d1 - d) / (d1 - d0), d1 = 2 G / tau.

    Needs d0 < d1, that is K > tau^2 / (2 G).
    """

    name: ClassVar[str] = "bilinear"
    formula: ClassVar[str] = "K d to tau, then straight to 0 at 2 G / tau"
    source: ClassVar[str] = "Lister 2012, fig. 3.2; Camanho & Davila 2002, NASA/TM-2002-211737"

    def initial(self, p: Mapping[str, Array], K: Float[Array, "..."]) -> Float[Array, "..."]:
        return K

    def onset(self, p: Mapping[str, Array], K: Float[Array, "..."]) -> Float[Array, "..."]:
        return p["strength"] / K

    def end(self, p: Mapping[str, Array], K: Float[Array, "..."]) -> Float[Array, "..."]:
        return 2 * p["energy"] / p["strength"]

    def secant(
        self, p: Mapping[str, Array], K: Float[Array, "..."], opening: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        first, last = self.onset(p, K), self.end(p, K)
        beyond = jnp.maximum(opening, first)
        falling = p["strength"] * jnp.maximum(last - beyond, 0.0) / ((last - first) * beyond)
        return jnp.where(opening <= first, K, falling)

    def work(self, p: Mapping[str, Array], K: Float[Array, "..."], opening: Float[Array, "..."]) -> Float[Array, "..."]:
        first, last = self.onset(p, K), self.end(p, K)
        left = jnp.clip(last - opening, 0.0, last - first)
        return jnp.where(
            opening <= first, 0.5 * K * opening**2, p["energy"] - 0.5 * p["strength"] * left**2 / (last - first)
        )

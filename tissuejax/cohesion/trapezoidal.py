"""Trapezoidal: the strength is held over a plateau before it falls, as in tissue that yields."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.cohesion.law import Law
from tissuejax.parameters import Constants


class Trapezoidal(Law):
    """T = K d up to d0 = tau / K, tau up to s d1, then straight to 0 at d1 = (2 G / tau + d0) / (1 + s).

    s is the shape: where the plateau ends, as a share of d1 (0 with d0 = 0 would be bilinear, near 1 is a block).
    """

    name: ClassVar[str] = "trapezoidal"
    formula: ClassVar[str] = "K d to tau, tau to s d1, then straight to 0 at d1"
    source: ClassVar[str] = "Lister 2012, fig. 3.2; Tvergaard & Hutchinson 1992, J. Mech. Phys. Solids 40"
    shaped: ClassVar[tuple[str, float] | None] = ("where the plateau ends, over the opening at the end", 0.5)

    def initial(self, p: Constants, K: Float[Either, "..."]) -> Float[Either, "..."]:
        return K

    def onset(self, p: Constants, K: Float[Either, "..."]) -> Float[Either, "..."]:
        return p["strength"] / K

    def end(self, p: Constants, K: Float[Either, "..."]) -> Float[Either, "..."]:
        return (2 * p["energy"] / p["strength"] + self.onset(p, K)) / (1 + p["shape"])

    def secant(self, p: Constants, K: Float[Either, "..."], opening: Float[Either, "..."]) -> Float[Either, "..."]:
        first, last = self.onset(p, K), self.end(p, K)
        beyond = jnp.maximum(opening, first)
        fall = jnp.clip((last - beyond) / (last * (1 - p["shape"])), 0.0, 1.0)
        return jnp.where(opening <= first, K, p["strength"] * fall / beyond)

    def work(self, p: Constants, K: Float[Either, "..."], opening: Float[Either, "..."]) -> Float[Either, "..."]:
        first, last = self.onset(p, K), self.end(p, K)
        turn = p["shape"] * last
        left = jnp.clip(last - opening, 0.0, last - turn)
        plateau = p["strength"] * (opening - 0.5 * first)
        falling = p["energy"] - 0.5 * p["strength"] * left**2 / (last - turn)
        return jnp.where(opening <= first, 0.5 * K * opening**2, jnp.where(opening <= turn, plateau, falling))

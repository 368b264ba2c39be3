"""Materials with a memory: Prony relaxation of the isochoric stress, and softening by the greatest energy so far.

Both are written so that the neutral value changes nothing to the last bit: S = S0 - sum_i g_i q_i with
dq_i/dt = (S0 - q_i)/tau_i, which is the usual hereditary integral with the instantaneous stress S0 (Lister 2012 has
none; Holzapfel 2000, 6.10; Simo 1987), and S = (1 - d) S0 with d = amount (1 - exp(-max psi / scale)) (Simo 1987).
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


class Prony(eqx.Module):
    """Relative moduli g_i (their sum below 1) and relaxation times tau_i in s of the isochoric stress."""

    g: Float[Array, " m"]
    tau: Float[Array, " m"]


class Damage(eqx.Module):
    """Softening: the isochoric stress loses up to `amount` (below 1) as the greatest energy passes `scale`, Pa.

    With `recoverable` r it also loses, below the greatest energy, r erf((greatest - psi) / (scale + growth greatest)),
    the pseudo-elastic law of Ogden & Roxburgh 1999, eq. 5.1.
    """

    amount: Float[Array, ""]
    scale: Float[Array, ""]
    recoverable: Float[Array, ""] | None = None
    growth: Float[Array, ""] | float = 0.0

    def loss(self, greatest: Float[Array, " E"], psi: Float[Array, " E"]) -> Float[Array, " E"]:
        """d, from the greatest energy so far and the energy now, Pa; exactly 0 at neutral."""
        lost = self.amount * (1.0 - jnp.exp(-greatest / self.scale))
        if self.recoverable is None:
            return lost
        below = jax.scipy.special.erf((greatest - psi) / (self.scale + self.growth * greatest))
        return lost + self.recoverable * below * (1.0 - lost)


def relax(prony: Prony, q: list, instant: tuple, step: Float[Array, ""]) -> tuple[list, tuple]:
    """One step of every Prony term, q <- q + (1 - exp(-h/tau)) (S0 - q); the new q and the stress gone, sum_i g_i q_i.

    Args:
        q: for each term, six arrays (E,), the part of the stress that has relaxed.
        instant: instantaneous isochoric stress S0, six arrays.
        step: h, on the clock on which `tau` is given.
    """
    gone, new = (0.0,) * 6, []
    for i, term in enumerate(q):
        share = -jnp.expm1(-step / prony.tau[i])
        term = tuple(old + share * (s - old) for old, s in zip(term, instant, strict=True))
        gone = tuple(g + prony.g[i] * t for g, t in zip(gone, term, strict=True))
        new.append(term)
    return new, gone

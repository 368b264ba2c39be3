"""What a strain energy may depend on: isochoric invariants, principal stretches and fibre stretch."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.tensors import Sym, determinant, trace, trace_of_square


class Strain(eqx.Module):
    """The deformation at a point (or at many), as an energy sees it.

    Isochoric quantities use the split F = J^(1/3) Fbar (Lister 2012, 4.3.2). Reference: Holzapfel 2000, ch. 6.

    Attributes:
        C: right Cauchy-Green tensor by components.
        J: volume ratio det F.
    """

    C: Sym
    J: Float[Array, "..."]

    @classmethod
    def of(cls, C: Sym) -> "Strain":
        """From C alone, J = sqrt(det C)."""
        return cls(C, jnp.sqrt(determinant(C)))

    @property
    def I1(self) -> Float[Array, "..."]:
        """Isochoric first invariant J^(-2/3) tr C; 3 at rest."""
        return self._power_of_J(-2 / 3) * trace(self.C)

    @property
    def I2(self) -> Float[Array, "..."]:
        """Isochoric second invariant J^(-4/3) (tr(C)^2 - tr(C^2)) / 2; 3 at rest."""
        return self._power_of_J(-4 / 3) * 0.5 * (trace(self.C) ** 2 - trace_of_square(self.C))

    def _power_of_J(self, exponent: float) -> Float[Array, "..."]:
        """J^exponent as exp(exponent ln J): its derivative reuses the exponential (cheap stress)."""
        return jnp.exp(exponent * jnp.log(self.J))

"""What a strain energy may depend on: isochoric invariants, principal stretches and fibre stretch."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Float

from tissuejax.arrays import Either, barrier
from tissuejax.spectral import power_sums
from tissuejax.tensors import Sym, determinant, trace, trace_of_square


@jax.custom_jvp
def whole(x: Float[Either, "..."]) -> Float[Either, "..."]:
    """x, whose derivatives are computed as a whole before anything is made of them.

    A stress has six components, and XLA on CPU would work out the derivatives of the invariants anew in each of them: a
    tangent of a simulation took half as long again. Effective in programs compiled as `tled.simulate` does; elsewhere
    it changes nothing.
    """
    return x


@whole.defjvp
def _whole_jvp(primals, tangents):
    return whole(primals[0]), barrier(tangents[0])  # `whole` again: for the derivatives of stress


class Strain(eqx.Module):
    """The deformation at a point (or at many), as an energy sees it.

    Isochoric quantities use the split F = J^(1/3) Fbar (Lister 2012, 4.3.2). Reference: Holzapfel 2000, ch. 6.

    Attributes:
        C: right Cauchy-Green tensor by components.
        J: volume ratio det F.
    """

    C: Sym
    J: Float[Either, "..."]

    @classmethod
    def of(cls, C: Sym) -> "Strain":
        """From C alone, J = sqrt(det C)."""
        return cls(C, whole(jnp.sqrt(whole(determinant(C)))))

    @property
    def I1(self) -> Float[Either, "..."]:
        """Isochoric first invariant J^(-2/3) tr C; 3 at rest."""
        return whole(self._power_of_J(-2 / 3) * whole(trace(self.C)))

    @property
    def I2(self) -> Float[Either, "..."]:
        """Isochoric second invariant J^(-4/3) (tr(C)^2 - tr(C^2)) / 2; 3 at rest."""
        return whole(self._power_of_J(-4 / 3) * 0.5 * whole(trace(self.C) ** 2 - trace_of_square(self.C)))

    def power_sums(self, alphas: tuple[Float[Either, ""], ...]) -> tuple[Float[Either, "..."], ...]:
        """sum_i lbar_i^alpha over the isochoric principal stretches, for each alpha; 3 at rest.

        Exact with its derivatives (to the third) where stretches are equal; see `spectral.py`.
        """
        log_J = jnp.log(self.J)
        return tuple(whole(jnp.exp(-alpha / 3 * log_J) * p) for alpha, p in zip(alphas, power_sums(self.C, alphas)))

    def fibre_stretch_squared(
        self, along_1: Float[Either, "..."], along_2: Float[Either, "..."]
    ) -> Float[Either, "..."]:
        """I4bar = a . Cbar a, the squared isochoric stretch along a = (along_1, along_2, 0), a unit vector."""
        C = self.C
        along = along_1**2 * C.xx + along_2**2 * C.yy + 2 * along_1 * along_2 * C.xy
        return whole(self._power_of_J(-2 / 3) * whole(along))

    def _power_of_J(self, exponent: float) -> Float[Either, "..."]:
        """J^exponent as exp(exponent ln J): its derivative reuses the exponential (cheap stress)."""
        return jnp.exp(exponent * jnp.log(self.J))

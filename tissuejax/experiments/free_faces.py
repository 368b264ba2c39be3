"""Free lateral faces of a specimen: how much it swells and which way it narrows.

An isotropic incompressible specimen needs no search. A compressible one has an unknown volume ratio (P33 = 0), one
with fibres an unknown ratio of its lateral stretches in a uniaxial test (P22 = 0 as well). Both come from a Newton root find
at every sample, whose derivative is implicit (optimistix), so that no iteration is differentiated. The faces follow the
elastic response: where stress relaxes, the lateral shape is that of the instantaneous energy, an error of the order of the
relaxed share times mu/K, or of the fibres' share of stiffness.
"""

from collections.abc import Callable, Mapping

import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Float

from tissuejax.effects.material_test import MaterialTest, Stress
from tissuejax.experiments.kinematics import deformation, hydrostatic, right_cauchy_green
from tissuejax.model import Model
from tissuejax.parameters import under
from tissuejax.tensors import Sym


def lateral(
    model: Model,
    values: Mapping[str, Array],
    test: MaterialTest,
    drive: Float[Array, "n ..."],
    isochoric: Callable[[Sym], Stress],
) -> tuple[Float[Array, " n"], Float[Array, " n"]]:
    """(ln J, skew) at every sample; see `kinematics.deformation`. NaN where no root was found.

    Args:
        model: volumetric energy or None; isotropic or not.
        values: parameter values by dotted path.
        test: what was done.
        drive: stretch or shear that the specimen saw.
        isochoric: elastic isochoric stress from C.
    """
    zero = jnp.zeros_like(test.time)
    if model.volumetric is None and model.isotropic:
        return zero, zero
    shear_modulus = model.energy.initial_shear_modulus(under("energy", values))
    p = under("volumetric", values)
    uniaxial = 2 * test.swell if test.mode == "extension" else jnp.zeros_like(test.swell)

    def residual(y: tuple[Array, Array], one: Array) -> tuple[Array, Array]:
        ln_J, skew = y
        F = deformation(test, one, ln_J, skew)
        S = isochoric(right_cauchy_green(F)).S
        if model.volumetric is None:
            third = ln_J
        else:
            J = jnp.exp(ln_J)
            slope = jax.grad(lambda j: model.volumetric.energy(p, j))(J)
            third = (J * slope - hydrostatic(S, F)) / model.volumetric.bulk_modulus(p)
        if model.isotropic:
            return third, skew
        across = (S.yy * F.b * F.b - S.zz * F.c * F.c) / shear_modulus
        return third, uniaxial * across + (1 - uniaxial) * skew

    def at(one: Array) -> tuple[Array, Array]:
        nothing = jnp.zeros((), test.time.dtype)
        solver = optx.Newton(rtol=1e-10, atol=1e-12)
        found = optx.root_find(residual, solver, (nothing, nothing), one, max_steps=64, throw=False)
        good = found.result == optx.RESULTS.successful
        return tuple(jnp.where(good, y, jnp.nan) for y in found.value)

    ln_J, skew = jax.vmap(at)(drive)
    return ln_J, _exact_zero(skew)


def _exact_zero(y: Array) -> Array:
    """Rounding-sized roots as exact zeros with their derivative kept, so that a neutral effect changes no bit."""
    return jnp.where(jnp.abs(y) < 1e-13, y - jax.lax.stop_gradient(y), y)

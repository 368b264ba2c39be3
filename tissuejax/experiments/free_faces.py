"""Free lateral faces of a specimen: how much it swells and which way it narrows.

An isotropic incompressible specimen needs no search. A compressible one has an unknown volume ratio (P33 = 0), one
with fibres an unknown ratio of its lateral stretches in a uniaxial test (P22 = 0 as well). Both come from a Newton
root find at every sample, whose derivative is implicit (optimistix), so that no iteration is differentiated. The
faces follow the elastic response: where stress relaxes, the lateral shape is that of the instantaneous energy, an
error of the order of the relaxed share times mu/K, or times the fibres' share of the stiffness.
"""

from collections.abc import Callable, Mapping

import jax
import jax.numpy as jnp
import lineax as lx
import optimistix as optx
from jaxtyping import Array, Float

from tissuejax.effects.material_test import MaterialTest, Stress
from tissuejax.experiments.kinematics import deformation, hydrostatic, right_cauchy_green
from tissuejax.model import Model
from tissuejax.parameters import under
from tissuejax.tensors import Sym

NODES = 49  # stretches at which lateral shapes are found first
STEPS = 60  # of Newton at most; two to six do
MET = 1e-7  # of the shear modulus: what the stress across may be before the last step
WIDEST = 2.0  # half the logarithm of the ratio of the lateral stretches: no specimen is narrowed so one-sidedly


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

    def second_face(ln_J: Array, skew: Array, drive: Array) -> Array:
        across = unlike(test, drive, ln_J, skew, isochoric) / shear_modulus
        return uniaxial * across + (1 - uniaxial) * skew

    volumetric = model.volumetric
    if volumetric is None:
        if test.mode != "extension":  # both in-plane stretches are driven
            return zero, zero
        return zero, _exact_zero(_along(lambda y, seen: second_face(jnp.zeros_like(seen), y, seen), drive))

    def third_face(ln_J: Array, skew: Array, drive: Array) -> Array:
        F = deformation(test, drive, ln_J, skew)
        J = jnp.exp(ln_J)
        slope = jax.grad(lambda j: jnp.sum(volumetric.energy(p, j)))(J)
        tau = hydrostatic(isochoric(right_cauchy_green(F)).S, F)
        return (J * slope - tau) / volumetric.bulk_modulus(p)

    if model.isotropic:
        return _each(lambda y: third_face(y, zero, drive), zero), zero

    def both(y: Array, one: Array) -> Array:
        return jnp.stack([third_face(y[0], y[1], one), second_face(y[0], y[1], one)])

    ln_J, skew = jax.vmap(lambda one: _root(lambda y: both(y, one), jnp.zeros(2, zero.dtype)), out_axes=1)(drive)
    return ln_J, _exact_zero(skew)


def unlike(
    test: MaterialTest, drive: Array, ln_J: Array, skew: Array, isochoric: Callable[[Sym], Stress]
) -> Float[Array, "..."]:
    """Kirchhoff stress of the second face less that of the third, Pa: none where both are free."""
    F = deformation(test, drive, ln_J, skew)
    S = isochoric(right_cauchy_green(F)).S
    return S.yy * F.b * F.b - S.zz * F.c * F.c


def _each(residual: Callable[[Array], Array], start: Float[Array, " n"]) -> Float[Array, " n"]:
    """Roots of n equations of one unknown each: the Jacobian is diagonal, so one derivative along ones is all of it."""
    return _root(residual, start, frozenset({lx.diagonal_tag}))


def _along(residual: Callable[[Array, Array], Array], drive: Float[Array, " n"]) -> Float[Array, " n"]:
    """Roots y of residual(y, drive), a function of the drive of the moment alone; NaN where none was found.

    Roots at a few drives, straight lines between them (error 1e-5), then Newton at all samples. Two rounds do, except
    where fibres begin or cease to bear load between two nodes: no straight line follows that, and a step may land on
    the wrong side. The derivative is that of the implicit function: dy = -(dresidual at y held) / slope.
    """
    few = jax.lax.stop_gradient(jnp.linspace(jnp.min(drive), jnp.max(drive), NODES))
    at_few, few_held = jax.closure_convert(residual, few, few)
    known = _still(lambda y: at_few(y, few, *jax.lax.stop_gradient(few_held)), jnp.zeros_like(few))
    near = jnp.interp(jax.lax.stop_gradient(drive), few, jnp.where(jnp.isfinite(known), known, 0.0))
    fixed, held = jax.closure_convert(residual, drive, drive)

    @jax.custom_jvp
    def roots(near: Array, at: Array, *held: Array) -> Array:
        return _still(lambda y: fixed(y, at, *held), near)

    @roots.defjvp
    def implicit(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
        (near, *others), (_, *moved) = primals, tangents
        y = roots(near, *others)
        _, moving = jax.jvp(lambda *others: fixed(y, *others), tuple(others), tuple(moved))
        _, slope = jax.jvp(lambda x: fixed(x, *others), (y,), (jnp.ones_like(y),))
        return y, -moving / slope

    return roots(near, drive, *held)


def _still(residual: Callable[[Array], Array], start: Float[Array, " m"]) -> Float[Array, " m"]:
    """Roots of m equations of one unknown each, of which no derivative can be taken; NaN where none was found.

    Newton inside a bracket, which is halved where a step would leave it: `residual` grows with its unknown (the wider
    a face is held, the harder it pulls).
    """

    def step(state: tuple) -> tuple:
        y, low, high, _, count = state
        r, slope = jax.jvp(residual, (y,), (jnp.ones_like(y),))
        low, high = jnp.where(r < 0, y, low), jnp.where(r < 0, high, y)
        new = y - r / slope
        return jnp.where((new >= low) & (new <= high), new, 0.5 * (low + high)), low, high, jnp.abs(r), count + 1

    def unsettled(state: tuple) -> Array:
        return jnp.any(~(state[3] < MET)) & (state[4] < STEPS)

    begin = (start, jnp.full_like(start, -WIDEST), jnp.full_like(start, WIDEST), jnp.full_like(start, jnp.inf), 0)
    y, _, _, r, _ = jax.lax.while_loop(unsettled, step, begin)
    return jnp.where(r < MET, y, jnp.nan)


def _root(residual: Callable[[Array], Array], start: Float[Array, " m"], tags: frozenset = frozenset()) -> Array:
    """Root of `residual`; entries that don't meet it are NaN."""
    solver = optx.Newton(rtol=1e-10, atol=1e-12)
    found = optx.root_find(lambda y, _: residual(y), solver, start, max_steps=64, throw=False, tags=tags)
    met = jnp.abs(residual(jax.lax.stop_gradient(found.value))) < 1e-7
    return jnp.where(met, found.value, jnp.nan)


def _exact_zero(y: Array) -> Array:
    """Rounding-sized roots as exact zeros with their derivative kept, so that a neutral effect changes no bit."""
    return jnp.where(jnp.abs(y) < 1e-13, y - jax.lax.stop_gradient(y), y)

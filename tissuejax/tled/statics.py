"""Static equilibrium by dynamic relaxation, with the implicit derivative.

The explicit machinery is run with fictitious masses, for which every element's critical step is about one, and with the
damping that is critical for the slowest mode, estimated as it goes by a Rayleigh quotient (Underwood 1983; Joldes,
Wittek & Miller 2009). The derivative does not go through the iterations: at the solution K du = -dr is solved by
conjugate gradients, forwards or in reverse, for any number of parameters. float32 stalls at a relative residual of
about 1e-4; statics wants float64.
"""

from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from tissuejax.errors import NotConverged
from tissuejax.tled import capsule, contact, internal, loads, stable, support, verdict
from tissuejax.tled.scene import Scene, filled
from tissuejax.tled.simulate import COMPILER_OPTIONS, series

CHECK = 25  # iterations between two looks at the residual
RAISES = 3  # how often a search that burst is begun again with twice the margin
FINEST = 1 / 64  # share of the load below which a step that finds no equilibrium is not halved any more


class Equilibrium(eqx.Module):
    """A static solution.

    Attributes:
        displacement: (N, 3), m, NaN where the search ended without an answer, or with an inverted element.
        residual: greatest unbalanced force over the greatest force present.
        iterations: of dynamic relaxation.
        force: of the tissue on the probe, N (zero without one).
        inverted: whether an element came out inside out.
    """

    displacement: Float[Array, "N 3"]
    residual: Float[Array, ""]
    iterations: Int[Array, ""]
    force: Float[Array, " 3"]
    inverted: Array


class Load(NamedTuple):
    """The reference quantities of a static problem, worked out once."""

    scene: Scene
    mesh: internal.Mesh
    skin: capsule.Skin | None
    patch: contact.Patch | None
    centre: Float[Array, " 3"] | None
    held: Array
    target: Float[Array, "3 N"]
    diagonal: Float[Array, " N"]
    factor: Float[Array, ""] | None = None


def load(scene: Scene, time: float = 0.0) -> Load:
    """Reference quantities for the loads at real time `time`: probe and support where they are then."""
    mesh = internal.mesh(scene)
    hold = support.hold(scene.put({"support.compliance": None, "support.fluidity": None}), None)
    motion, patch, centre = None, None, None
    if scene.support.displacement is not None:
        motion = series(filled(scene.support.time), scene.support.displacement, jnp.asarray([time]))[0]
    diagonal = stable.nodal_stiffness(scene, mesh)
    if scene.probe is not None:
        probe = scene.probe
        scene = scene.put({"probe.friction": None, "probe.adhesion": None})
        centre = series(probe.time, probe.position, jnp.asarray([time]))[0]
        centre = centre if probe.offset is None else centre + probe.offset
        patch = contact.patch(scene)
        diagonal = diagonal + 4 * probe.mass / scene.clock.step**2  # the static mass is penalty * area * h^2 / 4
    if scene.tissue.capsule is not None:
        diagonal = diagonal.at[scene.body.facets].add(4 * scene.tissue.capsule)
    skin = None if scene.tissue.capsule is None else capsule.skin(scene.body)
    target = support.target(scene, hold, support.Slip(None, None), motion)
    factor = None
    if scene.loads is not None:
        factor = series(scene.loads.time, scene.loads.factor, jnp.asarray([time]))[0]
    return Load(scene, mesh, skin, patch, centre, hold.held, target, diagonal, factor)


def long_term(scene: Scene, mesh: internal.Mesh) -> internal.History:
    """An empty memory; with an infinite step every relaxation then ends at once."""
    tissue, zero = scene.tissue, jnp.zeros_like(mesh.stiffness)

    def empty(prony):
        return None if prony is None else [(zero,) * 6 for _ in range(len(prony.g))]

    return internal.History(empty(tissue.prony), None if tissue.damage is None else zero, empty(tissue.drain))


def pull(at: Load, u: Float[Array, "3 N"]) -> tuple[Float[Array, "3 N"], Float[Array, "3 N"]]:
    """Internal and external forces at displacement u, N."""
    scene = at.scene
    inner, _ = internal.forces(scene, at.mesh, u, long_term(scene, at.mesh), jnp.inf)
    if at.skin is not None:
        inner = inner + capsule.forces(at.skin, filled(scene.tissue.capsule), u)
    outer = jnp.zeros_like(u) if scene.gravity is None else scene.gravity[:, None] * at.mesh.mass
    if at.factor is not None:
        outer = outer + loads.forces(scene.loads, scene.body.points, u, at.factor)
    if at.patch is not None:
        outer = outer + _touch(at, at.patch, u).nodal
    return inner, outer


def _touch(at: Load, patch: contact.Patch, u: Float[Array, "3 N"]) -> contact.Touch:
    probe = at.scene.pressed
    return contact.forces(probe, patch, u, filled(at.centre), contact.untouched(probe))


def unbalanced(at: Load, w: Float[Array, "3 N"]) -> Float[Array, "3 N"]:
    """Residual in the unknowns w: internal minus external force where free, w itself where held."""
    inner, outer = pull(at, jnp.where(at.held, at.target, w))
    return jnp.where(at.held, w, inner - outer)


def relax(at: Load, start: Float[Array, "3 N"], tolerance: float, most: int, margin: float):
    """Dynamic relaxation from `start`; (w, (relative residual, iterations)).

    A search that bursts, or comes to rest with an element inside out, is begun again with twice the margin.
    """
    count = len(at.scene.body.cells)

    def bad(w, residual):
        J = internal.internal_energy(at.scene, at.mesh, jnp.where(at.held, at.target, w))[1][:count]
        return ~jnp.isfinite(residual) | ~jnp.all(J > 0)

    def again(carry):
        _, _, done, margin, _ = carry
        w, (residual, more) = _relax(at, start, tolerance, most, margin)
        return w, residual, done + more, 2.0 * margin, bad(w, residual)

    def going(carry):
        return carry[4] & (carry[3] < first * 2.0 ** (RAISES + 0.5))

    zero, first = jnp.asarray(0.0, start.dtype), jnp.asarray(margin, start.dtype)
    w, residual, done, _, _ = jax.lax.while_loop(going, again, (start, zero, zero, first, jnp.asarray(True)))
    return w, (residual, done)


def _relax(at: Load, start: Float[Array, "3 N"], tolerance: float, most: int, margin):
    mass = 0.25 * margin * at.diagonal
    free = ~at.held

    def one(_, state):
        u, v, r_old, omega2 = state
        inner, outer = pull(at, jnp.where(at.held, at.target, u))
        r = jnp.where(free, inner - outer, 0.0)
        moved = jnp.vdot(v, mass * v)
        guess = jnp.vdot(v, r - r_old) / jnp.where(moved > 0, moved, 1.0)
        omega2 = jnp.where((moved > 0) & (guess > 0), jnp.clip(guess, 1e-8, 1.0), omega2)
        c = 2 * jnp.sqrt(omega2)
        v = ((2 - c) * v - 2 * r / mass) / (2 + c)
        return u + v, v, r, omega2

    def many(carry):
        state, count, _ = carry
        state = jax.lax.fori_loop(0, CHECK, one, state)
        inner, outer = pull(at, jnp.where(at.held, at.target, state[0]))
        worst = jnp.max(jnp.abs(jnp.where(free, inner - outer, 0.0)))
        scale = jnp.maximum(jnp.max(jnp.abs(inner)), jnp.max(jnp.abs(outer)))
        return state, count + CHECK, worst / jnp.where(scale > 0, scale, 1.0)

    def going(carry):
        return (carry[2] > tolerance) & (carry[1] < most)

    zero = jnp.zeros_like(start)
    state = (jnp.where(at.held, 0.0, start), zero, zero, jnp.asarray(1e-4, start.dtype))
    state, count, residual = jax.lax.while_loop(going, many, (state, jnp.asarray(0), jnp.asarray(jnp.inf, start.dtype)))
    return jnp.where(at.held, 0.0, state[0]), (residual, count.astype(start.dtype))  # custom_root: float aux


def tangent_solve(at: Load, apply, b: Float[Array, "3 N"], symmetric: bool = True) -> Float[Array, "3 N"]:
    """Solve with the tangent by preconditioned conjugate gradients (or BiCGStab where it is not symmetric)."""
    diagonal = jnp.where(at.held, 1.0, at.diagonal)
    method = jax.scipy.sparse.linalg.cg if symmetric else jax.scipy.sparse.linalg.bicgstab

    def solve(matvec, b):
        return method(matvec, b, tol=1e-11, maxiter=4000, M=lambda x: x / diagonal)[0]

    return jax.lax.custom_linear_solve(apply, b, solve, solve, symmetric=symmetric)


def equilibrium(
    scene: Scene, time: float = 0.0, tolerance: float = 1e-9, most: int = 20_000, margin: float = 1.6
) -> Equilibrium:
    """Static equilibrium of a scene under the loads at `time`. Pure JAX, differentiable both ways.

    Args:
        scene: gravity, loads, probe, support motion, capsule, stiffness field, added energies and long-term Prony
            stress act; friction, adhesion and bedding do not. Start is `body.settled`, or rest.
        time: real time at which probe, support and loads are looked up, s.
        tolerance: on the greatest unbalanced force over the greatest force.
        most: iterations after which it is given up (the displacement is NaN then; `checked` says so).
        margin: fictitious mass over its estimate at rest; large strains stiffen and need more (4 at a stretch of 0.6):
            a search that bursts is begun again with twice as much, `RAISES` times at most.
    """
    scene = scene.cast(scene.body.points.dtype)
    at = load(scene, time)
    first = jax.lax.stop_gradient(internal.settled(scene))
    symmetric = scene.loads is None or scene.loads.pressure is None  # a pressure that ends at an edge has no potential
    w, (residual, count) = jax.lax.custom_root(
        partial(unbalanced, at),
        first,
        lambda _, start: relax(jax.lax.stop_gradient(at), start, tolerance, most, margin),
        lambda apply, b: tangent_solve(jax.lax.stop_gradient(at), apply, b, symmetric),
        has_aux=True,
    )
    u = jnp.where(at.held, at.target, w)
    volumes = internal.internal_energy(at.scene, at.mesh, jax.lax.stop_gradient(u))[1][: len(scene.body.cells)]
    inverted = jnp.any(volumes <= 0)  # a search that jumped too far can come to rest so
    u = jnp.where((residual <= tolerance) & ~inverted, u, jnp.nan)
    force = jnp.zeros(3, u.dtype)
    if at.patch is not None:
        force = _touch(at, at.patch, u).force
    return Equilibrium(u.T, residual, count.astype(int), force, inverted)


compiled = jax.jit(equilibrium, compiler_options=COMPILER_OPTIONS, static_argnames=("most",))


def _how(found: Equilibrium) -> str:
    """Why there is no answer."""
    residual = float(found.residual)
    if bool(found.inverted):
        return "an element came out inverted"
    if not 0 <= residual < jnp.inf:
        return "it burst"
    said = f"unbalanced force {residual:.1e} of the greatest"
    if found.displacement.dtype == jnp.float32:
        said += " in single precision, which stalls there (`jax.config.update('jax_enable_x64', True)` first)"
    return said


def checked(found: Equilibrium) -> Equilibrium:
    """`found`, or the sentence that says why not.

    Raises:
        NotConverged: the residual did not fall below the tolerance.
    """
    if not bool(jnp.isfinite(found.displacement).all()):
        raise NotConverged(
            f"no static equilibrium after {int(found.iterations)} iterations: {_how(found)}; check loads and support, "
            "allow more iterations, or come nearer in smaller steps (`statics.gradual`)"
        )
    return found


def gradual(scene: Scene, time: float = 0.0, **options) -> Equilibrium:
    """`equilibrium` at `time`, reached in steps of load that shorten themselves (host side).

    First gravity grows from none (unless `body.settled` is given), then probe and support go their way from the clock's
    start to `time`; each search begins where the last ended, and a step that finds no equilibrium is halved.

    Args:
        scene, time: as for `equilibrium`.
        options: `tolerance`, `most`, `margin` of `equilibrium`.

    Raises:
        NotConverged: the load that was reached, and what to do.
    """
    begin, u = float(scene.clock.start), scene.body.settled
    if scene.gravity is not None and u is None:
        g = scene.gravity
        u = _led(scene, u, lambda s: ({"gravity": s * g}, begin), "gravity", options).displacement
    return _led(scene, u, lambda s: ({}, begin + s * (time - begin)), "the way", options, time)


def _led(scene, u, at, what: str, options, time=None) -> Equilibrium:
    """Follow a load from its share 0 to 1."""
    u = jnp.zeros_like(scene.body.points) if u is None else u
    reached, step = 0.0, 1.0
    while True:
        share = min(1.0, reached + step)
        changes, when = at(share)
        found = compiled(scene.put({**changes, "body.settled": u}), when, **options)
        if bool(jnp.isfinite(found.displacement).all()):
            if share == 1.0:
                return found
            u, reached, step = found.displacement, share, 2 * step
            continue
        step /= 2
        if step < FINEST:
            where = f"{reached:.0%} of {what}"
            where = where if time is None else f"{where} (t = {at(reached)[1]:.4g} of {time:.4g} s)"
            said = f"no static equilibrium beyond {where}: {_how(found)}. "
            if time is None:
                raise NotConverged(said + verdict.weight(scene))
            raise NotConverged(
                said + "The tissue may have no equilibrium there (a law that softens, a probe that is too deep): press "
                "less deep, take a finer mesh under the probe, or run it explicitly"
            )

"""One explicit step: forces of tissue, skin, contact and gravity, then central differences with mass damping.

In velocity form, v(n+1/2) = ((1 - a h/2) v(n-1/2) + h f/m) / (1 + a h/2), u(n+1) = u(n) + h v(n+1/2) (source 4.3.1;
Belytschko, Liu & Moran, ch. 6). Contact is evaluated at u(n), tissue at u(n) + beta v(n-1/2).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from tissuejax.arrays import barrier
from tissuejax.tled import capsule, contact, faces, internal, loads, stable, support, surface
from tissuejax.tled.glide import Glide, glide, spurred
from tissuejax.tled.ledger import Spent
from tissuejax.tled.scene import Scene, filled


class Machine(NamedTuple):
    """What is worked out once a run from the scene."""

    scene: Scene
    mesh: internal.Mesh
    hold: support.Hold
    patch: contact.Patch | None
    skin: capsule.Skin | None
    mass: Float[Array, " N"]
    weight: Float[Array, "3 N"] | None
    glide: Glide | None
    seam: faces.Seam | None = None
    corners: Int[Array, "3 v P"] | None = None


class State(NamedTuple):
    """What one step hands to the next: u (3, N) m, v (3, N) m/s half a step behind, memories, the force that a
    compliant machine has given way to, N, now and a step before."""

    u: Float[Array, "3 N"]
    v: Float[Array, "3 N"]
    history: internal.History
    grip: contact.Grip | None
    slip: support.Slip
    felt: Float[Array, "2 3"] | None
    opening: faces.Memory | None = None


class Drive(NamedTuple):
    """Outside motion of one step: the probe at the step's start, how far it moves per step, the support at its end, and
    the support's speed: damping brakes what moves against the support; the factor on loads at the step's start."""

    centre: Float[Array, " 3"] | None
    stride: Float[Array, " 3"] | None
    motion: Float[Array, " 3"] | None
    pace: Float[Array, " 3"] | None = None
    load: Float[Array, ""] | None = None


class Felt(NamedTuple):
    """What a step reports: force and torque on the probe (by facet: sum over the last axis), force on the support, work
    done by the probe (by facet), and with cohesive faces what else was spent (by point or node: `summed`)."""

    force: Float[Array, "3 n"]
    torque: Float[Array, "3 n"]
    reaction: Float[Array, " 3"]
    work: Float[Array, " n"]
    spent: Spent | None = None


def summed(felt: Felt) -> Felt:
    """Over facets, points and nodes, after a frame: a sum in every step costs more than what it sums."""
    force, torque = (jnp.sum(x, 1) for x in felt[:2])
    spent = None if felt.spent is None else Spent(*(jnp.sum(x) for x in felt.spent))
    return Felt(force, torque, felt.reaction, jnp.sum(felt.work), spent)


def machine(scene: Scene) -> Machine:
    """Reference quantities of a scene (pure JAX)."""
    mesh = internal.mesh(scene)
    probe = scene.probe
    stiffness = stable.nodal_stiffness(scene, mesh) if support.slips(scene) else None
    mass = mesh.mass if probe is None else mesh.mass + probe.mass
    mass = mass if scene.faces is None else mass + scene.faces.mass
    seam = None if scene.faces is None else faces.seam(scene.faces, scene.body.points)
    weight = None if scene.gravity is None else scene.gravity[:, None] * mesh.mass
    skin = None if scene.tissue.capsule is None else capsule.skin(scene.body)
    patch = None if probe is None else contact.patch(scene)
    hold = support.hold(scene, stiffness)
    slides = None if scene.support.compliance is None else glide(scene, mass, filled(hold.area))
    touched = probe is not None or scene.faces is not None
    corners = surface.corners(patch, scene.faces, len(scene.body.points)) if touched else None
    return Machine(scene, mesh, hold, patch, skin, mass, weight, slides, seam, corners)


def start(m: Machine) -> State:
    """At rest in the settled shape; where that is no equilibrium (gravity switched on), half a step of speed behind.

    On a moving support the tissue has moved along before the clock begins: it starts with the support's place, speed.
    """
    scene, u = m.scene, internal.settled(m.scene)
    v = jnp.zeros_like(u)
    moved = scene.support.displacement
    if moved is not None and scene.support.pattern is None:
        clock, time = scene.clock, filled(scene.support.time)
        real = clock.step * clock.compression
        at = clock.start + real * jnp.arange(2)
        place = jnp.stack([jnp.interp(at, time, x) for x in moved.T]).astype(u.dtype)
        u = u + place[:, :1]
        v = v + (place[:, 1:] - place[:, :1]) / clock.step
    if m.weight is not None and scene.body.settled is None:
        zero = jnp.zeros_like(scene.body.held.T[:2])
        pull = m.weight if m.glide is None else spurred(scene, m.glide, m.weight, zero, filled(m.hold.area), m.mass)
        v = jnp.where(m.hold.held, 0.0, -0.5 * scene.clock.step * pull / m.mass)
    grip = None if scene.probe is None else contact.untouched(scene.probe)
    compliant = scene.probe is not None and scene.probe.compliance is not None
    felt = jnp.zeros((2, 3), u.dtype) if compliant else None
    opening = None if scene.faces is None else faces.unopened(scene.faces)
    return State(u, v, internal.rest(scene, m.mesh), grip, support.bonded(scene), felt, opening)


def tissue_forces(m: Machine, u: Float[Array, "3 N"], history: internal.History, step):
    """Internal forces of solid and skin, (3, N), and the new memory. Recomputed, not stored, in a reverse pass."""

    def evaluate(scene, mesh, u, history, step):
        return internal.forces(scene, mesh, u, history, step)

    f, history = jax.checkpoint(evaluate, prevent_cse=False)(m.scene, m.mesh, u, history, step)
    if m.skin is not None:
        f = f + capsule.forces(m.skin, filled(m.scene.tissue.capsule), u)
    return f, history


def advance(m: Machine, state: State, drive: Drive) -> tuple[State, Felt]:
    """The state one step later."""
    scene, settings, clock = m.scene, m.scene.settings, m.scene.clock
    h, real = clock.step, clock.step * clock.compression
    u, v = state.u, state.v
    inner, history = tissue_forces(m, u + settings.stiffness_damping * v, state.history, real)
    outer = jnp.zeros_like(u) if m.weight is None else m.weight + 0.0
    if scene.loads is not None:
        outer = outer + loads.forces(scene.loads, scene.body.points, u, filled(drive.load))
    none = jnp.zeros((3, 1), u.dtype)
    force = torque = none
    work, grip, felt, opening = none[0], state.grip, state.felt, state.opening
    acting = None
    if m.corners is not None:
        centre = drive.centre
        if felt is not None:
            centre = filled(centre) + filled(scene.pressed.compliance) * felt[0]
        acting = _surface(m, u, centre, grip, opening)
        grip, opening = acting.grip, acting.memory
    if scene.probe is not None:
        touch = filled(acting)
        force, torque = filled(touch.force), filled(touch.torque)
        work = -jnp.sum(force * filled(drive.stride)[:, None], 0)
        if felt is not None:
            new = _given_way(m, jnp.sum(force, 1), felt[0], u, centre, state)
            # the tip moves on its spring too: its way from half a step before to half a step after, as the path's is
            work = work - jnp.sum(force * (0.5 * filled(scene.probe.compliance) * (new - felt[1]))[:, None], 0)
            felt = jnp.stack([new, felt[0]])
    f = outer - inner
    f = f if acting is None else surface.added(acting, f)
    half = 0.5 * settings.mass_damping * h
    moving = f
    if m.glide is not None:
        moving = spurred(scene, m.glide, f, filled(state.slip.elastic), filled(m.hold.area), m.mass)
    driven = (1.0 - half) * v + h * moving / m.mass
    driven = driven if drive.pace is None else driven + 2.0 * half * drive.pace[:, None]
    slip = support.slide(scene, m.hold, state.slip, f, moving, m.mass) if support.slips(scene) else state.slip
    told = (support.target(scene, m.hold, slip, drive.motion) - u) / h
    pushed = barrier(jnp.where(m.hold.held, told, driven / (1.0 + half)))  # once, not again for where it leads
    moved = barrier(u + h * pushed)
    reaction = jnp.sum(scene.body.held.T * f[:, scene.body.fixed], axis=1)  # force of the tissue on the support
    spent = None if scene.faces is None else _spent(m, filled(acting), inner, f, v, pushed, drive.pace)
    return State(moved, pushed, history, grip, slip, felt, opening), Felt(force, torque, reaction, work, spent)


def _spent(m: Machine, acting: surface.Acting, inner, f, v, pushed, pace) -> Spent:
    """Losses and works of one step, J, at the mean of the speeds before and after, point by point or node by node.

    Damping is what it takes out of the body's motion, less what the support's pace, which it is relative to, puts in.
    """
    scene, zero = m.scene, jnp.zeros(1, v.dtype)
    h, mean = scene.clock.step, 0.5 * (v + pushed)
    free = jnp.where(m.hold.held, 0.0, mean)
    slowed = free if pace is None else free - pace[:, None]
    damping = scene.settings.mass_damping * h * m.mass * jnp.sum(free * slowed, 0)
    shove = zero
    if scene.support.displacement is not None:
        shove = jnp.sum(jnp.where(m.hold.held, mean * (m.mass * (pushed - v) - h * f), 0.0), 0)
    rubbed = zero if acting.rubbed is None else acting.rubbed
    return Spent(filled(acting.lost), rubbed, damping, h * jnp.sum(inner * mean, 0), shove)


def _given_way(m: Machine, force, felt, u, centre, state) -> Float[Array, " 3"]:
    """The force that the machine gives way to in the next step, N.

    In equilibrium it is the contact's own: felt = F(centre + compliance * felt). Newton's step towards that is taken,
    with the contact's stiffness as it is. A fixed part of the difference instead leaves the loop unstable where
    compliance times stiffness is large (the blade chatters, and the balance of energies is open by more than the
    work); half of Newton's step lags like a dashpot, which takes 1.4 % of the work of a blade that rubs.
    """
    compliance = jnp.broadcast_to(filled(m.scene.pressed.compliance), 3)
    total = lambda at: jnp.sum(filled(_surface(m, u, at, state.grip, state.opening).force), 1)  # noqa: E731
    stiffness = -jax.jacfwd(total)(centre)
    step = jnp.linalg.solve(jnp.eye(3, dtype=u.dtype) + stiffness * compliance, force - felt)
    return felt + step


def _surface(m, u, centre, grip, opening) -> surface.Acting:
    scene = m.scene

    again = jax.checkpoint(surface.forces, prevent_cse=False)
    return again(scene.probe, m.patch, scene.faces, m.seam, m.corners, u, centre, grip, opening)

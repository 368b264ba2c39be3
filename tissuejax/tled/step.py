"""One explicit step: forces of tissue, skin, contact and gravity, then central differences with mass damping.

In velocity form, v(n+1/2) = ((1 - a h/2) v(n-1/2) + h f/m) / (1 + a h/2), u(n+1) = u(n) + h v(n+1/2) (source 4.3.1;
Belytschko, Liu & Moran, ch. 6). Contact is evaluated at u(n), tissue at u(n) + beta v(n-1/2).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.tled import capsule, contact, faces, internal, loads, stable, support
from tissuejax.tled.glide import Glide, glide, spurred
from tissuejax.tled.internal import barrier
from tissuejax.tled.ledger import Spent
from tissuejax.tled.scene import Scene


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


class State(NamedTuple):
    """What one step hands to the next: u (3, N) m, v (3, N) m/s half a step behind, memories, the force felt."""

    u: Float[Array, "3 N"]
    v: Float[Array, "3 N"]
    history: internal.History
    grip: contact.Grip | None
    slip: support.Slip
    felt: Float[Array, " 3"] | None
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
    """What a step reports: force and torque on the probe, force on the support, work done by the probe, and with
    cohesive faces what else was spent."""

    force: Float[Array, " 3"]
    torque: Float[Array, " 3"]
    reaction: Float[Array, " 3"]
    work: Float[Array, ""]
    spent: Spent | None = None


FEEL = 0.05  # share of the new force per step that a compliant machine answers to: keeps the loop stable


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
    slides = None if scene.support.compliance is None else glide(scene, mass, hold.area)
    return Machine(scene, mesh, hold, patch, skin, mass, weight, slides, seam)


def start(m: Machine) -> State:
    """At rest in the settled shape; where that is no equilibrium (gravity switched on), half a step of speed behind.

    On a moving support the tissue has moved along before the clock begins: it starts with the support's place, speed.
    """
    scene, u = m.scene, internal.settled(m.scene)
    v = jnp.zeros_like(u)
    if scene.support.displacement is not None and scene.support.pattern is None:
        clock, path = scene.clock, scene.support
        real = clock.step * clock.compression
        at = clock.start + real * jnp.arange(2)
        place = jnp.stack([jnp.interp(at, path.time, x) for x in path.displacement.T]).astype(u.dtype)
        u = u + place[:, :1]
        v = v + (place[:, 1:] - place[:, :1]) / clock.step
    if m.weight is not None and scene.body.settled is None:
        zero = jnp.zeros_like(scene.body.held.T[:2])
        pull = m.weight if m.glide is None else spurred(scene, m.glide, m.weight, zero, m.hold.area, m.mass)
        v = jnp.where(m.hold.held, 0.0, -0.5 * scene.clock.step * pull / m.mass)
    grip = None if scene.probe is None else contact.untouched(scene.probe)
    compliant = scene.probe is not None and scene.probe.compliance is not None
    felt = jnp.zeros(3, u.dtype) if compliant else None
    opening = None if scene.faces is None else faces.unopened(scene.faces)
    return State(u, v, internal.rest(scene, m.mesh), grip, support.bonded(scene), felt, opening)


def tissue_forces(m: Machine, u: Float[Array, "3 N"], history: internal.History, step):
    """Internal forces of solid and skin, (3, N), and the new memory. Recomputed, not stored, in a reverse pass."""

    def evaluate(scene, mesh, u, history, step):
        return internal.forces(scene, mesh, u, history, step)

    f, history = jax.checkpoint(evaluate, prevent_cse=False)(m.scene, m.mesh, u, history, step)
    if m.skin is not None:
        f = f + capsule.forces(m.skin, m.scene.tissue.capsule, u)
    return f, history


def advance(m: Machine, state: State, drive: Drive) -> tuple[State, Felt]:
    """The state one step later."""
    scene, settings, clock = m.scene, m.scene.settings, m.scene.clock
    h, real = clock.step, clock.step * clock.compression
    u, v = state.u, state.v
    inner, history = tissue_forces(m, u + settings.stiffness_damping * v, state.history, real)
    outer = jnp.zeros_like(u) if m.weight is None else m.weight + 0.0
    if scene.loads is not None:
        outer = outer + loads.forces(scene.loads, scene.body.points, u, drive.load)
    zero = jnp.zeros(3, u.dtype)
    force = torque = zero
    work, grip, felt, opening = zero[0], state.grip, state.felt, state.opening
    rubbed = lost = None
    if scene.probe is not None:
        centre = drive.centre if felt is None else drive.centre + scene.probe.compliance * felt
        touch = _touch(scene.probe, m.patch, u, centre, grip)
        outer, grip, rubbed = outer + touch.nodal, touch.grip, touch.rubbed
        force, torque, work = touch.force, touch.torque, -jnp.sum(touch.force * drive.stride)
        if felt is not None:
            new = felt + FEEL * (force - felt)
            work = work - jnp.sum(touch.force * scene.probe.compliance * (new - felt))  # the rig springs back meanwhile
            felt = new
    if scene.faces is not None:
        held = jax.checkpoint(faces.forces, prevent_cse=False)(scene.faces, m.seam, u, opening)
        outer, opening, lost = outer + held.nodal, held.memory, held.lost
    f = outer - inner
    half = 0.5 * settings.mass_damping * h
    moving = f if m.glide is None else spurred(scene, m.glide, f, state.slip.elastic, m.hold.area, m.mass)
    driven = (1.0 - half) * v + h * moving / m.mass
    driven = driven if drive.pace is None else driven + 2.0 * half * drive.pace[:, None]
    pushed = driven / (1.0 + half)
    slip = support.slide(scene, m.hold, state.slip, f, moving, m.mass) if support.slips(scene) else state.slip
    moved = u + h * pushed
    moved = jnp.where(m.hold.held, support.target(scene, m.hold, slip, drive.motion), moved)
    pushed = jnp.where(m.hold.held, (moved - u) / h, pushed)
    moved, pushed = barrier((moved, pushed))
    reaction = jnp.sum(scene.body.held.T * f[:, scene.body.fixed], axis=1)  # force of the tissue on the support
    spent = None if lost is None else _spent(m, lost, rubbed, inner, f, v, pushed)
    return State(moved, pushed, history, grip, slip, felt, opening), Felt(force, torque, reaction, work, spent)


def _spent(m: Machine, lost, rubbed, inner, f, v, pushed) -> Spent:
    """Losses and works of one step, J, at the mean of the speeds before and after."""
    scene, zero = m.scene, jnp.zeros_like(lost)
    h, mean = scene.clock.step, 0.5 * (v + pushed)
    free = jnp.where(m.hold.held, 0.0, mean)
    damping = scene.settings.mass_damping * h * contact.total(m.mass * free * free)
    shove = zero
    if scene.support.displacement is not None:
        carried = jnp.where(m.hold.held, mean * (m.mass * (pushed - v) - h * f), 0.0)
        shove = contact.total(carried)
    return Spent(lost, zero if rubbed is None else rubbed, damping, h * contact.total(inner * mean), shove)


def _touch(probe, patch, u, centre, grip):
    return jax.checkpoint(contact.forces, prevent_cse=False)(probe, patch, u, centre, grip)

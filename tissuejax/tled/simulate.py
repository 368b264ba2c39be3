"""The simulation as one pure function: from a scene to what the probe, the support and the markers feel and show.

What others build on (stable):

    tissue = build.Tissue(energy, volumetric, energy_values, volumetric_values, density)
    path = build.ProbePath(probe_time, probe_position, radius)
    scene = build.scene(geometry, tissue, times, path)      # host: chooses step, penalty, patch; refuses
    scene = scene.put({"tissue.energy_values.C10": c, "probe.friction": 0.2, "tissue.stiffness": field})
    out = simulate(scene)                    # pure JAX: jit, jvp, vjp work from outside; the scene is a pytree argument
    out = run(scene)                         # the same, jitted, and checked (`verdict`): raises UnstableSimulation
    force = sample(out.time, out.force, t)   # at the sensor's own times

Compile with `jax.jit(f, compiler_options=COMPILER_OPTIONS)`: without these options the result is the same and 3 to 5
times slower. Inside `simulate` every float is cast to the precision of `scene.body.points` (`scene.cast(float32)`).
`out.failed` is a code, -1 if all is well, else the frame at which a value was not finite or an element inverted
(`out.element`); `out.pierced(scene)` is the frame by which the probe had sunk through the surface. `verdict.check`
turns both into sentences. Never use an outcome without looking at them.
"""

import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from tissuejax.tled import contact, internal, verdict
from tissuejax.tled.ledger import Balance, balance, look
from tissuejax.tled.scene import Scene, filled
from tissuejax.tled.step import Drive, Felt, Machine, State, advance, machine, start, summed

COMPILER_OPTIONS = {
    # The first keeps the stages apart, see `internal.py`. The second would share the nodes among threads: to wake them
    # takes a third of a step from some 5,000 nodes on. The element loop is shared by `lanes/share.py`.
    "xla_disable_hlo_passes": "cse_barrier_expander,cpu-parallel-task-assigner",
    "xla_cpu_experimental_ynn_fusion_type": "",  # no library sums: each costs 0.15 ms, half of a reverse pass
}


class Checks(NamedTuple):
    """Taken at the end of each block of frames.

    Attributes:
        kinetic, internal: energies, J (kinetic with the static mass of contact; internal: elastic, no memory).
        hourglass: energy of the hourglass control, J; more than some per cent of `internal`: too coarse.
        depth: greatest penetration into the probe at the end of any of the block's frames, m.
        failed: True where a value is not finite or an element is inverted; `element`: the worst of the finite ones.
        lost: most of its volume ratio that any element has lost at a corner: 1 and more where it is folded, 0 in blocks
            that were not run; `folded`: that element.
    """

    kinetic: Float[Array, " b"]
    internal: Float[Array, " b"]
    hourglass: Float[Array, " b"]
    depth: Float[Array, " b"]
    failed: Array
    element: Int[Array, " b"]
    lost: Float[Array, " b"]
    folded: Int[Array, " b"]


class Pace(NamedTuple):
    """Taken at the end of each frame: whether every speed is finite, the node that moves fastest, and the greatest
    penetration of the surface into the probe, m. A run that blows up is full of NaN by the next look, so where it began
    is read off from the last frame that was still finite."""

    finite: Array
    node: Int[Array, ""]
    depth: Float[Array, ""]


class Outcome(eqx.Module):
    """What a simulation gives. Forces are means over each frame; n frames.

    Attributes:
        time: real time of the force means, s. end_time: real time of the frames' ends, of markers and work.
        force, torque: of the tissue on the probe, N and N m (about its reference point).
        reaction: force of the tissue on the support, N; force + reaction = weight - change of momentum.
        markers: positions, m, (n, K, 3), or None.
        work: done by the probe on the tissue since the start, J.
        checks: energies, penetration and failure at the end of each block; `check_time` says when.
        failed: -1, or the frame by whose end the run had failed; `element`: where (inverted, or at the node that moved
            fastest when all was last finite).
        state: the final state, to go on from.
        balance: energies and crack half a step before the end of each frame, with cohesive faces; else None.
        penetration: greatest penetration of the surface into the probe at the end of each frame, m (-inf: none).
    """

    time: Float[Array, " n"]
    end_time: Float[Array, " n"]
    force: Float[Array, "n 3"]
    torque: Float[Array, "n 3"]
    reaction: Float[Array, "n 3"]
    work: Float[Array, " n"]
    markers: Float[Array, "n K 3"] | None
    checks: Checks
    check_time: Float[Array, " b"]
    failed: Int[Array, ""]
    element: Int[Array, ""]
    state: State
    penetration: Float[Array, " n"]
    balance: Balance | None = None

    @property
    def depth(self) -> Float[Array, ""]:
        """Greatest penetration seen, m."""
        return jnp.max(self.penetration)

    @property
    def corner(self) -> Float[Array, ""]:
        """Least volume ratio at a corner of any element, at the ends of blocks: 0 or less where one is folded."""
        return 1 - jnp.max(self.checks.lost)

    @property
    def hourglass(self) -> Float[Array, ""]:
        """Greatest energy of the hourglass control over the greatest internal energy: above 5 % the mesh is coarse."""
        return jnp.max(self.checks.hourglass) / jnp.max(jnp.abs(self.checks.internal))

    def pierced(self, scene: Scene) -> Int[Array, ""]:
        """First frame at whose end the surface was deeper in the probe than `contact.PIERCED` of its radius, or -1."""
        if scene.probe is None:
            return jnp.asarray(-1)
        deep = self.penetration > contact.PIERCED * contact.breadth(scene)
        return jnp.where(jnp.any(deep), jnp.argmax(deep), -1)

    @property
    def inertia(self) -> Float[Array, ""]:
        """Greatest kinetic energy over greatest internal energy; warns of too much time compression, but late."""
        return jnp.max(self.checks.kinetic) / jnp.max(jnp.abs(self.checks.internal))


def simulate(scene: Scene) -> Outcome:
    """Run the whole clock of a scene. Pure; see the module's docstring."""
    scene = scene.cast(scene.body.points.dtype)
    m = machine(scene)
    return proceed(m, start(m))


def proceed(m: Machine, state: State) -> Outcome:
    """Run the clock of a machine's scene from a given state."""
    scene = m.scene
    clock = scene.clock
    length = block_length(clock.frames)
    blocks = -(-clock.frames // length)

    def frame(state, drive):
        def one(carry, drive):
            state, felt = carry
            state, new = advance(m, state, drive)
            return (state, jax.tree.map(jnp.add, felt, new)), None

        first = jax.tree.map(lambda x: x[0], drive)
        none = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), jax.eval_shape(advance, m, state, first)[1])
        (state, total), _ = jax.lax.scan(one, (state, none), drive, length=clock.steps)
        total = summed(total)
        force, torque, reaction = (x / clock.steps for x in total[:3])
        mean = Felt(force, torque, reaction, total.work, total.spent)
        looked = None
        if scene.faces is not None:
            centre = None if drive.centre is None else drive.centre[-1] + 0.5 * filled(drive.stride)[-1]
            if state.felt is not None:
                centre = filled(centre) + filled(scene.pressed.compliance) * jnp.mean(state.felt, 0)
            looked = look(m, state, centre)
        return state, (mean, _markers(scene, state.u), _pace(m, state, drive), looked)

    def block(state, drive):
        state, out = jax.lax.scan(frame, state, drive, length=length)
        return state, (out, _checks(m, state, jnp.max(out[2].depth)))

    if _too_much_to_store(scene):
        block = jax.checkpoint(block, prevent_cse=False)
    drive = jax.tree.map(lambda x: x.reshape(blocks, length, clock.steps, *x.shape[1:]), drives(scene, blocks * length))
    if clock.needed is None:
        state, (series, checks) = jax.lax.scan(block, state, drive, length=blocks)
    else:
        numbered = (jnp.arange(blocks), drive)
        state, (series, checks) = jax.lax.scan(_while_needed(block, length, clock.needed), state, numbered)
    felt, markers, pace, looks = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), series)
    felt, markers, looks = jax.tree.map(lambda x: x[: clock.frames], (felt, markers, looks))
    ledger = None if looks is None else balance(scene, felt.work, felt.spent, looks)
    return _outcome(scene, felt, markers, pace, checks, length, state, ledger)


def _while_needed(block, length: int, needed: Int[Array, ""]):
    """`block` for the numbered blocks that begin before the last needed frame; afterwards nothing moves."""

    def numbered(state, x):
        number, drive = x
        nothing = jax.tree.map(lambda a: jnp.zeros(a.shape, a.dtype), jax.eval_shape(block, state, drive)[1])
        return jax.lax.cond(number * length < needed, block, lambda state, _: (state, nothing), state, drive)

    return numbered


def block_length(frames: int) -> int:
    """Frames between two checks: about the square root, so that recomputed reverse passes stay small."""
    blocks = max(1, round(math.sqrt(frames)))
    return -(-frames // blocks)


def _too_much_to_store(scene: Scene) -> bool:
    u = scene.body.points
    return u.size * u.dtype.itemsize * scene.clock.frames * scene.clock.steps > scene.settings.memory


def drives(scene: Scene, frames: int) -> Drive:
    """Outside motion at every step: probe position, its stride, the support's motion at the step's end, load factor."""
    clock, probe, support = scene.clock, scene.probe, scene.support
    count = frames * clock.steps
    real = clock.interval / clock.steps
    centre = stride = motion = pace = None
    if probe is not None:
        at = clock.start + real * jnp.arange(-1, count + 1)
        path = series(probe.time, probe.position, at)
        path = path if probe.offset is None else path + probe.offset
        centre, stride = path[1:-1], 0.5 * (path[2:] - path[:-2])
    if support.displacement is not None:
        path = series(filled(support.time), support.displacement, clock.start + real * jnp.arange(count + 1))
        motion = path[1:]
        if support.pattern is None:  # parts that move apart carry no body along
            pace = (path[1:] - path[:-1]) / clock.step
    load = None
    if scene.loads is not None:
        load = series(scene.loads.time, scene.loads.factor, clock.start + real * jnp.arange(count))
    return Drive(centre, stride, motion, pace, load)


def series(time: Float[Array, " n"], values: Float[Array, "n ..."], at: Float[Array, " m"]) -> Float[Array, "m ..."]:
    """Linear interpolation of a time series, constant beyond its ends."""
    flat = values.reshape(len(time), -1)
    rows = [jnp.interp(at, time, flat[:, i]) for i in range(flat.shape[1])]
    return jnp.stack(rows, -1).reshape(len(at), *values.shape[1:])


sample = series


def _markers(scene, u):
    markers = scene.markers
    if markers is None:
        return None
    return markers.rest + jnp.einsum("kv,ikv->ki", markers.weights, u[:, markers.nodes])


def _pace(m: Machine, state: State, drive: Drive) -> Pace:
    v = jax.lax.stop_gradient(state.v)
    square = jnp.sum(v * v, 0)
    return Pace(jnp.isfinite(jnp.sum(square)), jnp.argmax(square), _depth(jax.lax.stop_gradient((m, state)), drive))


def _depth(frozen: tuple[Machine, State], drive: Drive) -> Float[Array, ""]:
    m, state = frozen
    if drive.centre is None:
        return jnp.asarray(-jnp.inf, state.u.dtype)
    centre = jax.lax.stop_gradient(drive.centre[-1] + filled(drive.stride)[-1])  # at the end of the last step
    probe = m.scene.pressed
    centre = centre if state.felt is None else centre + filled(probe.compliance) * state.felt[0]
    return contact.depth(probe, filled(m.patch), state.u, centre)


def _checks(m: Machine, state: State, deep: Float[Array, ""]) -> Checks:
    u, v = jax.lax.stop_gradient((state.u, state.v))
    frozen = jax.lax.stop_gradient(m)
    energy, J, hourglass = internal.internal_energy(frozen.scene, frozen.mesh, u)
    kinetic = 0.5 * jnp.sum(frozen.mass * v * v)
    J = jnp.where(jnp.isfinite(J), J, jnp.inf)[: len(frozen.scene.body.cells)]
    worst = jnp.argmin(J)
    failed = (J[worst] <= 0) | ~jnp.isfinite(jnp.sum(v))
    body = frozen.scene.body
    X = body.points.T[:, body.cells.T]
    corner = body.element.least_corner(X, X + u[:, body.cells.T])
    return Checks(kinetic, energy, hourglass, deep, failed, worst, 1 - jnp.min(corner), jnp.argmin(corner))


def _outcome(scene, felt, markers, pace, checks, length, state, ledger) -> Outcome:
    clock = scene.clock
    first = jnp.argmax(checks.failed)
    looked = (first + 1) * length - 1
    lost = jnp.argmin(pace.finite)  # the first frame that is not finite, if there is one
    burst = ~pace.finite[lost] & (lost <= looked)
    node = pace.node[jnp.maximum(lost - 1, 0)]
    near = jnp.argmax(jnp.any(scene.body.cells == node, 1))
    bad = jnp.any(checks.failed)
    frame = jnp.where(bad, jnp.minimum(jnp.where(burst, lost, looked), clock.frames - 1), -1)
    ends = jnp.minimum((jnp.arange(len(checks.failed)) + 1) * length, clock.frames)
    middles = clock.middles - 0.5 * clock.interval / clock.steps  # forces belong to the start of each step
    return Outcome(
        time=middles, end_time=clock.ends, force=felt.force, torque=felt.torque, reaction=felt.reaction,
        work=jnp.cumsum(felt.work), markers=markers, checks=checks, check_time=clock.start + clock.interval * ends,
        failed=frame, element=jnp.where(bad, jnp.where(burst, near, checks.element[first]), -1), state=state,
        balance=ledger,
        penetration=pace.depth[: clock.frames],
    )  # fmt: skip


compiled = jax.jit(simulate, compiler_options=COMPILER_OPTIONS)


def run(scene: Scene, halvings: int = 2) -> Outcome:
    """Simulate, jitted and checked. A run that breaks down is tried again with half the step.

    Args:
        scene: the set-up.
        halvings: how often at most the step is halved; each takes a compilation and twice as long.

    Raises:
        UnstableSimulation: a value was not finite or an element inverted, also with the shortest step, or the probe
            went through the surface: when, where, and what to do.
    """
    out = compiled(scene)
    for _ in range(halvings):
        if int(out.failed) < 0 or not verdict.shorter_helps(out, scene):
            break
        scene = verdict.halved(scene)
        out = compiled(scene)
    verdict.check(out, scene)
    return out


def check(out: Outcome, scene: Scene) -> None:
    """See `verdict.check`."""
    verdict.check(out, scene)

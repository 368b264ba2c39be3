"""The full model in the loop: explicit TLED a piece of life a call, its state carried on. For whatever has no table.

Life is simulated at the speed of life; a scene that can't keep up is refused, with its pace and the largest mesh that
would: slow motion raises the force (the tissue sees a faster hand), and must never happen unsaid.

The step is not foreseen but tried: the ball is pressed in as deep as it will go, the fastest vibration of what is under
it is measured there, and where the step is too long for that it is shortened and tried again. On elements as large as
the ball, which it hardly squeezes, that allows several times the step that `build` foresees.
"""

import time
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError, UnstableSimulation
from tissuejax.experiments.probing import assembled
from tissuejax.surrogate.ramp import Matter, bare_setup
from tissuejax.surrogate.site_mesh import Grid, geometry, topology
from tissuejax.tled import contact, internal
from tissuejax.tled.build import SQUEEZED
from tissuejax.tled.scene import Scene
from tissuejax.tled.simulate import COMPILER_OPTIONS
from tissuejax.tled.stable import fastest
from tissuejax.tled.step import Drive, Machine, State, advance, machine
from tissuejax.tled.step import start as begin

CALL = 1e-3  # s of life a call, at least one step
UNROLLED = 4  # steps of a call that are written out one after another: a loop costs a third of so small a step
PRESSING, LOOKS = 0.05, 4  # m/s of the press in which the step is tried, and depths at which it is looked at
TRIES = 6  # steps that are tried, each at most half of the one before
PATIENCE = 2.0  # s that measuring the pace takes at most
SLOWEST = 1.25  # times life that a scene must reach: the page and the machine want something too


class Pace(NamedTuple):
    """`times_life`: seconds of life in a second of one core; `call_p50_ms`, `call_p99_ms`: time of a call by the wall's
    clock, so with whatever else the machine does."""

    times_life: float
    call_p50_ms: float
    call_p99_ms: float
    elements: int
    step_ms: float


@jax.jit
def made_ready(scene: Scene) -> tuple[Machine, State]:
    """A scene with what is worked out once, and its state at rest."""
    made = machine(scene)
    return made, begin(made)


def _go(made: Machine, state: State, ends: Float[jax.Array, "2 3"], steps: int):
    stride = (ends[1] - ends[0]) / steps

    def one(state, k):
        state, felt = advance(made, state, Drive(ends[0] + stride * k, stride, None))
        return state, felt.force

    state, forces = jax.lax.scan(one, state, jnp.arange(steps) + 1.0, unroll=min(steps, UNROLLED))
    return state, jnp.mean(forces, 0)


def calling(made: Machine, steps: int):
    """A call of so many steps. The machine is built in: handing its hundred arrays over would cost more than a step;
    the state is given away, so that nothing is copied."""
    go = partial(_go, made, steps=steps)
    return jax.jit(go, compiler_options=COMPILER_OPTIONS, donate_argnums=0)


@jax.jit
def borne(made: Machine, state: State, centre: Float[jax.Array, "3"]) -> Float[jax.Array, ""]:
    """The greatest stable step of a pressed body as it is, s."""
    scene = made.scene

    def resisting(u):
        inner = internal.forces(scene, made.mesh, u, state.history, 0.0)[0]
        return inner - contact.forces(scene.probe, made.patch, u, centre, state.grip).nodal

    omega = fastest(resisting, made.mass, made.hold.held, state.u)
    xi = 0.5 * omega * scene.settings.stiffness_damping
    return 2 / omega * (jnp.sqrt(1 + xi * xi) - xi)


def shortened(scene: Scene, steps: int) -> Scene:
    """The scene with so many steps a call; the static mass of its contact goes with the step's square."""
    share = scene.clock.steps / steps
    return scene.put({"clock.steps": steps, "probe.mass": scene.probe.mass * share**2})


def _copy(state: State) -> State:
    return jax.tree.map(jnp.array, state)


def direct_scene(matter: Matter, grid: Grid, place) -> Scene:
    """The scene of a fixed mesh, fine about `place`, with everything the model has, at the speed of life.

    Raises:
        InputError: a support that moves by itself: its clock is a recording's, not the hand's.
    """
    body = geometry(matter.lobe, place, grid)
    _, _, patch = topology(grid)
    setup = bare_setup(matter, body, patch, place, float(body.points[:, 2].max()) + matter.radius)
    scene, _ = assembled(matter.model, {k: jnp.asarray(float(v)) for k, v in matter.values.items()}, setup)
    if scene.support.displacement is not None:
        raise InputError("a support that moves by itself follows a recording's clock; use `tissuejax simulate`")
    return scene.put({"probe.offset": None}).cast(jnp.float32)


class Direct:
    """TLED under a hand.

    Attributes:
        call: s of life that one call covers. step: s. force: N, mean over the last call. gap: between ball and tissue
        before it is touched, m. displacement: of the nodes, m.
    """

    def __init__(self, scene: Scene, depth: float = 0.0):
        """Make ready and find the step.

        Args:
            depth: to which the tissue will be pressed, m; 0: the scene's own step is taken as it is.

        Raises:
            UnstableSimulation: no step was short enough.
        """
        for _ in range(TRIES):
            self._take(scene)
            worst = self._worst(depth) if depth > 0 else np.inf
            if self.step <= SQUEEZED * worst:
                self.home()
                return
            needed = np.ceil(self.step / (SQUEEZED * worst)) if worst > 0 else 2
            scene = shortened(scene, int(scene.clock.steps * max(2, needed)))
        raise UnstableSimulation(f"no step was short enough to press {1e3 * depth:.1f} mm deep; take a smaller --depth")

    def _take(self, scene: Scene) -> None:
        self.scene = scene
        self.step = float(scene.clock.step)
        self.steps = max(1, int(np.ceil(CALL / self.step - 1e-6)))
        self.call = self.steps * self.step
        self.made, self.first = made_ready(scene)
        self.go = calling(self.made, self.steps)
        start = scene.probe.position[0]
        self.gap = -float(contact.depth(scene.probe, self.made.patch, self.first.u, start))
        self.home()

    def _worst(self, depth: float) -> float:
        """The smallest step that any depth on the way down bears, s; 0 where the press broke down."""
        found, start = [], self.at
        count = int(np.ceil((self.gap + depth) / PRESSING / self.call))
        looks = {int(np.ceil(count * (k + 1) / LOOKS)) for k in range(LOOKS)}
        for k in range(1, count + 1):
            try:
                self.move(start - np.array([0, 0, (self.gap + depth) * k / count]))
            except UnstableSimulation:
                return 0.0
            if k in looks:
                found.append(float(borne(self.made, self.state, jnp.asarray(self.at, self.state.u.dtype))))
        return min(found) if np.isfinite(found).all() else 0.0

    def home(self) -> None:
        """Rested tissue, the ball where it began."""
        self.rest()
        self.at = np.asarray(self.scene.probe.position[0], float)

    def rest(self) -> None:
        """Rested tissue."""
        self.state, self.force = _copy(self.first), np.zeros(3)

    def move(self, to: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
        """One call: the ball goes straight to `to`; the mean force on it, N.

        Raises:
            UnstableSimulation: the state is no longer finite; tissue and ball are set back to where they began.
        """
        self.state, force = self.go(self.state, np.array([self.at, to], np.float32))
        self.force, self.at = np.asarray(force, float), np.asarray(to, float)
        if not np.isfinite(self.force).all():
            self.home()
            raise UnstableSimulation(
                "the simulation broke down (pressed too fast or too deep) and was set back to rest"
            )
        return self.force

    @property
    def displacement(self) -> Float[np.ndarray, "N 3"]:
        """Of the nodes, m."""
        return np.asarray(self.state.u).T

    def pace(self, calls: int = 400, press: float = 2e-3) -> Pace:
        """Measured: the ball is pressed in and held while calls are timed, `PATIENCE` at most; then rested again."""
        down = self.at - np.array([0, 0, self.gap + press])
        for share in np.linspace(0, 1, 50):
            self.move(self.at + (down - self.at) * share)
        spent, cpu = [], time.process_time()
        while len(spent) < calls and (len(spent) < 20 or sum(spent) < PATIENCE):
            begun = time.perf_counter()
            self.move(down)
            spent.append(time.perf_counter() - begun)
        cpu = (time.process_time() - cpu) / len(spent)
        self.home()
        ms = 1e3 * np.array(spent)
        return Pace(
            self.call / cpu, float(np.median(ms)), float(np.quantile(ms, 0.99)), len(self.scene.body.cells),
            1e3 * self.step,
        )  # fmt: skip


def largest(pace: Pace, grid: Grid) -> Grid:
    """The finest mesh that would keep up, going by `pace` on `grid`."""
    # a step costs as its elements, and its length falls with their size: work grows as the fourth power of the fineness
    share = (pace.times_life / SLOWEST) ** 0.25
    fits = [max(2, int(share * n)) for n in grid.counts]
    return grid._replace(counts=(2 * (fits[0] // 2), 2 * (fits[1] // 2), fits[2]))


def keeps_up(pace: Pace, grid: Grid) -> Pace:
    """`pace`, if the scene is quick enough.

    Raises:
        InputError: it is not: its pace, and the largest mesh that would do.
    """
    if pace.times_life >= SLOWEST:
        return pace
    fits = largest(pace, grid).counts
    raise InputError(
        f"{pace.elements} elements run at {pace.times_life:.2f} times life here, {SLOWEST:g} are needed, and slow "
        f"motion would falsify the force: take --mesh {fits[0]}x{fits[1]}x{fits[2]} or coarser, or a lower bulk modulus"
    )

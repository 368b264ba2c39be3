"""The full model in the loop: explicit TLED a piece of life a call, its state carried on. For whatever has no table.

Life is simulated at the speed of life; a scene that can't keep up is refused, with its pace and the largest mesh that
would: slow motion raises the force (the tissue sees a faster hand), and must never happen unsaid.
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
from tissuejax.tled.scene import Scene
from tissuejax.tled.simulate import COMPILER_OPTIONS
from tissuejax.tled.step import Drive, Machine, State, advance, machine
from tissuejax.tled.step import start as begin

CALL = 1e-3  # s of life a call, at least one step
UNROLLED = 4  # steps of a call that are written out one after another: a loop costs a third of so small a step
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
        call: s of life that one call covers. force: N, mean over the last call. displacement: of the nodes, m.
    """

    def __init__(self, matter: Matter, grid: Grid, place):
        self.scene = direct_scene(matter, grid, place)
        self.step = float(self.scene.clock.step)
        self.steps = max(1, int(np.ceil(CALL / self.step - 1e-9)))
        self.call = self.steps * self.step
        made, self.first = made_ready(self.scene)
        self.go = calling(made, self.steps)
        self.state, self.force = _copy(self.first), np.zeros(3)
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
            self.rest()
            self.at = np.asarray(self.scene.probe.position[0], float)
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
        down = self.at - np.array([0, 0, 1e-3 + press])
        for share in np.linspace(0, 1, 50):
            self.move(self.at + (down - self.at) * share)
        spent, cpu = [], time.process_time()
        while len(spent) < calls and (len(spent) < 20 or sum(spent) < PATIENCE):
            begun = time.perf_counter()
            self.move(down)
            spent.append(time.perf_counter() - begun)
        cpu = (time.process_time() - cpu) / len(spent)
        self.rest()
        self.at = np.asarray(self.scene.probe.position[0], float)
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

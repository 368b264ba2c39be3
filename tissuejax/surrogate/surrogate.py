"""A Surrogate: force and shape under a ball at any place and depth of its box, from tables. Pure JAX.

The force comes from one energy: W(x, y, d) = D^2.5 s^5 w(x, y, s), s = sqrt(d / D), is the vertical force integrated
over the depth d below first contact, and the force is -dW/dp: a closed path does no work, by construction. Relaxation
is a memory of stress modes (`memory.py`), friction and adhesion lie on top (`drag.py`). Below the box the force stays
what it is at the deepest.

Beyond the sides of the box the force fades to zero within `FADE`, and once faded comes back only after the ball has
been lifted: with a share c of the whole force that never rises while the ball touches, c W is a storage function of
which the hand gets back no more than it gave. (Fading W itself along the path would be without loss, and would push the
ball out with W / FADE, newtons where the press takes a tenth of one.)
"""

from collections.abc import Mapping
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from tissuejax.surrogate import drag
from tissuejax.surrogate.cardinal import Table

FADE = 1e-3  # m beyond the sides of the box over which the force fades


class Surface(eqx.Module):
    """The shape: nodes of the settled organ and their displacement, each as a sum of modes.

    The mesh moves with the site: `settled` modes (the mean first) with coefficients over (x, y), `modes` with
    coefficients over (x, y, s), divided by the depth; `lines` (x, y) gives the grid lines s and t of the site.
    """

    counts: tuple[int, int, int] = eqx.field(static=True)
    coefficients: Table
    modes: Float[Array, "M N 3"]
    settled_coefficients: Table
    settled: Float[Array, "L N 3"]
    lines: Table


class Memory(eqx.Module):
    """`stress` b_m and `strain` e_m over (x, y, s), each divided by depth; Prony shares `g` and times `tau` (s)."""

    stress: Table
    strain: Table
    g: Float[Array, " K"]
    tau: Float[Array, " K"]


class Rig(eqx.Module):
    """What the recording rig adds when a recording is predicted: where the true place is for a commanded one, m; how
    much later the true path runs, s; by how much the machine gives way, m/N."""

    offset: Float[Array, " 3"]
    delay: Float[Array, ""]
    compliance: Float[Array, ""]


class State(NamedTuple):
    """What one tick hands to the next: stress modes gone (K, M) and as they are now (M,), friction's and adhesion's
    memories, and the share of the force that is left since the ball touched (1 within the box)."""

    gone: Float[Array, "K M"]
    now: Float[Array, " M"]
    grip: drag.Grip
    share: Float[Array, ""]


class Surrogate(eqx.Module):
    """See the module.

    Attributes:
        low, high: sides of the box in plan, m. depth: below first contact, m. radius: of the ball, m.
        touch: height of the ball's centre at first contact over (x, y), m. law: w over (x, y, s).
        factor: on all moduli (1); forces are proportional to it.
    """

    low: Float[Array, "2"]
    high: Float[Array, "2"]
    depth: Float[Array, ""]
    radius: Float[Array, ""]
    touch: Table
    law: Table
    surface: Surface
    memory: Memory | None
    rub: drag.Rub
    rig: Rig
    factor: Float[Array, ""]

    def place(self, p: Float[Array, "3"]) -> tuple[Float[Array, "2"], Float[Array, ""]]:
        """Place within the box and depth below first contact (negative above), m, for a centre of the ball."""
        xy = jnp.clip(p[:2], self.low, self.high)
        return xy, self.touch(xy)[0] - p[2]

    def _scaled(self, p):
        """(x, y, s) and how far below the box, m; s is 0 and without derivative above first contact."""
        xy, depth = self.place(p)
        inside = jnp.clip(depth, 0.0, self.depth)
        touched = inside > 0
        s = jnp.where(touched, jnp.sqrt(jnp.where(touched, inside, 1.0) / self.depth), 0.0)
        return jnp.append(xy, s), inside, jnp.maximum(depth - self.depth, 0.0)

    def within(self, p: Float[Array, "3"]) -> Float[Array, ""]:
        """1 inside the sides of the box, 0 from `FADE` beyond them, smooth between."""
        beyond = p[:2] - jnp.clip(p[:2], self.low, self.high)
        square = jnp.sum(beyond**2)
        r = jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0) / FADE
        r = jnp.clip(r, 0.0, 1.0)
        return 1 - r * r * r * (10 - 15 * r + 6 * r * r)

    def energy(self, p: Float[Array, "3"]) -> Float[Array, ""]:
        """Elastic energy with the ball's centre at p, J; beyond the sides that of the nearest place in the box."""
        place, _, below = self._scaled(p)
        s = place[2]
        w = self.law(place)[0]
        value = self.depth**2.5 * s**5 * w
        # below the box the vertical force stays that at its floor: (5 w + dw/ds) / 2 there
        slope = self.law(place, 2)[0]
        value = value + below * self.depth**1.5 * (5 * w + slope) / 2
        return self.factor * value

    def elastic(self, p: Float[Array, "3"]) -> Float[Array, "3"]:
        """Force of the tissue on the ball without memory, N."""
        return -jax.grad(self.energy)(p)

    def _modes(self, table: Table, p):
        place, inside, _ = self._scaled(p)
        return inside * table(place)

    def shape(self, p: Float[Array, "3"]) -> Float[Array, " M"]:
        """Coefficients of the displacement modes, m."""
        return self._modes(self.surface.coefficients, p)

    def start(self, p: Float[Array, "3"]) -> State:
        """Rested tissue, the ball at p out of contact."""
        count = (0, 0) if self.memory is None else (len(self.memory.g), self.memory.stress.coefficients.shape[-1])
        return State(jnp.zeros(count), jnp.zeros(count[1]), drag.start(p[:2]), jnp.ones(()))

    def tick(self, state: State, p: Float[Array, "3"], dt: Float[Array, ""]) -> tuple[State, Float[Array, "3"]]:
        """State and force `dt` seconds later with the ball's centre at p; the path between is straight."""
        force, gone, now = self.elastic(p), state.gone, state.now
        elastic = force
        if self.memory is not None:
            now = self.factor * self._modes(self.memory.stress, p)
            x = dt / self.memory.tau
            decay = jnp.exp(-x)
            ramp = 1 - jnp.where(x > 1e-4, -jnp.expm1(-x) / jnp.where(x > 1e-4, x, 1.0), 1 - x / 2)
            gone = decay[:, None] * gone + (1 - decay)[:, None] * state.now + ramp[:, None] * (now - state.now)
            force = force + self._relaxed(p, self.memory.g @ gone)
            force = jnp.where(force[2] > 0, force, 0.0)  # tissue that lags behind a lifted ball does not pull it
        _, depth = self.place(p)
        share = jnp.where(depth > 0, jnp.minimum(state.share, self.within(p)), 1.0)
        # Hertz: the slope of the force is 1.5 force / depth; friction needs no better
        stiffness = 1.5 * elastic[2] / jnp.clip(depth, 1e-9, self.depth)
        extra, grip = drag.tick(
            self.rub, state.grip, p[:2], depth, force[2], stiffness, self.radius, self.depth, self.factor
        )
        grip = grip._replace(deepest=jnp.where(share > 0, grip.deepest, -1.0))
        return State(gone, now, grip, share), jnp.minimum(share, self.within(p)) * (force + extra)

    def _relaxed(self, p: Float[Array, "3"], load: Float[Array, " M"]) -> Float[Array, "3"]:
        """sum_m load_m de_m/dp; below the box it stays what it is at the floor."""
        place, inside, _ = self._scaled(p)
        table, xy = self.memory.strain, place[:2]
        e, ex, ey, es = (load @ table(place, axis) for axis in (None, 0, 1, 2))
        deeper = jnp.where(inside > 0, e + es * place[2] / 2, 0.0)
        tilt = jnp.stack([self.touch(xy, 0)[0], self.touch(xy, 1)[0]])
        aside = jnp.where(xy == p[:2], inside * jnp.stack([ex, ey]) + deeper * tilt, 0.0)
        return jnp.append(aside, -deeper)

    def respond(self, time: Float[Array, " n"], path: Float[Array, "n 3"]) -> Float[Array, "n 3"]:
        """Force on the ball along a path of its centre, N. Differentiable in path and tables."""
        steps = jnp.diff(time, prepend=time[:1])
        return jax.lax.scan(lambda state, now: self.tick(state, *now), self.start(path[0]), (path, steps))[1]

    def displacement(self, path: Float[Array, "n 3"], points: Float[Array, "k 2"]) -> Float[Array, "n k 3"]:
        """Displacement of points of the top, given by their parameters s and t, along a path, m."""
        nx, ny, nz = self.surface.counts
        top = self.surface.modes.reshape(-1, nx + 1, ny + 1, nz + 1, 3)[:, :, :, -1]

        def at(p):
            lines = self.surface.lines(self.place(p)[0])
            i, u = _between(lines[: nx + 1], points[:, 0])
            j, v = _between(lines[nx + 1 :], points[:, 1])
            moved = jnp.tensordot(self.shape(p), top, 1)
            u, v = u[:, None], v[:, None]
            low = (1 - u) * moved[i, j] + u * moved[i + 1, j]
            return (1 - v) * low + v * ((1 - u) * moved[i, j + 1] + u * moved[i + 1, j + 1])

        return jax.lax.map(at, path)

    def strength(self) -> float:
        """Of adhesion, Pa, that a surface which stays where it is would need to pull as hard; on the host."""
        return float(self.rub.strength) * float(drag.neck(self.rub, self.radius, self.factor))

    def put(self, changes: Mapping[str, Array]) -> "Surrogate":
        """A copy with leaves replaced by dotted path, e.g. {"factor": 1.1, "memory.g": g, "rub.friction": 0.2}."""
        made = self
        for path, value in changes.items():
            names = path.split(".")
            made = eqx.tree_at(lambda s: _leaf(s, names), made, jnp.asarray(value))  # noqa: B023
        return made


def _leaf(part, names):
    for name in names:
        part = getattr(part, name)
    return part


def _between(lines: Float[Array, " a"], at: Float[Array, " k"]) -> tuple[Int[Array, " k"], Float[Array, " k"]]:
    i = jnp.clip(jnp.searchsorted(lines, at) - 1, 0, len(lines) - 2)
    return i, jnp.clip((at - lines[i]) / (lines[i + 1] - lines[i]), 0.0, 1.0)


def host(surrogate: Surrogate) -> Surrogate:
    """The same with every array on the host."""
    return jax.tree.map(np.asarray, surrogate)

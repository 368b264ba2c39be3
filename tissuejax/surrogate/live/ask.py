"""A surrogate asked tick by tick on the host: numpy, no compilation, below a tenth of a millisecond a force."""

import math

import numpy as np
from jaxtyping import Float

from tissuejax.surrogate.cardinal import Table, four, four_slopes
from tissuejax.surrogate.drag import BREAK, MINDLIN, slipping
from tissuejax.surrogate.surrogate import FADE, Surrogate


class Plain:
    """One table, asked for values and slopes at a place. Numbers of an axis are Python's own: arrays of four cost more
    to call than to compute."""

    def __init__(self, table: Table):
        self.axes = [
            (float(o), 1 / float(h), n - 4)
            for o, h, n in zip(table.origin, table.spacing, table.coefficients.shape[:-1])
        ]
        self.c = np.asarray(table.coefficients, float)
        self.count = self.c.shape[-1]

    def _rows(self, place):
        """First coefficient, the four basis values and their slopes of each axis."""
        for at, (origin, per, last) in zip(place, self.axes):
            t = (at - origin) * per
            i = min(max(int(t), 0), last)
            u = t - i
            yield i, four(u), [per * d for d in four_slopes(u)]

    def _plan(self, place):
        (i, b, d), (j, e, f), *rest = self._rows(place)
        rows = [x * y for p, q in ((b, e), (d, e), (b, f)) for x in p for y in q]
        return i, j, np.array(rows).reshape(3, 16), rest

    def plan(self, place) -> list[float]:
        """Value and slopes by x, y of a table of one value over x, y."""
        i, j, rows, _ = self._plan(place)
        return (rows @ self.c[i : i + 4, j : j + 4].reshape(16)).tolist()

    def deep(self, place) -> np.ndarray:
        """Value and slopes by x, y, s, and the mixed slopes by x and s, y and s, (6, M), of a table over x, y, s."""
        i, j, rows, ((k, b, d),) = self._plan(place)
        some = (rows @ self.c[i : i + 4, j : j + 4, k : k + 4].reshape(16, -1)).reshape(3, 4, -1)
        return np.concatenate([np.array(b) @ some, np.array(d) @ some])

    def values(self, place) -> np.ndarray:
        """Values alone, (M,), of a table over x, y, s."""
        return self.values_at(self._plan(place))

    def values_at(self, plan) -> np.ndarray:
        """The same for a place that `_plan` has been asked for, in a table on these axes."""
        i, j, rows, ((k, b, _),) = plan
        return np.outer(rows[0], b).ravel() @ self.c[i : i + 4, j : j + 4, k : k + 4].reshape(64, -1)

    def loaded_at(self, plan, load: np.ndarray) -> list[float]:
        """Value and slopes by x, y, s of the sum of the M values times `load`, (M,)."""
        i, j, rows, ((k, b, d),) = plan
        some = rows @ (self.c[i : i + 4, j : j + 4, k : k + 4].reshape(64, -1) @ load).reshape(16, 4)
        return [*(some @ b).tolist(), float(some[0] @ d)]


class Asker:
    """The force under a hand: `tick` moves time on; the same as `Surrogate.tick`, for one ball.

    Attributes:
        place, depth: of the last tick. force: N.
    """

    def __init__(self, surrogate: Surrogate):
        s = surrogate
        self.low, self.high = np.asarray(s.low, float).tolist(), np.asarray(s.high, float).tolist()
        self.most, self.radius, self.factor = float(s.depth), float(s.radius), float(s.factor)
        self.touch, self.law, self.coefficients = Plain(s.touch), Plain(s.law), Plain(s.surface.coefficients)
        self.memory = None if s.memory is None else (Plain(s.memory.stress), Plain(s.memory.strain))
        self.g, self.tau = (
            (np.zeros(0),) * 2 if s.memory is None else (np.asarray(s.memory.g), np.asarray(s.memory.tau))
        )
        numbers = (float(v) for v in (s.rub.friction, s.rub.give, s.strength(), s.rub.reach))
        self.rub = type(s.rub)(*numbers, np.asarray(s.rub.slip, float), 0.0)
        self.rubs = float(self.rub.strength) > 0 or float(self.rub.friction) > 0
        self.rest()

    def rest(self) -> None:
        """Forget everything: rested, untouched tissue."""
        count = 0 if self.memory is None else self.memory[0].count
        self.gone, self.now = np.zeros((len(self.g), count)), np.zeros(count)
        self.steps = None, None  # the last dt, and what decays in it
        self.stretch, self.stiff, self.at, self.deepest = np.zeros(2), 0.0, None, -1.0
        self.share, self.free = 1.0, [1.0, 1.0]
        self.place = [(a + b) / 2 for a, b in zip(self.low, self.high)]
        self.depth, self.force = -1.0, np.zeros(3)

    def tick(self, p: Float[np.ndarray, "3"], dt: float) -> Float[np.ndarray, "3"]:
        """Force on the ball, its centre at p, `dt` seconds after the last tick."""
        at = [float(x) for x in p]
        xy = [min(max(x, low), high) for x, low, high in zip(at, self.low, self.high)]
        height, *tilt = self.touch.plan(xy)
        depth = height - at[2]
        within = self._within(math.hypot(at[0] - xy[0], at[1] - xy[1]) / FADE)
        self.share = min(self.share, within) if depth > 0 else 1.0
        self.place, self.depth, self.free = xy, depth, [float(a == b) for a, b in zip(at, xy)]
        inside, below = min(max(depth, 0.0), self.most), max(depth - self.most, 0.0)
        place = (*xy, math.sqrt(inside / self.most))
        force, stiffness = [0.0, 0.0, 0.0], 0.0
        if depth > 0:
            force, stiffness = self._elastic(place, below, tilt)
        if self.memory is not None:
            force = [a + b for a, b in zip(force, self._relaxed(place, inside, tilt, dt))]
            force = force if force[2] > 0 else [0.0, 0.0, 0.0]
        if self.rubs:
            force = [a + b for a, b in zip(force, self._drag(np.array(at[:2]), depth, force[2], stiffness))]
        self.force = min(self.share, within) * np.array(force)
        return self.force

    def shape(self) -> Float[np.ndarray, " M"]:
        """Coefficients of the displacement modes at the last tick, m."""
        inside = min(max(self.depth, 0.0), self.most)
        return inside * self.coefficients.values((*self.place, math.sqrt(inside / self.most)))

    @staticmethod
    def _within(r: float) -> float:
        return 1 - r**3 * (10 - 15 * r + 6 * r * r) if r < 1 else 0.0

    def _elastic(self, place, below, tilt):
        s, D = place[2], self.most
        w, wx, wy, ws, wxs, wys = (self.factor * self.law.deep(place)[:, 0]).tolist()
        deep, low = D**2.5 * s**5, below * D**1.5 / 2
        up = D**1.5 * s**3 * (5 * w + s * ws) / 2
        aside = (deep * wx + low * (5 * wx + wxs), deep * wy + low * (5 * wy + wys))
        force = [-f * (a + up * t) for f, a, t in zip(self.free, aside, tilt)]
        return [*force, up], 1.5 * up / max(s * s * D, 1e-9)

    def _relaxed(self, place, inside, tilt, dt):
        stress, strain = self.memory
        plan = stress._plan(place)  # the two tables have the same axes
        b = self.factor * inside * stress.values_at(plan)
        if dt != self.steps[0]:
            x = dt / self.tau
            decay = np.exp(-x)
            ramp = 1 - np.where(x > 1e-4, -np.expm1(-x) / np.maximum(x, 1e-300), 1 - x / 2)
            self.steps = dt, np.stack([decay, 1 - decay - ramp, ramp])[..., None]
        decay, left, ramp = self.steps[1]
        self.gone = decay * self.gone + left * self.now + ramp * b
        self.now = b
        if self.depth <= 0:
            return [0.0, 0.0, 0.0]
        e, ex, ey, es = strain.loaded_at(plan, self.g @ self.gone)
        deeper = e + es * place[2] / 2
        return [*(f * (inside * a + deeper * t) for f, a, t in zip(self.free, (ex, ey), tilt)), -deeper]

    def _drag(self, at, depth, normal, stiffness):
        rub, touching = self.rub, depth > 0
        last = at if self.at is None else self.at
        force = np.zeros(3)
        if float(rub.strength) > 0:
            if touching:
                self.deepest = max(self.deepest, depth)
            near = max(-depth, 0.0)
            if self.deepest >= 0:
                far = near + (self.deepest - max(depth, 0.0)) / 2
                bonds = _pull(far, float(rub.reach)) - _pull(near, float(rub.reach))
                force[2] = -2 * np.pi * self.radius * float(rub.strength) * bonds
            if near > BREAK * float(rub.reach) or self.share == 0:
                self.deepest = -1.0
        if float(rub.friction) > 0:
            k = MINDLIN * stiffness
            k = k / (1 + k * float(rub.give) / (np.pi * self.radius * max(depth, 1e-9)))
            keep = self.stiff / k if k > self.stiff else 1.0
            stretch = self.stretch * keep + at - last
            more = float(slipping(rub.slip, min(max(depth / self.most, 0.0), 1.0)))
            length, limit = np.sqrt(stretch @ stretch + 1e-30), float(rub.friction) * max(normal, 0.0) * more
            self.stretch = min(1.0, limit / max(k * length, 1e-30)) * stretch if touching and k > 0 else np.zeros(2)
            self.stiff, force[:2] = k, -k * self.stretch
        self.at = np.array(at)
        return force


def _pull(gap, reach):
    g = min(max(gap / reach, 0.0), BREAK)
    return reach * (np.e - (1 + g) * np.exp(1 - g))

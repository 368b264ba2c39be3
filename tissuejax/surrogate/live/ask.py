"""A surrogate asked tick by tick on the host: numpy, no compilation, some tens of microseconds a force."""

import numpy as np
from jaxtyping import Float

from tissuejax.surrogate.cardinal import Table, slopes, weights
from tissuejax.surrogate.drag import BREAK, MINDLIN
from tissuejax.surrogate.surrogate import FADE, Surrogate


class Plain:
    """One table, asked for values and slopes at a place by slices and two small products."""

    def __init__(self, table: Table):
        self.origin = np.asarray(table.origin, float)
        self.per = 1 / np.asarray(table.spacing, float)
        self.c = np.asarray(table.coefficients, float)
        self.last = np.array(self.c.shape[:-1]) - 4

    def basis(self, place):
        """First coefficient, basis and slope rows of each axis."""
        t = (place - self.origin) * self.per
        i = np.clip(t.astype(int), 0, self.last)
        u = t - i
        return i, weights(u, np), slopes(u, np) * self.per

    def plan(self, place) -> tuple[np.ndarray, np.ndarray]:
        """Values (M,) and slopes (2, M) of a table over x, y."""
        i, b, d = self.basis(place)
        part = self.c[i[0] : i[0] + 4, i[1] : i[1] + 4]
        rows = np.stack([np.outer(b[:, 0], b[:, 1]), np.outer(d[:, 0], b[:, 1]), np.outer(b[:, 0], d[:, 1])])
        out = rows.reshape(3, 16) @ part.reshape(16, -1)
        return out[0], out[1:]

    def deep(self, place) -> np.ndarray:
        """Value and slopes by x, y, s, and the mixed slopes by x and s, y and s, (6, M), of a table over x, y, s."""
        i, b, d = self.basis(place)
        part = self.c[i[0] : i[0] + 4, i[1] : i[1] + 4, i[2] : i[2] + 4]
        plan = np.stack([np.outer(b[:, 0], b[:, 1]), np.outer(d[:, 0], b[:, 1]), np.outer(b[:, 0], d[:, 1])]).reshape(
            3, 16
        )
        out = np.stack([b[:, 2], d[:, 2]]) @ (plan @ part.reshape(16, -1)).reshape(3, 4, -1)
        return np.stack([out[0, 0], out[1, 0], out[2, 0], out[0, 1], out[1, 1], out[2, 1]])


class Asker:
    """The force under a hand: `tick` moves time on; the same as `Surrogate.tick`, for one ball.

    Attributes:
        place, depth: of the last tick. force: N.
    """

    def __init__(self, surrogate: Surrogate):
        s = surrogate
        self.low, self.high = np.asarray(s.low, float), np.asarray(s.high, float)
        self.most, self.radius, self.factor = float(s.depth), float(s.radius), float(s.factor)
        self.touch, self.law, self.coefficients = Plain(s.touch), Plain(s.law), Plain(s.surface.coefficients)
        self.memory = None if s.memory is None else (Plain(s.memory.stress), Plain(s.memory.strain))
        self.g, self.tau = (
            (np.zeros(0),) * 2 if s.memory is None else (np.asarray(s.memory.g), np.asarray(s.memory.tau))
        )
        self.rub = type(s.rub)(*(float(v) for v in (s.rub.friction, s.rub.give, s.rub.strength, s.rub.reach)))
        self.rest()

    def rest(self) -> None:
        """Forget everything: rested, untouched tissue."""
        count = 0 if self.memory is None else self.memory[0].c.shape[-1]
        self.gone, self.now = np.zeros((len(self.g), count)), np.zeros(count)
        self.stretch, self.stiff, self.at, self.deepest = np.zeros(2), 0.0, None, -1.0
        self.place, self.depth, self.force = (self.low + self.high) / 2, -1.0, np.zeros(3)

    def tick(self, p: Float[np.ndarray, "3"], dt: float) -> Float[np.ndarray, "3"]:
        """Force on the ball, its centre at p, `dt` seconds after the last tick."""
        p = np.asarray(p, float)
        xy = np.minimum(np.maximum(p[:2], self.low), self.high)
        z0, tilt = self.touch.plan(xy)
        tilt, depth = tilt[:, 0], float(z0[0] - p[2])
        self.place, self.depth, self.free = xy, depth, p[:2] == xy
        fade, slide = self._fade(p[:2] - xy)
        inside, below = min(max(depth, 0.0), self.most), max(depth - self.most, 0.0)
        place = np.array([*xy, np.sqrt(inside / self.most)])
        force, stiffness = np.zeros(3), 0.0
        if depth > 0:
            force, stiffness = self._elastic(place, below, tilt, fade, slide)
        if self.memory is not None:
            force = force + self._relaxed(place, inside, tilt, fade, slide, dt)
            force = force if force[2] > 0 else np.zeros(3)
        self.force = force + fade * self._drag(p[:2], depth, force[2], stiffness)
        return self.force

    def shape(self) -> Float[np.ndarray, " M"]:
        """Coefficients of the displacement modes at the last tick, m."""
        inside = min(max(self.depth, 0.0), self.most)
        return inside * self.coefficients.deep(np.array([*self.place, np.sqrt(inside / self.most)]))[0]

    def _fade(self, beyond):
        r = float(np.hypot(*beyond)) / FADE
        if r == 0:
            return 1.0, np.zeros(2)
        if r >= 1:
            return 0.0, np.zeros(2)
        return 1 - r**3 * (10 - 15 * r + 6 * r * r), -30 * (r * (1 - r)) ** 2 * beyond / (r * FADE * FADE)

    def _elastic(self, place, below, tilt, fade, slide):
        s, D = place[2], self.most
        w, wx, wy, ws, wxs, wys = self.law.deep(place)[:, 0] * self.factor
        up = D**1.5 * s**3 * (5 * w + s * ws) / 2
        energy = D**2.5 * s**5 * w + below * up
        aside = (
            D**2.5 * s**5 * np.array([wx, wy]) + below * D**1.5 * (5 * np.array([wx, wy]) + np.array([wxs, wys])) / 2
        )
        force = np.array([*(-fade * self.free * (aside + up * tilt) - slide * energy), fade * up])
        return force, 1.5 * up / max(s * s * D, 1e-9)

    def _relaxed(self, place, inside, tilt, fade, slide, dt):
        b = self.factor * inside * self.memory[0].deep(place)[0]
        x = dt / self.tau
        decay = np.exp(-x)
        ramp = 1 - np.where(x > 1e-4, -np.expm1(-x) / np.maximum(x, 1e-300), 1 - x / 2)
        self.gone = decay[:, None] * self.gone + (1 - decay)[:, None] * self.now + ramp[:, None] * (b - self.now)
        self.now = b
        if self.depth <= 0:
            return np.zeros(3)
        e, ex, ey, es, *_ = self.memory[1].deep(place)
        load = self.g @ self.gone
        aside = inside * np.array([load @ ex, load @ ey])
        deeper = load @ e + load @ es * place[2] / 2
        along = fade * self.free * (aside + deeper * tilt) + slide * inside * (load @ e)
        return np.array([*along, -fade * deeper])

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
            if near > BREAK * float(rub.reach):
                self.deepest = -1.0
        if float(rub.friction) > 0:
            k = MINDLIN * stiffness
            k = k / (1 + k * float(rub.give) / (np.pi * self.radius * max(depth, 1e-9)))
            keep = self.stiff / k if k > self.stiff else 1.0
            stretch = self.stretch * keep + at - last
            length, limit = np.sqrt(stretch @ stretch + 1e-30), float(rub.friction) * max(normal, 0.0)
            self.stretch = min(1.0, limit / max(k * length, 1e-30)) * stretch if touching and k > 0 else np.zeros(2)
            self.stiff, force[:2] = k, -k * self.stretch
        self.at = np.array(at)
        return force


def _pull(gap, reach):
    g = min(max(gap / reach, 0.0), BREAK)
    return reach * (np.e - (1 + g) * np.exp(1 - g))

"""Paths of the probe over a body, the stops at which equilibrium is computed, and the way back to sampling times.

A path is straight between corners. Stops crowd around first touch, where the force has the most curvature; between
two corners force and markers are smooth and are interpolated by monotone cubics.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator

from tissuejax.challenge.lobe import Lobe


@dataclass(frozen=True)
class Path:
    """Corners of a path.

    Attributes:
        time: s, (c,).
        place: centre of the tip at the corners, m, (c, 3).
    """

    time: Float[np.ndarray, " c"]
    place: Float[np.ndarray, "c 3"]

    def at(self, t: np.ndarray) -> Float[np.ndarray, "n 3"]:
        """Centre at times t, m."""
        return np.stack([np.interp(t, self.time, x) for x in self.place.T], -1)


def gap(lobe: Lobe, centre: Float[np.ndarray, "n 3"], radius: float) -> Float[np.ndarray, " n"]:
    """Distance between a sphere and the undeformed top, m; negative inside."""
    s = np.linspace(-1, 1, 121)
    top = lobe.point(*np.meshgrid(s, s, indexing="ij"), np.ones((1, 1))).reshape(-1, 3)
    return np.array([np.sqrt(((top - c) ** 2).sum(1)).min() for c in np.atleast_2d(centre)]) - radius


def over(lobe: Lobe, site: tuple[float, float], radius: float) -> float:
    """Height of the centre at which a sphere above `site` (x, y in m) just touches, m."""
    low, high = 0.0, lobe.H * 2 + radius
    for _ in range(40):
        middle = (low + high) / 2
        inside = gap(lobe, np.array([[*site, middle]]), radius)[0] < 0
        low, high = (middle, high) if inside else (low, middle)
    return high


def draw(rng: np.random.Generator, lobe: Lobe, site: tuple[float, float], radius: float, style: str) -> Path:
    """A path of about 10 s. Styles: "side" (press, hold, glide sideways, hold), "twice" (shallow, then deep), "once",
    "oblique" (pressed in at a slant)."""
    touch = over(lobe, site, radius)
    start = touch + rng.uniform(4e-4, 8e-4)
    depth = rng.uniform(4.3e-3, 5.8e-3)
    speed = rng.uniform(2.0e-3, 4.5e-3)
    down = np.array([0.0, 0.0, -(depth + start - touch)])
    moves: list[tuple[np.ndarray, float]] = [(np.zeros(3), rng.uniform(0.6, 1.0))]

    def move(to: np.ndarray, rate: float) -> None:
        way = np.linalg.norm(to - moves[-1][0])
        moves.append((to, way / rate))

    def hold(seconds: float) -> None:
        moves.append((moves[-1][0], seconds))

    if style == "twice":
        move(down * rng.uniform(0.55, 0.7), speed)
        hold(rng.uniform(0.6, 1.0))
        move(down * 0.1, speed)
        hold(0.1)
    if style == "oblique":
        angle = rng.uniform(0, 2 * np.pi)
        down = down + np.array([np.cos(angle), np.sin(angle), 0]) * rng.uniform(1e-3, 2.5e-3)
    move(down, speed)
    hold(rng.uniform(2.5, 4.0))
    if style == "side":
        angle = rng.uniform(0, 2 * np.pi)
        down = down + np.array([np.cos(angle), np.sin(angle), 0]) * rng.uniform(2e-3, 3.6e-3)
        move(down, 0.6 * speed)
        hold(rng.uniform(1.5, 2.5))
    up = down * np.array([1, 1, 0]) + np.array([0, 0, rng.choice([0.0, 3e-4])])
    move(up, rng.uniform(0.7, 1.6) * speed)
    hold(rng.uniform(0.5, 0.9))
    place = np.array([*site, start]) + np.array([m for m, _ in moves])
    time = np.cumsum([d for _, d in moves])
    return Path(np.concatenate([[0.0], time]), np.concatenate([place[:1], place]))


def stops(
    path: Path, motion, lobe: Lobe, radius: float, stride: float, every: float | None
) -> tuple[Float[np.ndarray, " s"], list[np.ndarray]]:
    """Times of the stops while in reach of the body, and the same by straight piece of the path.

    Args:
        motion: (n,) times to (n, 3) centres relative to the body (a moving support is in it).
        stride: largest way between stops, m; a third of it just after first touch.
        every: longest time between stops, s; None where only places matter.
    """
    pieces = []
    for a, b in zip(path.time[:-1], path.time[1:]):
        fine = np.linspace(a, b, 241)
        where = motion(fine)
        near = gap(lobe, where[::12], radius)
        step = np.linalg.norm(np.diff(where, axis=0), axis=1)
        shallow = np.interp(fine[1:], fine[::12], near) > -8e-4
        count = np.concatenate([[0], np.cumsum(step / np.where(shallow, stride / 2.5, stride))])
        if every is not None:
            wait = np.minimum(every, 0.06 + 0.25 * (fine[1:] - a)) if np.ptp(where, 0).max() < 1e-9 else every
            count = np.maximum(count, np.concatenate([[0], np.cumsum(np.diff(fine) / wait)]))
        n = max(int(np.ceil(count[-1])), 1)
        t = np.interp(np.linspace(0, count[-1], n + 1), count, fine) if count[-1] > 0 else np.array([a, b])
        t[0], t[-1] = a, b
        pieces.append(t)
    return np.unique(np.concatenate(pieces)), pieces


def between(pieces: list[np.ndarray], at: Float[np.ndarray, " s"], values: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Values at the stops, interpolated to times `t` piece by piece."""
    out = np.empty((len(t), *values.shape[1:]))
    for k, piece in enumerate(pieces):
        inside = (t >= piece[0]) & ((t < piece[-1]) | (k == len(pieces) - 1))
        if inside.any():
            rows = values[np.searchsorted(at, piece)]
            out[inside] = PchipInterpolator(piece, rows, axis=0)(np.minimum(t[inside], piece[-1]))
    return out

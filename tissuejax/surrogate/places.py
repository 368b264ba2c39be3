"""Where a surrogate is tabulated: a box of places on the top and depths under them, checked against the organ."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.interpolate import RectBivariateSpline

from tissuejax.errors import InputError
from tissuejax.mesh.columns import Lobe
from tissuejax.surrogate.cardinal import Table, table, through

DEEPEST = 0.6  # of the thickness: below it the mesh under the probe is crushed and statics fails
RIM = 1.5  # probe radii that a place keeps from the rim
FINE_GRID = 1e-3  # m, spacing of the table of first contact
SPREAD = np.array([0.7548776662466927, 0.5698402909980532])  # additive recurrence that fills the plane (Roberts 2018)


class Box(NamedTuple):
    """Places x, y within `low` to `high`, m, and depths from first contact down to `depth`, m.

    `counts` sites along x and y, `depths` depths under each, at depth (k / depths)^2 for k = 1, 2, ...
    """

    low: Float[np.ndarray, "2"]
    high: Float[np.ndarray, "2"]
    depth: float
    counts: tuple[int, int]
    depths: int = 8

    @property
    def spacing(self) -> Float[np.ndarray, "2"]:
        """Between neighbouring sites, m."""
        return (self.high - self.low) / (np.asarray(self.counts) - 1)

    @property
    def levels(self) -> Float[np.ndarray, " k"]:
        """The depths, m."""
        return self.depth * (np.arange(1, self.depths + 1) / self.depths) ** 2

    def sites(self) -> Float[np.ndarray, "n m 2"]:
        """Every site, as a grid."""
        axes = [np.linspace(a, b, n) for a, b, n in zip(self.low, self.high, self.counts)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), -1)

    def held_out(self, count: int, seed: int = 0) -> Float[np.ndarray, "count 2"]:
        """Places between the sites at which the error is measured, spread evenly, none on a grid line of any level."""
        share = (0.5 + SPREAD * (np.arange(1, count + 1)[:, None] + seed)) % 1.0
        return self.low + (self.high - self.low) * share

    def refined(self) -> "Box":
        """With every interval between sites halved: all old sites are kept."""
        return self._replace(counts=tuple(2 * n - 1 for n in self.counts))


def surface_of(lobe: Lobe, size: int = 121) -> RectBivariateSpline:
    """Height of the top over the place in plan; beyond the rim it goes on as at the rim's height."""
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    grid = np.linspace(0, 1, size)
    x, y, z = lobe.x(grid, grid).ravel(), lobe.y(grid, grid).ravel(), lobe.top(grid, grid).ravel()
    place = np.stack([x, y], 1)
    axes = [np.linspace(v.min(), v.max(), size) for v in (x, y)]
    wanted = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 2)
    height = LinearNDInterpolator(place, z)(wanted)
    height = np.where(np.isfinite(height), height, NearestNDInterpolator(place, z)(wanted))
    return RectBivariateSpline(*axes, height.reshape(size, size))


def first_contact(lobe: Lobe, box: Box, radius: float) -> Table:
    """Height of the ball's centre at which it first touches, over the place, m.

    z(x, y) = max over v of top(v) + sqrt(R^2 - |v - (x, y)|^2), found by Newton from the highest of a fan of points.
    """
    top = surface_of(lobe)
    counts = [max(2, int(np.ceil(w / FINE_GRID - 1e-9)) + 1) for w in box.high - box.low]
    axes = [np.linspace(a, b, n) for a, b, n in zip(box.low, box.high, counts)]
    place = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 2)
    ring = np.linspace(0, 0.95, 20)[:, None] * radius
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    fan = np.stack([ring * np.cos(angle), ring * np.sin(angle)], -1).reshape(-1, 2)
    height = top.ev(*(place[:, None] + fan).transpose(2, 0, 1)) + np.sqrt(radius**2 - (fan**2).sum(1))
    v = fan[height.argmax(1)]
    for _ in range(12):
        root = np.sqrt(radius**2 - (v**2).sum(1))
        at = (place + v).T
        gradient = np.stack([top.ev(*at, dx=1), top.ev(*at, dy=1)], 1) - v / root[:, None]
        cross = top.ev(*at, dx=1, dy=1)
        bent = np.array([[top.ev(*at, dx=2), cross], [cross, top.ev(*at, dy=2)]]).transpose(2, 0, 1)
        bent = bent - np.eye(2) / root[:, None, None] - v[:, :, None] * v[:, None] / root[:, None, None] ** 3
        step = np.linalg.solve(bent, gradient[..., None])[..., 0]
        v = np.clip(v - np.clip(step, -0.2 * radius, 0.2 * radius), -0.69 * radius, 0.69 * radius)
    height = np.maximum(height.max(1), top.ev(*(place + v).T) + np.sqrt(radius**2 - (v**2).sum(1)))
    spacing = [a[1] - a[0] for a in axes]
    return table(box.low, spacing, height.reshape(*counts, 1), [through(n) for n in counts])


def rim_distance(lobe: Lobe, places: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
    """How far each place is inside the rim of the organ in plan, m; negative outside."""
    edge = np.linspace(0, 1, 401)
    zero, one = np.zeros_like(edge), np.ones_like(edge)
    s, t = np.concatenate([edge, one, edge[::-1], zero]), np.concatenate([zero, edge, one, edge[::-1]])
    rim = np.stack([lobe.x.ev(s, t), lobe.y.ev(s, t)], 1)
    away = np.linalg.norm(places[:, None] - rim, axis=2).min(1)
    a, b = rim[None] - places[:, None], np.roll(rim, -1, 0)[None] - places[:, None]
    turn = np.arctan2(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0], (a * b).sum(2)).sum(1)
    return np.where(np.abs(turn) > np.pi, away, -away)


def whole_top(lobe: Lobe, radius: float) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
    """The largest upright rectangle of places that keep their distance from the rim; the shape of a table."""
    grid = np.linspace(0, 1, 21)
    x, y = lobe.x(grid, grid), lobe.y(grid, grid)
    axes = [np.linspace(v.min(), v.max(), 41) for v in (x, y)]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    free = (rim_distance(lobe, places.reshape(-1, 2)) >= RIM * radius).reshape(41, 41)
    best, found = 0.0, None
    for i in range(41):
        column = np.ones(41, bool)
        for j in range(i, 41):
            column &= free[j]
            runs = np.split(np.arange(41), np.flatnonzero(np.diff(column.astype(int))) + 1)
            for run in (r for r in runs if column[r[0]]):
                area = (axes[0][j] - axes[0][i]) * (axes[1][run[-1]] - axes[1][run[0]])
                if area > best:
                    low, high = (axes[0][i], axes[1][run[0]]), (axes[0][j], axes[1][run[-1]])
                    best, found = area, (np.array(low), np.array(high))
    if found is None:
        raise InputError(
            f"no place keeps {1e3 * RIM * radius:.1f} mm from the rim: the organ is too small for this probe"
        )
    return found


def checked(box: Box, lobe: Lobe, radius: float) -> Box:
    """`box`, if the organ holds it.

    Raises:
        InputError: a place outside the organ or near its rim, a depth beyond what the thickness allows.
    """
    if not (box.depth > 0 and (box.high > box.low).all()):
        raise InputError(
            f"a box of {1e3 * (box.high - box.low)} mm and depth {1e3 * box.depth:g} mm: all must be positive"
        )
    corners = box._replace(counts=(9, 9)).sites().reshape(-1, 2)
    room = rim_distance(lobe, corners)
    worst = int(room.argmin())
    if room[worst] < RIM * radius - 1e-9:
        x, y = 1e3 * corners[worst]
        where = "outside the organ" if room[worst] < 0 else f"{1e3 * room[worst]:.1f} mm from its rim"
        raise InputError(
            f"the box of places reaches ({x:.1f}, {y:.1f}) mm, {where}; places must keep {RIM:g} probe radii "
            f"({1e3 * RIM * radius:.1f} mm) from the rim: choose another --site or a smaller --reach"
        )
    within_depth(lobe, corners, box.depth)
    return box


def within_depth(lobe: Lobe, places: Float[np.ndarray, "n 2"], depth: float) -> None:
    """Nothing, if the organ is there and thick enough for the depth at all places.

    Raises:
        InputError: it is not.
    """
    away = rim_distance(lobe, places)
    if away.min() <= 0:
        x, y = 1e3 * places[int(away.argmin())]
        raise InputError(f"place ({x:.1f}, {y:.1f}) mm is outside the organ: choose another --site")
    if not 0 < depth < np.inf:
        raise InputError(f"depth {1e3 * depth:g} mm: wanted is a length over 0")
    thickness = np.array([_thickness(lobe, p) for p in places])
    thin = int(thickness.argmin())
    if depth > DEEPEST * thickness[thin]:
        x, y = 1e3 * places[thin]
        raise InputError(
            f"depth {1e3 * depth:.1f} mm is over {100 * DEEPEST:.0f} % of the thickness at ({x:.1f}, {y:.1f}) mm, "
            f"{1e3 * thickness[thin]:.1f} mm: take --depth {1e3 * DEEPEST * thickness[thin]:.1f} mm or less"
        )


def _thickness(lobe: Lobe, place) -> float:
    s, t = lobe.parameters_of(place)
    return float(lobe.top.ev(s, t) - lobe.bottom.ev(s, t))

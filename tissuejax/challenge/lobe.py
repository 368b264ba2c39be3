"""The body of a probing case: a smooth lobe given by formulas, so that a coarse file mesh and a fine graded one agree.

A point has parameters (xi, eta, zeta) in [-1, 1]^2 x [0, 1]:

    x = a xi (1 - c eta^2),  y = b eta (1 - c xi^2),  z = zeta h(xi, eta)
    h = H (rim + (1 - rim) ((1 - xi^2) (1 - eta^2))^p) (1 + tilt_x xi + tilt_y eta) + bumps.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int


@dataclass(frozen=True)
class Lobe:
    """Shape of a body; lengths in m.

    Attributes:
        a, b: half lengths of the footprint.
        c: how much its sides bulge.
        H: height in the middle; `rim` its share at the rim.
        p: how boxy the top is.
        tilt: slopes of the top.
        bumps: rows (xi, eta, width, height).
    """

    a: float
    b: float
    c: float
    H: float
    rim: float
    p: float
    tilt: tuple[float, float]
    bumps: tuple[tuple[float, float, float, float], ...] = ()

    def height(self, xi: np.ndarray, eta: np.ndarray) -> np.ndarray:
        """Top surface over the parameters, m."""
        dome = np.maximum((1 - xi**2) * (1 - eta**2), 0.0) ** self.p
        h = self.H * (self.rim + (1 - self.rim) * dome) * (1 + self.tilt[0] * xi + self.tilt[1] * eta)
        for x, y, width, up in self.bumps:
            h = h + up * np.exp(-((xi - x) ** 2 + (eta - y) ** 2) / (2 * width**2))
        return h

    def point(self, xi: np.ndarray, eta: np.ndarray, zeta: np.ndarray) -> Float[np.ndarray, "... 3"]:
        """Position of parameters, m."""
        x = self.a * xi * (1 - self.c * eta**2)
        y = self.b * eta * (1 - self.c * xi**2)
        return np.stack(np.broadcast_arrays(x, y, zeta * self.height(xi, eta)), -1)

    def parameters(self, x: float, y: float) -> tuple[float, float]:
        """(xi, eta) above a place of the support, by fixed point."""
        xi, eta = x / self.a, y / self.b
        for _ in range(60):
            xi, eta = x / (self.a * (1 - self.c * eta**2)), y / (self.b * (1 - self.c * xi**2))
        return float(xi), float(eta)

    def volume(self, n: int = 200) -> float:
        """Volume by the midpoint rule, m^3."""
        s = (np.arange(n) + 0.5) / n * 2 - 1
        xi, eta = np.meshgrid(s, s, indexing="ij")
        xx = self.a * (1 - self.c * eta**2)
        xy = -2 * self.a * self.c * xi * eta
        yx = -2 * self.b * self.c * xi * eta
        yy = self.b * (1 - self.c * xi**2)
        return float(np.sum(self.height(xi, eta) * (xx * yy - xy * yx)) * (2 / n) ** 2)


@dataclass(frozen=True)
class Grid:
    """Hexes on a grid of parameters. Node (i, j, k) has the number (i (ny + 1) + j) (nz + 1) + k.

    Attributes:
        xi, eta, zeta: parameters of the grid lines.
        points: node positions, m.
        cells: nodes of each hex, meshio order.
    """

    xi: Float[np.ndarray, " nx+1"]
    eta: Float[np.ndarray, " ny+1"]
    zeta: Float[np.ndarray, " nz+1"]
    points: Float[np.ndarray, "N 3"]
    cells: Int[np.ndarray, "E 8"]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Nodes along each direction."""
        return len(self.xi), len(self.eta), len(self.zeta)

    @property
    def base(self) -> Int[np.ndarray, " F"]:
        """Nodes on the support."""
        return np.arange(self.shape[0] * self.shape[1]) * self.shape[2]

    @property
    def top(self) -> Int[np.ndarray, "q 4"]:
        """Nodes of the top facets, counter-clockwise from outside, in the order of their columns of hexes."""
        return self.cells.reshape(len(self.xi) - 1, len(self.eta) - 1, len(self.zeta) - 1, 8)[:, :, -1, 4:].reshape(
            -1, 4
        )

    def on_top(self, xi: float, eta: float) -> tuple[np.ndarray, np.ndarray]:
        """(four nodes, their weights) of the surface point with these parameters, bilinear."""
        i = int(np.clip(np.searchsorted(self.xi, xi) - 1, 0, len(self.xi) - 2))
        j = int(np.clip(np.searchsorted(self.eta, eta) - 1, 0, len(self.eta) - 2))
        r = (xi - self.xi[i]) / (self.xi[i + 1] - self.xi[i])
        s = (eta - self.eta[j]) / (self.eta[j + 1] - self.eta[j])
        ny, nz = self.shape[1:]
        nodes = [((i + a) * ny + j + b) * nz + nz - 1 for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
        return np.array(nodes), np.array([(1 - r) * (1 - s), r * (1 - s), r * s, (1 - r) * s])


def grid(lobe: Lobe, xi: np.ndarray, eta: np.ndarray, zeta: np.ndarray) -> Grid:
    """Hexes between the given grid lines."""
    nx, ny, nz = len(xi), len(eta), len(zeta)
    points = lobe.point(xi[:, None, None], eta[None, :, None], zeta[None, None, :]).reshape(-1, 3)
    i, j, k = (m.ravel() for m in np.meshgrid(np.arange(nx - 1), np.arange(ny - 1), np.arange(nz - 1), indexing="ij"))

    def node(a: int, b: int, c: int) -> np.ndarray:
        return ((i + a) * ny + j + b) * nz + k + c

    corners = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))
    return Grid(xi, eta, zeta, points, np.stack([node(*c) for c in corners], -1))


def uniform(lobe: Lobe, nx: int = 22, ny: int = 20, nz: int = 7) -> Grid:
    """The mesh that the file holds."""
    return grid(lobe, np.linspace(-1, 1, nx + 1), np.linspace(-1, 1, ny + 1), np.linspace(0, 1, nz + 1))


def graded(
    lobe: Lobe, site: tuple[float, float], nx: int, ny: int, nz: int, fine: float = 0.3, reach: float = 0.22
) -> Grid:
    """A mesh whose lines crowd around a site and under the top.

    Args:
        site: (xi, eta) under the probe.
        fine: spacing at the site over that far away.
        reach: half width of the fine region, in parameters.
    """

    def crowded(n: int, at: float) -> np.ndarray:
        s = np.linspace(-1, 1, 4001)
        density = 1 + (1 / fine - 1) * np.exp(-(((s - at) / reach) ** 4))
        total = np.concatenate([[0], np.cumsum((density[1:] + density[:-1]) / 2)])
        return np.interp(np.linspace(0, 1, n + 1), total / total[-1], s)

    t = np.linspace(0, 1, nz + 1)
    return grid(lobe, crowded(nx, site[0]), crowded(ny, site[1]), 1.6 * t - 0.6 * t**2)

"""What acts on the surface of a probed body: a rigid sphere at 3x3 points of each facet, and a membrane.

The sphere presses by penalty on reference areas, can rub (Coulomb, with a stiff tangential spring and a return map) and
can hold on after touching: traction s0 (s / d) exp(1 - s / d) over the gap s (Xu and Needleman 1994, normal part).
The membrane is a St. Venant-Kirchhoff sheet in plane stress over the top facets.
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int

from tissuejax.challenge.lobe import Grid

PENALTY = 5e8  # Pa/m: 3 kPa sinks in 6 micrometres
STICK = 3e7  # Pa/m: 300 Pa of friction give way by 10 micrometres before they slide
ALONG = (0.05, 0.3, 1.0)  # of the secant stiffness along sliding: the true one is nothing, and may chatter


def facet_points(order: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bilinear shape values (q, 4), slopes (q, 4, 2) and weights (q,) at Gauss points of the square [-1, 1]^2."""
    s, w = np.polynomial.legendre.leggauss(order)
    r, t = (m.ravel() for m in np.meshgrid(s, s, indexing="ij"))
    c = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    N = (1 + r[:, None] * c[:, 0]) * (1 + t[:, None] * c[:, 1]) / 4
    dN = np.stack([c[:, 0] * (1 + t[:, None] * c[:, 1]) / 4, c[:, 1] * (1 + r[:, None] * c[:, 0]) / 4], -1)
    return N, dN, np.outer(w, w).ravel()


@dataclass
class Sphere:
    """The probe against those facets that it can reach.

    Attributes:
        friction: Coulomb's coefficient.
        caution: which of `ALONG` steers Newton's method.
        pull: largest adhesive traction, Pa; `range` the gap at which it acts, m.
    """

    grid: Grid
    facets: Int[np.ndarray, "f 4"]
    radius: float
    friction: float = 0.0
    pull: float = 0.0
    range: float = 2e-4
    slip: np.ndarray | None = None
    last: np.ndarray | None = None
    touched: np.ndarray | None = field(default=None)
    caution: int = 0

    def __post_init__(self):
        self.N, dN, w = facet_points(3)
        x = self.grid.points[self.facets]
        tangents = np.einsum("qai,fad->fqid", dN, x)
        normal = np.cross(tangents[:, :, 0], tangents[:, :, 1])
        self.area = np.linalg.norm(normal, axis=-1) * w
        if self.touched is None:
            self.touched = np.zeros(self.area.shape, bool)

    def state(self, u: Float[np.ndarray, "N 3"], centre: Float[np.ndarray, "3"], tangent: bool) -> dict:
        """Residual on the facets' nodes (f, 4, 3), tangents, the force on the probe, and what is left behind."""
        x = np.einsum("qa,fad->fqd", self.N, (self.grid.points + u)[self.facets])
        d = x - centre
        dist = np.linalg.norm(d, axis=-1)
        n = d / dist[..., None]
        pen = self.radius - dist
        inside = pen > 0
        pressure = np.where(inside, PENALTY * pen, 0.0)
        slope = np.where(inside, PENALTY, 0.0)
        if self.pull:
            s = np.maximum(-pen, 0) / self.range
            on = self.touched & ~inside & (s < 8)
            pressure = np.where(on, -self.pull * s * np.exp(1 - s), pressure)
            slope = np.where(on, np.maximum(self.pull / self.range * (1 - s) * np.exp(1 - s), 0.0), slope)
        t = -pressure[..., None] * n  # derivative of the contact energy by x
        left = {"touched": self.touched | inside, "x": d}
        K = None
        if tangent:
            nn = n[..., :, None] * n[..., None, :]
            across = np.eye(3) - nn
            K = slope[..., None, None] * nn - (pressure / dist)[..., None, None] * across
        if self.friction:
            moved = d - self.last if self.last is not None else np.zeros_like(d)
            trial = (self.slip if self.slip is not None else 0) + moved
            trial = trial - np.einsum("fqd,fqd->fq", trial, n)[..., None] * n
            trial = np.where((pressure > 0)[..., None], trial, 0.0)
            size = np.linalg.norm(trial, axis=-1)
            limit = self.friction * np.maximum(pressure, 0)
            slides = STICK * size > limit
            share = np.where(slides, limit / np.maximum(STICK * size, 1e-30), 1.0)
            left["slip"] = share[..., None] * trial
            t = t + STICK * left["slip"]
            if tangent:
                # symmetric part of the consistent tangent (the rest, friction that grows with pressure, is left to
                # the iteration): none along the direction of sliding
                stiff = np.where(pressure > 0, STICK * share, 0.0)
                way = trial / np.maximum(size, 1e-30)[..., None]
                less = np.where(slides, (1 - ALONG[self.caution]) * stiff, 0.0)
                K = K + stiff[..., None, None] * across - less[..., None, None] * way[..., :, None] * way[..., None, :]
        weighted = t * self.area[..., None]
        left["f"] = np.einsum("qa,fqd->fad", self.N, weighted)
        left["probe"] = weighted.sum((0, 1))
        if tangent:
            on = np.flatnonzero(np.any((slope != 0) | (pressure != 0), axis=1))
            NN = self.N[:, :, None] * self.N[:, None, :]
            left["K"] = np.zeros((len(self.facets), 12, 12))
            some = np.einsum("qab,fqij->faibj", NN, K[on] * self.area[on][..., None, None])
            left["K"][on] = some.reshape(-1, 12, 12)
        return left

    def accept(self, left: dict) -> None:
        """Remember a step."""
        self.touched, self.last = left["touched"], left["x"]
        if self.friction:
            self.slip = left["slip"]


@dataclass
class Membrane:
    """A thin sheet grown onto the top.

    Attributes:
        stiffness: thickness times Young's modulus, N/m.
        poisson: Poisson's ratio.
    """

    grid: Grid
    stiffness: float
    poisson: float = 0.45

    def __post_init__(self):
        N, dN, w = facet_points(2)
        x = self.grid.points[self.grid.top]
        a = np.einsum("qai,fad->fqid", dN, x)
        e1 = a[:, :, 0] / np.linalg.norm(a[:, :, 0], axis=-1, keepdims=True)
        normal = np.cross(a[:, :, 0], a[:, :, 1])
        area = np.linalg.norm(normal, axis=-1)
        e2 = np.cross(normal / area[..., None], e1)
        local = np.einsum("fqid,fqkd->fqik", a, np.stack([e1, e2], 2))  # parameters -> lengths
        self.B = np.einsum("qai,fqki->fqak", dN, np.linalg.inv(local))
        self.w = area * w
        k = self.stiffness / (1 - self.poisson**2)
        self.lam, self.mu = k * self.poisson, k * (1 - self.poisson) / 2

    def state(self, u: Float[np.ndarray, "N 3"], tangent: bool) -> dict:
        """Residual on the facets' nodes (f, 4, 3), tangents (f, 12, 12) and energy."""
        x = (self.grid.points + u)[self.grid.top]
        a = np.einsum("fqak,fad->fqkd", self.B, x)
        E = (np.einsum("fqkd,fqld->fqkl", a, a) - np.eye(2)) / 2
        trace = E[..., 0, 0] + E[..., 1, 1]
        S = self.lam * trace[..., None, None] * np.eye(2) + 2 * self.mu * E
        Sw = S * self.w[..., None, None]
        left = {"f": np.einsum("fqkl,fqak,fqld->fad", Sw, self.B, a)}
        left["energy"] = float(np.sum(Sw * E) / 2)
        if tangent:
            geometric = np.einsum("fqkl,fqak,fqbl->fab", Sw, self.B, self.B)
            K = np.einsum("fab,ij->faibj", geometric, np.eye(3))
            Ba = np.einsum("fqak,fqki->fqai", self.B, a)
            K += self.lam * np.einsum("fq,fqai,fqbj->faibj", self.w, Ba, Ba)
            BB = np.einsum("fqak,fqbk->fqab", self.B, self.B)
            aa = np.einsum("fqki,fqkj->fqij", a, a)
            K += self.mu * np.einsum("fq,fqab,fqij->faibj", self.w, BB, aa)
            K += self.mu * np.einsum("fq,fqaj,fqbi->faibj", self.w, Ba, Ba)
            left["K"] = K.reshape(-1, 12, 12)
        return left

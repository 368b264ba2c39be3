"""Equilibrium of a probed body along a path of the probe: Newton's method with a banded Cholesky factor.

Nodes are numbered so that the tangent is a band; the support is a bed of springs, stiff where tissue is held, softer
(and with a yield) sideways where it can slip.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.linalg import lapack

from tissuejax.challenge.solid import Solid
from tissuejax.challenge.touch import Membrane, Sphere
from tissuejax.errors import NotConverged

HELD = 1e6  # N/m per node
CLOSE = 1e-5  # N, largest residual of a node: of the force a hundredth of the noise
SLOW = 0.5  # of the residual left by an iteration: the body's tangent is computed anew


@dataclass
class Bed:
    """Springs under the base.

    Attributes:
        sideways: N/m^3; None is held.
        strength: largest shear traction, Pa; None never slips.
    """

    sideways: float | None = None
    strength: float | None = None
    slid: np.ndarray | float = 0.0


class Band:
    """Lower band of a symmetric matrix assembled from blocks."""

    def __init__(self, nodes_of: dict[str, np.ndarray], n_nodes: int):
        dofs = {k: (3 * v[:, :, None] + np.arange(3)).reshape(len(v), -1) for k, v in nodes_of.items()}
        self.n = 3 * n_nodes
        self.width = max(int((d.max(1) - d.min(1)).max()) for d in dofs.values() if len(d))
        self.keep, self.at = {}, {}
        for k, d in dofs.items():
            row, col = np.broadcast_arrays(d[:, :, None], d[:, None, :])
            self.keep[k] = (row >= col).ravel()
            self.at[k] = (col * (self.width + 1) + row - col).ravel()[self.keep[k]]
        self.dofs = dofs

    def matrix(self, name: str, K: np.ndarray, diagonal: np.ndarray) -> np.ndarray:
        """Blocks of one kind and a diagonal as a flat band, column after column, in single precision."""
        size = self.n * (self.width + 1)
        flat = np.bincount(self.at[name], K.ravel()[self.keep[name]], size).astype(np.float32)
        flat[:: self.width + 1] += diagonal.astype(np.float32)
        return flat

    def added(self, flat: np.ndarray, blocks: dict[str, np.ndarray]) -> np.ndarray:
        """(width + 1, n) lower band in Fortran order: a flat one and (few) further blocks."""
        flat = flat.copy()
        for k, K in blocks.items():
            np.add.at(flat, self.at[k], K.ravel()[self.keep[k]].astype(np.float32))
        return flat.reshape(self.n, self.width + 1).T

    def vector(self, blocks: dict[str, np.ndarray]) -> np.ndarray:
        """Sum of block forces, (n,)."""
        total = np.zeros(self.n)
        for k, f in blocks.items():
            total += np.bincount(self.dofs[k].ravel(), f.ravel(), self.n)
        return total


@dataclass
class Bench:
    """A body on its bed under a probe."""

    solid: Solid
    sphere: Sphere
    bed: Bed
    membrane: Membrane | None = None

    def __post_init__(self):
        grid = self.solid.grid
        blocks = {"solid": grid.cells, "sphere": self.sphere.facets}
        if self.membrane:
            blocks["membrane"] = grid.top
        self.band = Band(blocks, len(grid.points))
        self.u = np.zeros_like(grid.points)
        nx, ny, _ = grid.shape
        size = np.zeros(len(grid.points))
        base = grid.cells.reshape(nx - 1, ny - 1, -1, 8)[:, :, 0, :4].reshape(-1, 4)
        x = grid.points[base]
        areas = np.abs(np.cross((x[:, 2] - x[:, 0])[:, :2], (x[:, 3] - x[:, 1])[:, :2])) / 2
        np.add.at(size, base, areas[:, None] / 4)
        self.base, self.size = grid.base, size[grid.base]
        self.factorizations = 0

    def _bed(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Residual (N, 3), diagonal stiffness (N, 3) and the slide of the base nodes."""
        f, k = np.zeros_like(u), np.zeros_like(u)
        at = u[self.base]
        stiff = np.full(at.shape, HELD)
        slid = np.zeros_like(at)
        if self.bed.sideways is not None:
            stiff[:, :2] = (self.bed.sideways * self.size)[:, None]
            slid = np.zeros_like(at) + self.bed.slid
            if self.bed.strength is not None:
                force = np.linalg.norm((stiff * (at - slid))[:, :2], axis=1)
                over = np.maximum(1 - self.bed.strength * self.size / np.maximum(force, 1e-30), 0)
                slid[:, :2] += over[:, None] * (at - slid)[:, :2]
        f[self.base] = stiff * (at - slid)
        k[self.base] = stiff
        return f, k, slid

    def _all(self, u: np.ndarray, centre: np.ndarray, dt: float) -> dict:
        parts = {"solid": self.solid.state(u, dt, False)}
        if "bad" in parts["solid"]:
            return {"bad": True}
        parts["sphere"] = self.sphere.state(u, centre, True)
        if self.membrane:
            parts["membrane"] = self.membrane.state(u, False)
        f, k, slid = self._bed(u)
        r = self.band.vector({n: p["f"] for n, p in parts.items()}) + f.ravel()
        return {"r": r, "slid": slid, "parts": parts, "bed": k.ravel()}

    def _body(self, u: np.ndarray, now: dict, dt: float) -> np.ndarray:
        """Tangent of all but the contact, as a flat band."""
        flat = self.band.matrix("solid", self.solid.state(u, dt, True)["K"], now["bed"])
        if self.membrane:
            flat += self.band.matrix("membrane", self.membrane.state(u, True)["K"], np.zeros(self.band.n))
        return flat

    def step(
        self, centre: Float[np.ndarray, "3"], dt: float, guess: np.ndarray | None = None
    ) -> Float[np.ndarray, "3"]:
        """Move the probe to `centre` within `dt` and return the force on it, N.

        The tangent of the body, which costs most, is kept over iterations as long as they converge well; that of the
        contact is always new.

        Raises:
            NotConverged: no equilibrium found.
        """
        u = self.u if guess is None else guess
        now = self._all(u, centre, dt)
        if "bad" in now or guess is not None and np.abs(now["r"]).max() > 50:
            u = self.u
            now = self._all(u, centre, dt)
        body = None
        for iteration in range(48):
            self.sphere.caution = min(iteration // 12, 2)
            worst = np.abs(now["r"]).max()
            if worst < CLOSE:
                self._accept(u, now)
                return now["parts"]["sphere"]["probe"]
            if body is None:
                body = self._body(u, now, dt)
            du = self._solve(self.band.added(body, {"sphere": now["parts"]["sphere"]["K"]}), now["r"])
            size = np.abs(du).max()
            cut = min(1.0, 1.5e-3 / size)
            for _ in range(12):
                trial = self._all(u - cut * du.reshape(u.shape), centre, dt)
                if "bad" not in trial and np.abs(trial["r"]).max() < max(30 * worst, 1.0):
                    break
                cut /= 3
            else:
                break
            u, now = u - cut * du.reshape(u.shape), trial
            if np.abs(now["r"]).max() > SLOW * worst:
                body = None
        raise NotConverged(f"probed body: no equilibrium (largest residual {np.abs(now['r']).max():.2g} N)")

    def _solve(self, band: np.ndarray, r: np.ndarray) -> np.ndarray:
        self.factorizations += 1
        shift = 0.0
        for _ in range(8):
            trial = band.copy(order="F")
            trial[0] += np.float32(shift)
            factor, info = lapack.spbtrf(trial, lower=1, overwrite_ab=1)
            if info == 0:
                return lapack.spbtrs(factor, r.astype(np.float32), lower=1)[0].astype(float)
            shift = max(10 * shift, 0.05)
        raise NotConverged("probed body: the tangent stays indefinite")

    def _accept(self, u: np.ndarray, now: dict) -> None:
        self.u = u
        self.solid.accept(now["parts"]["solid"])
        self.sphere.accept(now["parts"]["sphere"])
        self.bed.slid = now["slid"]

    def follow(
        self,
        times: Float[np.ndarray, " s"],
        centres: Float[np.ndarray, "s 3"],
        watch: Callable[[np.ndarray], np.ndarray] | None = None,
    ) -> tuple[Float[np.ndarray, "s 3"], np.ndarray]:
        """Forces (and what `watch` reads off the displacements) at every stop of a path that begins out of touch."""
        forces, seen = [], []
        before, moved = None, None
        for i, (t, c) in enumerate(zip(times, centres)):
            dt = t - times[i - 1] if i else max(t, 1e-3)
            start = self.u.copy()
            guess = None
            if moved is not None and i and before is not None:
                way, last = np.linalg.norm(c - centres[i - 1]), np.linalg.norm(centres[i - 1] - centres[i - 2])
                turn = (c - centres[i - 1]) @ (centres[i - 1] - centres[i - 2])
                if last > 1e-9 and way > 1e-9 and turn > 0.9 * way * last:
                    guess = self.u + moved * min(way / last, 1.5)
            forces.append(self._reach(centres[i - 1] if i else c, c, dt, guess))
            seen.append(watch(self.u) if watch else None)
            before, moved = start, self.u - start
        return np.array(forces), np.array(seen)

    def _reach(self, a: np.ndarray, b: np.ndarray, dt: float, guess: np.ndarray | None, depth: int = 0) -> np.ndarray:
        try:
            return self.step(b, dt, guess)
        except NotConverged:
            if depth == 5:
                raise
            middle = (a + b) / 2
            self._reach(a, middle, dt / 2, None, depth + 1)
            return self._reach(middle, b, dt / 2, None, depth + 1)

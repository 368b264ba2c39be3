"""Equilibrium of a probed body along a path of the probe: Newton's method with a banded Cholesky factor that is kept.

Nodes are numbered so that the tangent is a band (`banded`); the support is a bed of springs, stiff where tissue is
held, softer (and with a yield) sideways where it can slip.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tissuejax.challenge.banded import Band, Kept
from tissuejax.challenge.solid import Solid
from tissuejax.challenge.touch import Membrane, Sphere
from tissuejax.errors import NotConverged

HELD = 1e6  # N/m per node
CLOSE = 2e-6  # N, largest residual of a node: half a micrometre, and of the force less than a hundredth of the noise
PATIENCE = 5.0  # iterations still to come, at the last one's pace, from which a new tangent of the body costs less
BLAMED = 0.3  # of the residual left: what the kept tangent of the body gets wrong; the rest is the contact's doing


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
        self.kept: Kept | None = None
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
        body = self.band.vector({n: p["f"] for n, p in parts.items() if n != "sphere"}) + f.ravel()
        r = body + self.band.vector({"sphere": parts["sphere"]["f"]})
        return {"r": r, "body": body, "slid": slid, "parts": parts, "bed": k.ravel()}

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

        The tangent of the body, which costs most, is kept over iterations and steps as long as they converge well;
        that of the contact is always new.

        Raises:
            NotConverged: no equilibrium found.
        """
        u = self.u if guess is None else guess
        now = self._all(u, centre, dt)
        if "bad" in now or guess is not None and np.abs(now["r"]).max() > 50:
            u = self.u
            now = self._all(u, centre, dt)
        for iteration in range(48):
            self.sphere.caution = min(iteration // 12, 2)
            worst = np.abs(now["r"]).max()
            if worst < CLOSE:
                self._accept(u, now)
                return now["parts"]["sphere"]["probe"]
            du = self._way(u, now, dt)
            size = np.abs(du).max()
            cut = min(1.0, 1.5e-3 / size)
            for _ in range(12):
                trial = self._all(u - cut * du.reshape(u.shape), centre, dt)
                if "bad" not in trial and np.abs(trial["r"]).max() < max(30 * worst, 1.0):
                    break
                cut /= 3
            else:
                break
            bent = trial["body"] - now["body"]
            u, now = u - cut * du.reshape(u.shape), trial
            left = np.abs(now["r"]).max()
            slow = left > worst * (CLOSE / max(left, CLOSE)) ** (1 / PATIENCE)
            if slow and (iteration % 8 == 7 or np.abs(bent + cut * self._kept_body(du)).max() > BLAMED * left):
                self.kept = None
        self.kept = None
        raise NotConverged(f"probed body: no equilibrium (largest residual {np.abs(now['r']).max():.2g} N)")

    def _way(self, u: np.ndarray, now: dict, dt: float) -> np.ndarray:
        """Newton's step: by the kept tangent and the contact of today, factored anew where that is too far from it."""
        contact = now["parts"]["sphere"]["K"]
        du = self.kept.solve(now["r"], contact) if self.kept else None
        if du is None:
            flat = self.kept.flat if self.kept else self._body(u, now, dt)
            self.factorizations += 1
            self.kept = Kept(self.band, flat, contact)
            du = self.kept.back(now["r"])
        return du

    def _kept_body(self, du: np.ndarray) -> np.ndarray:
        return self.kept.times(du) if self.kept else 0 * du

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

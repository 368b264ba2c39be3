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
MARGIN = 1.2e-3  # m from the probe: what may come to touch it before the body's tangent is computed anew
SETTLED = 2e-9  # m, of the surface under the probe, when its contact is solved for


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

        The tangent of the body, which costs most, is kept over iterations and steps as long as they converge well;
        in every iteration the contact is solved for to the end.

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
            du = self._way(u, now, centre, dt)
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
            left = np.abs(now["r"]).max()
            if left > worst * (CLOSE / max(left, CLOSE)) ** (1 / PATIENCE):
                self.kept = None
        self.kept = None
        raise NotConverged(f"probed body: no equilibrium (largest residual {np.abs(now['r']).max():.2g} N)")

    def _way(self, u: np.ndarray, now: dict, centre: np.ndarray, dt: float) -> np.ndarray:
        """What to take off `u`: the body as its kept tangent has it, with the contact that then comes about."""
        touch = now["parts"]["sphere"]
        gap = np.linalg.norm(touch["x"], axis=-1).min(1) - self.sphere.radius
        dofs = self.band.dofs["sphere"]
        if self.kept is None:
            self.factorizations += 1
            self.kept = Kept(self.band, self._body(u, now, dt))
        kept = self.kept
        on = np.any(touch["K"], axis=(1, 2))
        if not np.isin(dofs[on | (gap < MARGIN / 3)], kept.dofs).all():
            kept.reach(np.unique(dofs[on | (gap < MARGIN)]))
        force = self.band.vector({"sphere": touch["f"]})
        rest = now["r"].copy()
        rest[kept.dofs] -= force[kept.dofs]
        if len(kept.dofs):
            rest[kept.dofs] += self._contact(kept, u, centre, -kept.back(rest)[kept.dofs])
        return kept.back(rest)

    def _contact(self, kept: Kept, u: np.ndarray, centre: np.ndarray, free: np.ndarray) -> np.ndarray:
        """Forces of the contact on the kept dofs, which would move by `free` without it: d + C f(u + d) = free.

        Where that does not settle, those of a single step of Newton's method.
        """
        dofs, C = kept.dofs, kept.compliance
        place = np.full(self.band.n, len(dofs))
        place[dofs] = np.arange(len(dofs))
        rows = place[self.band.dofs["sphere"]]

        def tried(d: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            moved = u.copy()
            moved.reshape(-1)[dofs] += d
            state = self.sphere.state(moved, centre, True)
            f = self.band.vector({"sphere": state["f"]})[dofs]
            return d + C @ f - free, f, state["K"]

        d = np.zeros(len(dofs))
        off, f, K = tried(d)
        first = f
        for iteration in range(40):
            if np.abs(off).max() < SETTLED:
                return f
            self.sphere.caution = min(iteration // 8, 2)
            some = np.flatnonzero(np.any(K, axis=(1, 2)))
            stiff = np.zeros((len(dofs) + 1, len(dofs) + 1))
            np.add.at(stiff, (rows[some][:, :, None], rows[some][:, None, :]), K[some])
            way = np.linalg.solve(np.eye(len(dofs)) + C @ stiff[:-1, :-1], off)
            if iteration == 0:
                first = f - stiff[:-1, :-1] @ way
            cut = min(1.0, 1.5e-3 / np.abs(way).max())
            for _ in range(5):
                new = d - cut * way
                trial = tried(new)
                if np.linalg.norm(trial[0]) < (30 if iteration < 20 else 1) * np.linalg.norm(off):
                    break
                cut /= 2.5
            d, (off, f, K) = new, trial
        return first

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

"""Mean-dilatation hexes ("q1p0"): forces and tangents of a reduced polynomial body, derived by hand, in plain numpy.

Energy of an element: sum over 2x2x2 points of W(I1bar) plus V K/2 (Jmean - 1)^2, with I1bar = J^(-2/3) tr C and
Jmean = (1/V) sum w J. Its first and second derivatives are

    P = 2 W' J^(-2/3) (F - tr C / 3 F^-T),     dP/dF = W'' H H + W' dH/dF,     K (Jmean - 1) d(sum w J), ...

A history enters as an affine map of the elastic stress, S = c S_e + S_0 (relaxation over one step), and as a factor
(damage). Points run along the last axis of arrays, components first, which is several times faster than the reverse.
Sources: Simo, Taylor and Pister 1985; Holzapfel 2000, section 6.10 for the relaxation.
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from tissuejax.challenge.lobe import Grid

CORNERS = np.array([[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]])


_NINE = [(i, j) for i in range(3) for j in range(3)]
_PAIRS = [(a, b) for n, a in enumerate(_NINE) for b in _NINE[n:]]  # dP/dF is symmetric: 45 of 81 components


@dataclass(frozen=True)
class Tissue:
    """Constants of a body, Pa unless said.

    Attributes:
        C10, C20, C30: of W = C10 x + C20 x^2 + C30 x^3, x = I1bar - 3.
        K: of K/2 (Jmean - 1)^2.
        g, tau: relaxing shares of the isochoric stress and their times, s.
        leak, leak_tau: relaxing share of the pressure and its time, s.
        damage, damage_energy: softening 1 - damage tanh((Wmax - W) / damage_energy).
        fibre: stiffness k of k/2 (I4 - 1)^2 in tension, along `along`.
    """

    C10: float
    C20: float
    K: float
    C30: float = 0.0
    g: tuple[float, ...] = ()
    tau: tuple[float, ...] = ()
    leak: float = 0.0
    leak_tau: float = 1.0
    damage: float = 0.0
    damage_energy: float = 1.0
    fibre: float = 0.0
    along: tuple[float, float, float] = (1.0, 0.0, 0.0)


@dataclass
class Past:
    """What an element's points remember of the last accepted step; None where the tissue has no memory."""

    S: np.ndarray | None = None
    h: np.ndarray | None = None
    top: np.ndarray | None = None
    p: np.ndarray | None = None
    hp: np.ndarray | None = None


@dataclass
class Solid:
    """All hexes of a grid.

    Attributes:
        factor: stiffness of each hex relative to the tissue, at its points (E, 8).
    """

    grid: Grid
    tissue: Tissue
    factor: Float[np.ndarray, "E 8"] | None = None
    past: Past = field(default_factory=Past)

    def __post_init__(self):
        X = self.grid.points[self.grid.cells]
        E = len(X)
        s = CORNERS / np.sqrt(3)
        dN = np.stack([[CORNERS[a] / 8 * np.array([
            (1 + q[1] * CORNERS[a, 1]) * (1 + q[2] * CORNERS[a, 2]),
            (1 + q[0] * CORNERS[a, 0]) * (1 + q[2] * CORNERS[a, 2]),
            (1 + q[0] * CORNERS[a, 0]) * (1 + q[1] * CORNERS[a, 1]),
        ]) for a in range(8)] for q in s])  # fmt: skip
        jac = np.einsum("eai,qaj->eqij", X, dN)
        self.w = np.linalg.det(jac)
        if self.w.min() <= 0:
            raise ValueError("a hex of the challenge mesh is turned inside out")
        self.G = np.einsum("qaj,eqji->eqai", dN, np.linalg.inv(jac)).reshape(E * 8, 8, 3)
        N = np.prod([(1 + s[:, None, i] * CORNERS[None, :, i]) / 2 for i in range(3)], axis=0)
        self.places = np.einsum("qa,eai->eqi", N, X)
        self.V = self.w.sum(1)
        if self.factor is None:
            self.factor = np.ones((E, 8))
        self.mean_factor = (self.factor * self.w).sum(1) / self.V
        self._f, self._w = self.factor.ravel(), self.w.ravel()
        self._left = np.ascontiguousarray(self.G.reshape(E, 8, 8, 3).transpose(0, 2, 1, 3).reshape(E, 8, 24))  # a (q j)
        self._right32 = np.ascontiguousarray(np.swapaxes(self.G, 1, 2).astype(np.float32))
        self._w32 = self._w.astype(np.float32)
        self._left32 = self._left.astype(np.float32)

    def state(self, u: Float[np.ndarray, "N 3"], dt: float, tangent: bool) -> dict:
        """Forces (E, 8, 3), tangents (E, 8, 3, 8, 3) if asked for, energy, and what a step would leave behind.

        Tangents are in single precision: they only steer Newton's method, whose residual is in double.
        """
        t = self.tissue
        n, E = len(self._w), len(self.V)
        x = (self.grid.points + u)[self.grid.cells]
        F = (np.swapaxes(x, 1, 2) @ self._left).reshape(E, 3, 8, 3).transpose(1, 3, 0, 2).reshape(3, 3, n)
        cof = _cofactors(F)
        J = np.sum(F[0] * cof[0], 0)
        if J.min() <= 0.02:
            return {"bad": True}
        Fit = cof / J
        I = np.sum(F * F, (0, 1))
        thin = J ** (-2 / 3)
        y = thin * I - 3
        W = self._f * (t.C10 * y + t.C20 * y**2 + t.C30 * y**3)
        w1 = self._f * (t.C10 + 2 * t.C20 * y + 3 * t.C30 * y**2)
        P = (2 * w1 * thin) * (F - (I / 3) * Fit)
        a, Fa, e = np.asarray(t.along) / np.linalg.norm(t.along), None, None
        if t.fibre:
            Fa = np.tensordot(F, a, ((1,), (0,)))
            e = np.maximum(np.sum(Fa * Fa, 0) - 1, 0)
            P = P + (2 * t.fibre * self._f * e) * Fa[:, None] * a[:, None]
            W = W + t.fibre / 2 * self._f * e**2
        left: dict = {"W": W}
        undamaged, eta, slope = P, None, None
        if t.damage:
            top = np.maximum(self.past.top if self.past.top is not None else 0 * W, W)
            arg = (top - W) / t.damage_energy
            eta = 1 - t.damage * np.tanh(arg)
            slope = np.where(arg > 0, t.damage / t.damage_energy / np.cosh(np.minimum(arg, 50)) ** 2, 0.0)
            P = eta * P
            left["top"] = top
        share, S0 = 1.0, None
        if t.g:
            S = _product(np.swapaxes(Fit, 0, 1), P)
            share, S0, keep = self._relaxed(S, dt)
            P = share * P + _product(F, S0)
            left |= keep
        Jm = (self.w * J.reshape(E, 8)).sum(1) / self.V
        p = t.K * self.mean_factor * (Jm - 1)
        cp = np.ones(1)
        if t.leak:
            c, p, keep = self._leaked(p, dt)
            cp = np.array([c])
            left |= keep
        p8 = np.repeat(p, 8)
        Pw = (P + p8 * cof) * self._w
        left["f"] = self._left @ Pw.reshape(3, 3, E, 8).transpose(2, 3, 1, 0).reshape(E, 24, 3)
        left["energy"] = float(np.sum(W * self._w) + np.sum(self.V * t.K * self.mean_factor * (Jm - 1) ** 2) / 2)
        if not tangent:
            return left
        F4, Fit4, k4, kI = (_single(x) for x in (F, Fit, 2 * w1 * thin, 2 * w1 * thin * I / 3))
        w2 = self._f * (2 * t.C20 + 6 * t.C30 * y)
        H, Hw = (_single(x * (F - (I / 3) * Fit)) for x in (2 * thin, 2 * thin * w2))
        third, D = np.float32(2 / 3) * k4, _single(F - (I / 3) * Fit)
        fibre = (
            [_single(x) for x in (4 * t.fibre * self._f * (e > 0), 2 * t.fibre * self._f * e, Fa)] if t.fibre else ()
        )
        hurt = [_single(x) for x in (eta, slope, undamaged)] if t.damage else ()
        S4 = _single(S0) if S0 is not None else None
        pJ = _single(p8 * J)
        A = np.empty((n, 3, 3, 3, 3), np.float32)  # n j i k l, which is how `_stiffness` wants it
        for (i, j), (k, l) in _PAIRS:
            v = Hw[i, j] * H[k, l] - third * (Fit4[i, j] * F4[k, l] + D[i, j] * Fit4[k, l])
            v += kI * Fit4[i, l] * Fit4[k, j]
            if i == k and j == l:
                v += k4
            if fibre:
                v += fibre[0] * fibre[2][i] * fibre[2][k] * np.float32(a[j] * a[l])
                if i == k:
                    v += fibre[1] * np.float32(a[j] * a[l])
            if hurt:
                v = hurt[0] * v + hurt[1] * hurt[2][i, j] * hurt[2][k, l]
            if S4 is not None:
                v *= np.float32(share)
                if i == k:
                    v += S4[l, j]
            v += pJ * (Fit4[i, j] * Fit4[k, l] - Fit4[i, l] * Fit4[k, j])
            v *= self._w32
            A[:, j, i, k, l] = v
            A[:, l, k, i, j] = v
        left["K"] = self._stiffness(A, cof, cp * t.K * self.mean_factor / self.V)
        return left

    def _stiffness(self, A: np.ndarray, cof: np.ndarray, bulk: np.ndarray) -> np.ndarray:
        E = len(self.V)
        right = (A.reshape(-1, 27, 3) @ self._right32).reshape(E, 24, 72)  # (q j) (i k b)
        K = (self._left32 @ right).reshape(E, 8, 3, 3, 8).transpose(0, 1, 2, 4, 3).reshape(E, 24, 24)  # a i b k
        weighted = (cof * self._w).reshape(3, 3, E, 8).transpose(2, 3, 1, 0).reshape(E, 24, 3)
        b = _single((self._left @ weighted).reshape(E, 24))
        K += (_single(bulk)[:, None, None] * b[:, :, None]) * b[:, None, :]
        return K

    def _relaxed(self, S: np.ndarray, dt: float) -> tuple[float, np.ndarray, dict]:
        t = self.tissue
        old = self.past.S if self.past.S is not None else np.zeros_like(S)
        h = self.past.h if self.past.h is not None else np.zeros((len(t.g), *S.shape))
        c, S0, new = 1 - sum(t.g), np.zeros_like(S), np.empty_like(h)
        for i, (g, tau) in enumerate(zip(t.g, t.tau)):
            decay, gain = np.exp(-dt / tau), -np.expm1(-dt / tau) * tau / dt if dt > 0 else 1.0
            new[i] = decay * h[i] + gain * (S - old)
            c += g * gain
            S0 += g * (decay * h[i] - gain * old)
        return c, S0, {"S": S, "h": new}

    def _leaked(self, p: np.ndarray, dt: float) -> tuple[float, np.ndarray, dict]:
        t = self.tissue
        old = self.past.p if self.past.p is not None else np.zeros_like(p)
        h = self.past.hp if self.past.hp is not None else np.zeros_like(p)
        decay, gain = np.exp(-dt / t.leak_tau), -np.expm1(-dt / t.leak_tau) * t.leak_tau / dt if dt > 0 else 1.0
        new = decay * h + gain * (p - old)
        return 1 - t.leak + t.leak * gain, (1 - t.leak) * p + t.leak * new, {"p": p, "hp": new}

    def accept(self, left: dict) -> None:
        """Remember a step."""
        for name in ("S", "h", "top", "p", "hp"):
            if name in left:
                setattr(self.past, name, left[name])


def _cofactors(F: Float[np.ndarray, "3 3 n"]) -> Float[np.ndarray, "3 3 n"]:
    """J F^-T: rows are cross products of the other two rows."""
    x, y, z = F

    def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return a[[1, 2, 0]] * b[[2, 0, 1]] - a[[2, 0, 1]] * b[[1, 2, 0]]

    return np.stack([cross(y, z), cross(z, x), cross(x, y)])


def _product(a: Float[np.ndarray, "3 3 n"], b: Float[np.ndarray, "3 3 n"]) -> Float[np.ndarray, "3 3 n"]:
    return a[:, 0, None] * b[0] + a[:, 1, None] * b[1] + a[:, 2, None] * b[2]


def _single(a: np.ndarray) -> np.ndarray:
    return np.asarray(a, np.float32)

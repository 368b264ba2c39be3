"""The evidence of a linearised model under noise and discrepancy, as a function of the discrepancy's amplitudes.

Near a fit theta the residual is r - J delta, with r = y - f(theta). With delta integrated over its prior (precision
`weak`, centred where the prior is), K = D + U V U', where D is block-diagonal (noise, slow parts) and U holds the
smooth parts, and H = J'K^-1 J + weak,

    log p(y | v) = -1/2 (r'K^-1 r + o'weak o - b'H^-1 b) - 1/2 log|K| - 1/2 log|H| + const,   b = J'K^-1 r - weak o,

o being theta less the prior's mean. Smooth parts and parameters are handled alike, as columns W = [U sqrt(V), J] with
precisions 1 and `weak`: all costs are those of the blocks. Amplitudes a = sqrt(v) have half-normal priors with a
heavier tail (`Widths`), so in v the whole has a slope at zero and an amplitude can rest there.

Source: restricted likelihood, Harville 1977, JASA 72; Woodbury's identity.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float
from scipy.linalg import cho_factor, cho_solve
from scipy.linalg.blas import dtrsm
from scipy.linalg.lapack import dpotrf, dpotri
from scipy.optimize import lsq_linear

from tissuejax.estimation.discrepancy import Part

ROUNDING = 1e-10  # of what a part says before parameters and other parts are taken out: less is rounding
JITTER = (1e-12, 1e-10, 1e-8)  # on the diagonal of a matrix of correlations: the least that factors


@dataclass(frozen=True)
class Linear:
    """A model near a fit.

    Attributes:
        residual: measured - predicted.
        jacobian: of the prediction, by the parameters that are integrated over.
        offset, weak: parameters less their prior means, and prior precisions (0: flat).
    """

    residual: Float[np.ndarray, " N"]
    jacobian: Float[np.ndarray, "N p"]
    offset: Float[np.ndarray, " p"]
    weak: Float[np.ndarray, " p"]

    def of(self, these: Bool[np.ndarray, " p"]) -> "Linear":
        """By these parameters alone; the others are held."""
        return Linear(self.residual, self.jacobian[:, these], self.offset[these], self.weak[these])


@dataclass(frozen=True)
class Marginal:
    """Log evidence at given squared amplitudes; its slope and Fisher information in them are worked out when asked for.

    Attributes:
        value: without priors of the amplitudes; 2 pi is in it for the measurements, not for the parameters.
        precision: H.
        step: delta at the maximum.
    """

    value: float
    precision: Float[np.ndarray, "p p"]
    step: Float[np.ndarray, " p"]
    _derivatives: Callable[[], tuple[np.ndarray, np.ndarray, dict[int, tuple]]] = field(repr=False)

    @cached_property
    def _all(self) -> tuple[np.ndarray, np.ndarray, dict[int, tuple]]:
        return self._derivatives()

    @property
    def slope(self) -> Float[np.ndarray, " K"]:
        """First derivative by the squared amplitudes."""
        return self._all[0]

    @property
    def fisher(self) -> Float[np.ndarray, "K K"]:
        """Expected second derivative, sign turned; between blocks P is taken as block-diagonal for two parts within."""
        return self._all[1]

    def along(self, k: int, d: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """What the log evidence changes by where the squared amplitude of a smooth part k does by d, the others kept.

        Exact: with A = F'PF and b = F'P r of the part's factor F, -1/2 log|I + d A| + d/2 b'(I + d A)^-1 b. Where the
        parameters do all that a direction of F does, A and b are rounding there, and it changes nothing.
        """
        inner, b, whole = self._all[2][k]
        size, turn = np.linalg.eigh(inner)
        told = size > ROUNDING * whole
        grown = np.maximum(1 + np.outer(d, size[told]), 1e-12)
        return -0.5 * np.sum(np.log(grown), axis=1) + 0.5 * d * np.sum((turn.T @ b)[told] ** 2 / grown, axis=1)


@dataclass(frozen=True)
class Blocked:
    """Which rows belong to which block of D, and the noise there.

    Attributes:
        rows: of each block.
        sigma: standard deviation of the noise.
        shared: by block, what all its rows err by alike.
        noise: by block, covariance of noise that is correlated in time; independent entries without it.
    """

    rows: tuple[slice, ...]
    sigma: Float[np.ndarray, " N"]
    shared: Float[np.ndarray, " B"] | None = None
    noise: tuple[Float[np.ndarray, "n n"], ...] | None = None

    def within(self, parts: Sequence[Part], v: Float[np.ndarray, " K"]) -> list[Float[np.ndarray, "n n"]]:
        """The blocks of D."""
        out = []
        for i, rows in enumerate(self.rows):
            block = np.diag(self.sigma[rows] ** 2) if self.noise is None else self.noise[i].copy()
            if self.shared is not None:
                block += self.shared[i] ** 2
            for part, x in zip(parts, v, strict=True):
                if part.within is not None and x > 0:
                    block += x * part.within[i]
            out.append(block)
        return out


def root(block: Float[np.ndarray, "n n"]) -> Float[np.ndarray, "n n"]:
    """Lower Cholesky factor of a covariance; its upper triangle is zero."""
    c, info = dpotrf(block, lower=1)
    if info:
        raise np.linalg.LinAlgError("a covariance is not positive definite")
    return c


def inverted(c: Float[np.ndarray, "n n"]) -> Float[np.ndarray, "n n"]:
    """Inverse of a covariance, from its factor."""
    low, _ = dpotri(c, lower=1)  # the other triangle is zero
    whole = low + low.T
    whole.flat[:: len(c) + 1] *= 0.5
    return whole


def smooth(parts: Sequence[Part], v: Float[np.ndarray, " K"]) -> Float[np.ndarray, "N q"]:
    """U sqrt(V): the columns of the smooth parts that act."""
    acting = [math.sqrt(x) * p.factor for p, x in zip(parts, v, strict=True) if p.factor is not None and x > 0]
    n = len(parts[0].factor) if parts[0].factor is not None else sum(len(b) for b in parts[0].within)
    return np.concatenate(acting, axis=1) if acting else np.zeros((n, 0))


def marginal(linear: Linear, parts: Sequence[Part], v: Float[np.ndarray, " K"], blocked: Blocked) -> Marginal:
    """See the module's text."""
    roots = [root(b) for b in blocked.within(parts, v)]
    u = smooth(parts, v)
    q = u.shape[1]
    w = np.concatenate([u, linear.jacobian], axis=1)
    prior = np.concatenate([np.ones(q), linear.weak])
    offset = np.concatenate([np.zeros(q), linear.offset])
    # L^-1 of columns and residual, with D = LL'; inverses are for derivatives, which one in fifteen is asked for
    both = np.concatenate([w, linear.residual[:, None]], axis=1)
    white = np.concatenate([dtrsm(1.0, l, both[rows], lower=1) for l, rows in zip(roots, blocked.rows, strict=True)])
    columns, z = white[:, :-1], white[:, -1]
    m = columns.T @ columns + np.diag(prior)
    size = 1 / np.sqrt(np.maximum(np.diag(m), 1e-300))
    c = factored(m * np.outer(size, size))
    b = columns.T @ z - prior * offset
    found = size * cho_solve(c, size * b, check_finite=False)
    quadratic = float(z @ z + offset @ (prior * offset) - b @ found)
    log_det = 2 * sum(float(np.sum(np.log(np.diag(l)))) for l in roots)
    # |M| = |I + U'D^-1U| |H|, and |K| = |D| |I + U'D^-1U|
    own = 2 * float(np.sum(np.log(np.diag(c[0])) - np.log(size)))
    value = -0.5 * (quadratic + log_det + own + len(z) * math.log(2 * math.pi))

    def derivatives() -> tuple[np.ndarray, np.ndarray, dict[int, tuple]]:
        inverse = [inverted(l) for l in roots]

        def solve(x: np.ndarray) -> np.ndarray:
            return np.concatenate([i @ x[rows] for i, rows in zip(inverse, blocked.rows, strict=True)])

        g = solve(w)
        left = solve(linear.residual) - g @ found  # K^-1 of what the parameters leave
        half = g @ (size[:, None] * cho_solve(c, np.diag(size), check_finite=False))  # g M^-1
        return _derivatives(parts, blocked, inverse, g, half, left)

    last = np.tril(c[0])[q:, q:] / size[q:, None]  # of the factor: its square is the Schur complement H
    schur = last @ last.T
    return Marginal(value, schur, found[q:], derivatives)


def factored(unit: Float[np.ndarray, "w w"]) -> tuple[np.ndarray, bool]:
    """Cholesky factor of a matrix with ones on its diagonal, which rounding may have made a little indefinite."""
    for jitter in JITTER[:-1]:
        try:
            return cho_factor(unit + jitter * np.eye(len(unit)), lower=True, check_finite=False)
        except np.linalg.LinAlgError:
            continue
    return cho_factor(unit + JITTER[-1] * np.eye(len(unit)), lower=True, check_finite=False)


def _derivatives(
    parts: Sequence[Part],
    blocked: Blocked,
    inverse: Sequence[Float[np.ndarray, "n n"]],
    g: Float[np.ndarray, "N w"],
    half: Float[np.ndarray, "N w"],
    left: Float[np.ndarray, " N"],
) -> tuple[Float[np.ndarray, " K"], Float[np.ndarray, "K K"], dict[int, tuple[np.ndarray, np.ndarray, float]]]:
    """Slope 1/2 (z'B z - tr P B), z = K^-1 r, and Fisher information 1/2 tr(P B_a P B_b), with P = D^-1 - half g'; of
    each smooth part, F'PF, F'z and the trace of F'D^-1F."""
    soft = [k for k, part in enumerate(parts) if part.factor is not None]
    hard = [k for k, part in enumerate(parts) if part.factor is None]
    slope, fisher = np.zeros(len(parts)), np.zeros((len(parts), len(parts)))
    u = np.concatenate([parts[k].factor for k in soft], axis=1) if soft else np.zeros((len(left), 0))
    edges = np.cumsum([0, *(parts[k].factor.shape[1] for k in soft)])[:-1]
    light = np.concatenate([i @ u[rows] for i, rows in zip(inverse, blocked.rows, strict=True)])
    moved = light - half @ (g.T @ u)  # P U
    inner, pull = u.T @ moved, u.T @ left
    ends = [*edges, u.shape[1]]
    whole = np.sum(light * u, axis=0)
    own = {
        k: (inner[a:b, a:b], pull[a:b], float(np.sum(whole[a:b])))
        for k, a, b in zip(soft, ends, ends[1:], strict=False)
    }
    if soft:
        trace = np.add.reduceat(np.sum(moved * u, axis=0), edges)
        slope[soft] = np.add.reduceat(pull**2, edges) - trace
        square = np.add.reduceat(np.add.reduceat(inner**2, edges, axis=0), edges, axis=1)
        fisher[np.ix_(soft, soft)] = 0.5 * (square + square.T)
    for i, (light, rows) in enumerate(zip(inverse, blocked.rows, strict=True)):
        n = len(light)
        within = np.stack([parts[k].within[i] for k in hard]) if hard else np.zeros((0, n, n))
        p = light - half[rows] @ g[rows].T
        slope[hard] += (within @ left[rows]) @ left[rows] - within.reshape(-1, n * n) @ p.ravel()
        crossed = within @ p
        turned = crossed.transpose(0, 2, 1).reshape(-1, n * n)
        fisher[np.ix_(hard, hard)] += crossed.reshape(-1, n * n) @ turned.T
        for k, block in zip(hard, within, strict=True):
            if soft:
                mixed = np.add.reduceat(np.sum((block @ moved[rows]) * moved[rows], axis=0), edges)
                fisher[k, soft] += mixed
                fisher[soft, k] += mixed
    return 0.5 * slope, 0.5 * fisher, own


@dataclass(frozen=True)
class Widths:
    """Prior of the amplitudes: half-normal, with a chance of being wider.

        p(a) = (1 - chance) HN(a; width) + chance HN(a; factor width)

    Attributes:
        width: by part, shares of the stress.
        chance, factor: that a part is wider, and by how much; `factor` one for all, or by part.
    """

    width: Float[np.ndarray, " K"]
    chance: Float[np.ndarray, " K"]
    factor: float | Float[np.ndarray, " K"] = 10.0

    def _two(self, u: Float[np.ndarray, "... K"]) -> tuple[np.ndarray, np.ndarray]:
        with np.errstate(divide="ignore"):
            usual, wide = np.log1p(-self.chance), np.log(self.chance / self.factor)
        return usual - 0.5 * u, wide - 0.5 * u / self.factor**2

    def log_shape(self, u: Float[np.ndarray, "... K"]) -> Float[np.ndarray, "... K"]:
        """log p(a) at u = (a / width)^2, but for what it is where nothing is wider and a = 0."""
        return np.logaddexp(*self._two(u))

    def log_density(self, v: Float[np.ndarray, "... K"]) -> Float[np.ndarray, "... K"]:
        """log p(a) at v = a^2."""
        return self.log_shape(v / self.width**2) + 0.5 * math.log(2 / math.pi) - np.log(self.width)

    def slope(self, u: Float[np.ndarray, " K"]) -> Float[np.ndarray, " K"]:
        """Derivative of `log_shape` by u."""
        usual, wide = self._two(u)
        share = np.exp(wide - np.logaddexp(usual, wide))
        return -0.5 * (1 - share + share / self.factor**2)

    def part(self, k: int) -> "Widths":
        """Of one part alone."""
        factor = np.broadcast_to(self.factor, self.width.shape)
        return Widths(self.width[k : k + 1], self.chance[k : k + 1], factor[k : k + 1])

    @property
    def widest(self) -> "Widths":
        """All wider that may be."""
        return Widths(self.width * np.where(self.chance > 0, self.factor, 1.0), np.zeros(len(self.width)))

    def wider(self, v: Float[np.ndarray, " K"]) -> Float[np.ndarray, " K"]:
        """By part, whether an amplitude is likelier one of the wide ones."""
        usual, wide = self._two(v / self.width**2)
        return wide > usual


def amplitudes(
    linear: Linear,
    parts: Sequence[Part],
    priors: Widths,
    blocked: Blocked,
    start: Float[np.ndarray, " K"],
    most: int = 15,
    tolerance: float = 0.02,
) -> tuple[Float[np.ndarray, " K"], Marginal]:
    """Squared amplitudes at the maximum of evidence and prior, and the evidence there.

    Newton's method with the Fisher information, each step a quadratic programme inside v >= 0, shortened until it
    gains. Where parts may be wider there are two basins: begin where all that may be wide is (`Widths.widest`).
    """
    unit = priors.width**2

    def worth(m: Marginal, u: np.ndarray) -> float:
        return m.value + float(np.sum(priors.log_shape(u)))

    u = np.clip(start / unit, 0.0, (10 * priors.factor) ** 2)
    m = marginal(linear, parts, u * unit, blocked)
    for _ in range(most):
        g, f = m.slope * unit + priors.slope(u), m.fisher * np.outer(unit, unit)
        size = 1 / np.sqrt(np.diag(f) + 1e-12)
        values, vectors = np.linalg.eigh(f * np.outer(size, size))
        root = np.sqrt(np.maximum(values, 0.02))  # parts alike; blocks taken for diagonal
        right = (vectors.T @ (size * g)) / root
        low = -u / size
        step = (
            size * lsq_linear(root[:, None] * vectors.T, right, (low - 1e-12, np.full(len(u), np.inf)), method="bvls").x
        )
        step = np.maximum(step, -u)
        if float(g @ step) < tolerance:
            break
        for _ in range(6):
            trial = marginal(linear, parts, (u + step) * unit, blocked)
            gained = worth(trial, u + step) - worth(m, u)
            if gained > 0:
                break
            step = step / 4
        else:
            break
        u, m = u + step, trial
        if gained < tolerance:
            break
    return u * unit, m


def uphill(v: Float[np.ndarray, " K"], m: Marginal, priors: Widths) -> float:
    """The most, nats, that one squared amplitude alone promises by its slope and the Fisher information where it is;
    towards nothing no more than its slope times what is left of it."""
    unit = priors.width**2
    u, f = v / unit, np.diag(m.fisher) * unit**2
    g = m.slope * unit + priors.slope(u)
    promised = np.where(f > 0, g**2 / (2 * np.maximum(f, 1e-300)), 0.0)
    return float(np.max(np.where(g > 0, promised, np.minimum(promised, -g * u)), initial=0.0))

"""The evidence of a linearised model under noise and discrepancy, as a function of the discrepancy's amplitudes.

Near a fit theta the residual is r - J delta, with r = y - f(theta). With delta integrated over its prior (precision
`weak`, centred where the prior is), K = D + U V U', where D is block-diagonal (noise, slow parts) and U holds the
smooth parts, and H = J'K^-1 J + weak,

    log p(y | v) = -1/2 (r'K^-1 r + o'weak o - b'H^-1 b) - 1/2 log|K| - 1/2 log|H| + const,   b = J'K^-1 r - weak o,

o being theta less the prior's mean. Smooth parts and parameters are handled alike, as columns W = [U sqrt(V), J] with
precisions 1 and `weak`: all costs are those of the blocks. Amplitudes a = sqrt(v) have half-normal priors, so in v the
whole has a slope at zero and an amplitude can rest there.

Source: restricted likelihood, Harville 1977, JASA 72; Woodbury's identity; Laplace's method for posterior mass, Kass
and Raftery 1995, JASA 90, sec. 4.1.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.linalg import cho_factor, cho_solve
from scipy.linalg.lapack import dpotrf, dpotri
from scipy.optimize import lsq_linear

from tissuejax.estimation.discrepancy import Part

NODES = np.polynomial.legendre.leggauss(40)


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


@dataclass(frozen=True)
class Marginal:
    """Log evidence at given squared amplitudes, its slope and Fisher information in them.

    Attributes:
        value: without priors of the amplitudes; 2 pi is in it for the measurements, not for the parameters.
        slope, fisher: first derivative by the squared amplitudes, and the expected second one.
        precision: H.
        step: delta at the maximum.
    """

    value: float
    slope: Float[np.ndarray, " K"]
    fisher: Float[np.ndarray, "K K"] | None
    precision: Float[np.ndarray, "p p"]
    step: Float[np.ndarray, " p"]


@dataclass(frozen=True)
class Blocked:
    """Which rows belong to which block of D, and the noise on its diagonal."""

    rows: tuple[slice, ...]
    sigma: Float[np.ndarray, " N"]

    def within(self, parts: Sequence[Part], v: Float[np.ndarray, " K"]) -> list[Float[np.ndarray, "n n"]]:
        """The blocks of D."""
        out = []
        for i, rows in enumerate(self.rows):
            block = np.diag(self.sigma[rows] ** 2)
            for part, x in zip(parts, v, strict=True):
                if part.within is not None and x > 0:
                    block += x * part.within[i]
            out.append(block)
        return out


def inverted(block: Float[np.ndarray, "n n"]) -> tuple[Float[np.ndarray, "n n"], float]:
    """Inverse and log determinant of a covariance."""
    c, info = dpotrf(block, lower=1)
    if info:
        raise np.linalg.LinAlgError("a covariance is not positive definite")
    inverse, _ = dpotri(c, lower=1)
    low = np.tril(inverse)
    return low + np.tril(low, -1).T, 2 * float(np.sum(np.log(np.diag(c))))


def smooth(parts: Sequence[Part], v: Float[np.ndarray, " K"]) -> Float[np.ndarray, "N q"]:
    """U sqrt(V): the columns of the smooth parts that act."""
    acting = [math.sqrt(x) * p.factor for p, x in zip(parts, v, strict=True) if p.factor is not None and x > 0]
    n = next(len(p.factor) for p in parts if p.factor is not None)
    return np.concatenate(acting, axis=1) if acting else np.zeros((n, 0))


def marginal(
    linear: Linear, parts: Sequence[Part], v: Float[np.ndarray, " K"], blocked: Blocked, fisher: bool = False
) -> Marginal:
    """See the module's text."""
    inverse, log_det = zip(*(inverted(b) for b in blocked.within(parts, v)), strict=True)

    def solve(x: np.ndarray) -> np.ndarray:
        return np.concatenate([i @ x[rows] for i, rows in zip(inverse, blocked.rows, strict=True)])

    u = smooth(parts, v)
    p, q = linear.jacobian.shape[1], u.shape[1]
    w = np.concatenate([u, linear.jacobian], axis=1)
    prior = np.concatenate([np.ones(q), linear.weak])
    offset = np.concatenate([np.zeros(q), linear.offset])
    g = solve(w)
    m = w.T @ g + np.diag(prior)
    size = 1 / np.sqrt(np.maximum(np.diag(m), 1e-300))
    c = cho_factor(m * np.outer(size, size) + 1e-12 * np.eye(p + q), lower=True, check_finite=False)
    dr = solve(linear.residual)
    b = g.T @ linear.residual - prior * offset
    found = size * cho_solve(c, size * b, check_finite=False)
    left = dr - g @ found  # K^-1 of what the parameters leave
    quadratic = float(linear.residual @ dr + offset @ (prior * offset) - b @ found)
    # |M| = |I + U'D^-1U| |H|, and |K| = |D| |I + U'D^-1U|
    own = 2 * float(np.sum(np.log(np.diag(c[0])) - np.log(size)))
    value = -0.5 * (quadratic + sum(log_det) + own + len(dr) * math.log(2 * math.pi))
    half = g @ (size[:, None] * cho_solve(c, np.diag(size), check_finite=False))  # g M^-1

    def project(x: np.ndarray) -> np.ndarray:
        return solve(x) - half @ (g.T @ x)

    slope, moved = [], []
    for part in parts:
        if part.factor is not None:
            moved.append(project(part.factor))
            trace, gained = np.sum(moved[-1] * part.factor), np.sum((part.factor.T @ left) ** 2)
        else:
            moved.append(None)
            trace = gained = 0.0
            for i, rows, block in zip(inverse, blocked.rows, part.within, strict=True):
                trace += np.sum(i * block) - np.sum((block @ g[rows]) * half[rows])
                gained += left[rows] @ block @ left[rows]
        slope.append(0.5 * float(gained - trace))
    information = _fisher(parts, moved, inverse, g, half, blocked) if fisher else None
    schur = m[q:, q:]
    if q:
        schur = schur - m[q:, :q] @ np.linalg.solve(m[:q, :q], m[:q, q:])
    return Marginal(value, np.array(slope), information, schur, found[q:])


def _fisher(parts, moved, inverse, g, half, blocked: Blocked) -> Float[np.ndarray, "K K"]:
    """1/2 tr(P B_a P B_b); between blocks of two block-diagonal parts P is taken as block-diagonal."""
    own = [i - half[rows] @ g[rows].T for i, rows in zip(inverse, blocked.rows, strict=True)]
    inner = [None if p.within is None else [o @ b for o, b in zip(own, p.within, strict=True)] for p in parts]
    out = np.zeros((len(parts), len(parts)))
    for a, one in enumerate(parts):
        for b, other in enumerate(parts[: a + 1]):
            if one.factor is not None and other.factor is not None:
                t = np.sum((one.factor.T @ moved[b]) ** 2)
            elif one.factor is None and other.factor is None:
                t = sum(np.sum(x * y.T) for x, y in zip(inner[a], inner[b], strict=True))
            else:
                x, blocks = (moved[a], other.within) if one.factor is not None else (moved[b], one.within)
                t = sum(np.sum((y @ x[r]) * x[r]) for y, r in zip(blocks, blocked.rows, strict=True))
            out[a, b] = out[b, a] = 0.5 * float(t)
    return out


def amplitudes(
    linear: Linear,
    parts: Sequence[Part],
    priors: Float[np.ndarray, " K"],
    blocked: Blocked,
    start: Float[np.ndarray, " K"],
    most: int = 15,
    tolerance: float = 0.02,
) -> tuple[Float[np.ndarray, " K"], Marginal]:
    """Squared amplitudes at the maximum of evidence and prior, and the evidence there.

    Newton's method with the Fisher information, each step a quadratic programme inside v >= 0, halved until it gains.
    """
    unit = priors**2

    def worth(m: Marginal, u: np.ndarray) -> float:
        return m.value - 0.5 * float(np.sum(u))

    u = np.clip(start / unit, 0.0, 100.0)
    m = marginal(linear, parts, u * unit, blocked, fisher=True)
    for _ in range(most):
        g, f = m.slope * unit - 0.5, m.fisher * np.outer(unit, unit)
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
            trial = marginal(linear, parts, (u + step) * unit, blocked, fisher=True)
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


def amplitude_mass(m: Marginal, v: Float[np.ndarray, " K"], priors: Float[np.ndarray, " K"]) -> float:
    """Log of the posterior mass over the amplitudes, over the evidence at its maximum: priors and Occam's factor.

    Evidence and prior are taken quadratic in v about their maximum, so that a resting amplitude and one far from zero
    are the two ends of one formula; integrated over a = sqrt(v) by quadrature, correlations by their determinant.
    """
    slope = m.slope - 0.5 / priors**2
    curvature = np.maximum(np.diag(m.fisher), 1e-300)
    total = 0.0
    x, weights = NODES
    for at, g, h, prior in zip(v, np.minimum(slope, 0.0), curvature, priors, strict=True):
        g = 0.0 if at > 0 else float(g)
        wide = 8 / math.sqrt(h)
        low, top = math.sqrt(max(at - wide, 0.0)), math.sqrt(at + min(wide, 30 / max(-g, 1e-300)))
        a = low + 0.5 * (top - low) * (x + 1)
        d = a**2 - at
        mass = 0.5 * (top - low) * float(np.sum(weights * np.exp(g * d - 0.5 * h * d**2)))
        density = 0.5 * math.log(2 / math.pi) - math.log(prior) - 0.5 * at / prior**2
        total += density + math.log(max(mass, 1e-300))
    moving = np.flatnonzero(v > 1e-3 * priors**2)
    if len(moving) > 1:
        f = m.fisher[np.ix_(moving, moving)]
        scale = 1 / np.sqrt(np.diag(f))
        total -= 0.5 * float(np.linalg.slogdet(f * np.outer(scale, scale) + 1e-3 * np.eye(len(moving)))[1])
    return total

"""A bench whose predictions are straight lines in all parameters, and its evidence in dense matrices.

What weighing comes to can be integrated there without Laplace's method, and without a line of the code under test.
"""

import math
from types import SimpleNamespace

import numpy as np
from scipy.linalg import block_diag
from scipy.special import logsumexp

from tissuejax.diagnosis.bench import Bench, Candidate, Free
from tissuejax.diagnosis.judgement.blocks import blocks
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.scales import Scales, scaled
from tissuejax.estimation.discrepancy import Part
from tissuejax.estimation.series import Segment

N, MEANS, SIGMA = 30, 15, 0.05
TIME = np.linspace(0.0, 3.0, N)
DRIVE = np.concatenate([0.4 * TIME, 0.3 * TIME + 0.05 * np.sin(4 * TIME)])
FIRST = np.arange(2 * N) < N
FREE = {
    "a": Free(-np.inf, np.inf, 10.0),
    "b": Free(-np.inf, np.inf, 10.0),
    "push.k": Free(0.0, np.inf, 5.0),  # one-sided
    "shift.x": Free(-np.inf, np.inf, 0.1),
    "shift.y": Free(-np.inf, np.inf, 0.1),
    "own.x": Free(-np.inf, np.inf, 0.1),  # of the first recording alone
    "noted.x": Free(-np.inf, np.inf, 0.1, prior=(0.2, 0.03)),  # corrects what was noted
    "bend.k": Free(-np.inf, np.inf, 5.0),
    "bend.onset": Free(0.01, 10.0, 1.0, log=True),
}
START = {p: 0.0 for p in FREE} | {"a": 5.0, "bend.onset": 0.3}
CANDIDATES = {
    "push": Candidate("push", ("push.k",)),
    "shift": Candidate("shift", ("shift.x", "shift.y"), rig=True),
    "own": Candidate("own", ("own.x",)),
    "noted": Candidate("noted", ("noted.x",), rig=True),
    "bend": Candidate("bend", ("bend.k",), ("bend.onset",), ({"bend.onset": 0.3}, {"bend.onset": 0.7})),
}


class Straight(Bench):
    """y = a x + b x^3 and columns of the candidates; `bend` is over by its onset."""

    def column(self, path: str, onset: float) -> np.ndarray:
        x = DRIVE
        return {
            "a": x,
            "b": x**3,
            "push.k": np.sin(3 * x),
            "shift.x": np.ones(2 * N),
            "shift.y": np.tile(TIME, 2),
            "own.x": FIRST * np.cos(5 * x),
            "noted.x": 1.0 + np.tile(TIME, 2) ** 2,
            "bend.k": 1 - np.exp(-x / onset),
        }[path]

    def predict(self, values, recordings=None):
        v = {**self.start, **dict(values)}
        return sum(v[p] * self.column(p, v["bend.onset"]) for p in self.free if p != "bend.onset")

    def jacobian(self, values, paths, recordings=None):
        v = {**self.start, **dict(values)}
        onset = v["bend.onset"]
        later = -v["bend.k"] * DRIVE / onset**2 * np.exp(-DRIVE / onset)
        return np.stack([later if p == "bend.onset" else self.column(p, onset) for p in paths], axis=1)


def straight(truth: dict[str, float], seed: int = 0, sigma: float = SIGMA) -> Straight:
    """A sample of it: 10 x + 20 x^3, `truth` and white noise."""
    segments = [
        Segment(n, "force", "", slice(i * N, (i + 1) * N), TIME, "N", DRIVE[i * N : (i + 1) * N], "shear", "1")
        for i, n in enumerate("pq")
    ]
    noise = np.full(2 * N, sigma)
    made = Straight(segments, np.zeros(2 * N), noise, ("p", "q"), (), ("a", "b"), FREE, START, dict(CANDIDATES))
    made.y = made.predict({"a": 10.0, "b": 20.0, **truth}) + np.random.default_rng(seed).normal(0, sigma, 2 * N)
    return made


class Given:
    """A discrepancy whose parts are these, whatever is predicted."""

    sudden = ()

    def __init__(self, *parts: Part):
        self.parts = parts

    def about(self, here, done=()):
        return self.parts


GAIN = Part("gain", "gain", factor=np.repeat(np.eye(2), MEANS, axis=0) * 2.0)


def scales_of(bench: Straight, *parts: Part, criteria: Criteria | None = None) -> Scales:
    """Its scales about 10 x + 20 x^3, two samples a mean."""
    cut = blocks(bench, {"force": MEANS})
    at = {"a": 10.0, "b": 20.0}
    return scaled(bench, cut, Given(*(parts or (GAIN,))), bench.predict(at), at, criteria)


def covariance(scales: Scales, parts, v) -> np.ndarray:
    """Of what is measured, at given squared amplitudes."""
    k = np.diag(scales.blocked.sigma**2)
    for part, x in zip(parts, v, strict=True):
        k += x * (part.factor @ part.factor.T if part.factor is not None else block_diag(*part.within))
    return k


def flat(y: np.ndarray, jac: np.ndarray, k: np.ndarray) -> float:
    """log of the integral of the normal density of y - jac theta over all theta."""
    inverse = np.linalg.inv(k)
    h = jac.T @ inverse @ jac
    left = inverse - inverse @ jac @ np.linalg.solve(h, jac.T @ inverse)
    dets = np.linalg.slogdet(k)[1] + np.linalg.slogdet(h)[1]
    return float(-0.5 * (y @ left @ y + dets + (len(y) - jac.shape[1]) * math.log(2 * math.pi)))


def half_normal(a: float, width: float) -> float:
    return 2 * math.exp(-0.5 * (a / width) ** 2) / (width * math.sqrt(2 * math.pi)) if a >= 0 else 0.0


def averaged(log_density, prior, ends: list[float]) -> float:
    """log of the integral of exp(log_density(x)) prior(x), piece by piece."""
    nodes, weights = np.polynomial.legendre.leggauss(16)
    x = np.concatenate([a + (b - a) * (nodes + 1) / 2 for a, b in zip(ends, ends[1:], strict=False)])
    steps = np.concatenate([(b - a) / 2 * weights for a, b in zip(ends, ends[1:], strict=False)])
    return float(logsumexp([log_density(p) for p in x], b=steps * [prior(p) for p in x]))


def as_weighed(scales: Scales, values: dict[str, float], v, parts) -> SimpleNamespace:
    """What scoring needs of a set that was weighed."""
    fit = SimpleNamespace(values=values, prediction=scales.bench.predict(values))
    return SimpleNamespace(refit=fit, v=np.asarray(v, float), parts=parts)

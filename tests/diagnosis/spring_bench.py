"""A bench in closed form: a cubic spring with candidates that can be worked out by hand, to test the engine alone."""

import copy

import numpy as np

from tissuejax.diagnosis.bench import Bench, Candidate, Free
from tissuejax.diagnosis.judgement.answer import Answered, answer
from tissuejax.diagnosis.judgement.blocks import blocks, driven_states, series
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.judgement.search import Setup
from tissuejax.estimation.discrepancy import discrepancy
from tissuejax.estimation.series import Segment

TIME = np.arange(0, 20.0, 0.05)


def drive(seed: int) -> np.ndarray:
    """A ramp, a hold, a faster second ramp and a rest; amplitude and timing by seed."""
    r = np.random.default_rng(seed)
    top, low = r.uniform(0.2, 0.4), r.uniform(0.05, 0.15)
    knots = np.cumsum([0, 1, r.uniform(1, 4), 4, 2, 1, r.uniform(0.5, 2), 3, 10])
    return np.interp(TIME, knots, [0, 0, top, top, low, low, 1.2 * top, 0, 0])


class Spring(Bench):
    """y = a x + b x^3, with relaxation of the linear part, an offset, a wave and a quadratic term as candidates."""

    def predict(self, values, recordings=None):
        v = {**self.start, **dict(values)}
        return np.concatenate([self._one(v, s.drive) for s in self.segments])

    def jacobian(self, values, paths, recordings=None):
        at, columns = {**self.start, **dict(values)}, []
        for p in paths:
            h = 1e-6 * max(self.free[p].scale, abs(at[p]))
            columns.append((self.predict({**at, p: at[p] + h}) - self.predict({**at, p: at[p] - h})) / (2 * h))
        return np.stack(columns, axis=1)

    @staticmethod
    def _one(v, x):
        lag, dt = np.zeros_like(x), TIME[1]
        decay = np.exp(-dt / v["relax.tau"])
        for i in range(1, len(x)):
            lag[i] = decay * lag[i - 1] + (1 - decay) / (dt / v["relax.tau"]) * (x[i] - x[i - 1])
        elastic = v["a"] * ((1 - v["relax.g"]) * x + v["relax.g"] * lag) + v["b"] * x**3 + v["form.c"] * x**2
        wave = v["wave.s"] * np.sin(2 * np.pi * TIME / v["wave.period"])
        wave += v["wave.c"] * np.cos(2 * np.pi * TIME / v["wave.period"])
        return elastic + v["offset.value"] + wave


FREE = {
    "a": Free(0, np.inf, 10),
    "b": Free(-np.inf, np.inf, 10),
    "relax.g": Free(0, 0.95, 0.1),
    "relax.tau": Free(0.02, 100, 1, "s", log=True),
    "form.c": Free(-np.inf, np.inf, 10),
    "offset.value": Free(-np.inf, np.inf, 0.1),
    "wave.s": Free(-np.inf, np.inf, 0.1),
    "wave.c": Free(-np.inf, np.inf, 0.1),
    "wave.period": Free(0.2, 10, 1, "s", log=True),
}
START = {p: 0.0 for p in FREE} | {"a": 5.0, "relax.tau": 1.0, "wave.period": 1.0}
CANDIDATES = {
    "relax": Candidate("relax", ("relax.g",), ("relax.tau",), tuple({"relax.tau": t} for t in (0.1, 0.3, 1, 3, 10))),
    "form": Candidate("form", ("form.c",)),
    "offset": Candidate("offset", ("offset.value",)),
    "wave": Candidate(
        "wave",
        ("wave.s", "wave.c"),
        ("wave.period",),
        tuple({"wave.period": t} for t in np.geomspace(0.4, 8, 60)),
    ),
}


def spring(truth, *, seed=0, sigma=0.05, rho=0.0, names=("r1", "r2", "r3"), held_out=("r3",)):
    """A sample of the spring with `truth` switched on and noise of correlation `rho`."""
    rng = np.random.default_rng(seed)
    n = len(TIME)
    segments = [
        Segment(name, "force", "", slice(i * n, (i + 1) * n), TIME, "N", drive(1000 * seed + i), "shear", "1")
        for i, name in enumerate(names)
    ]
    fitted = tuple(x for x in names if x not in held_out)
    sample = Spring(
        segments,
        np.zeros(n * len(names)),
        np.full(n * len(names), sigma),
        fitted,
        held_out,
        ("a", "b"),
        FREE,
        START,
        CANDIDATES,
    )
    y = sample.predict({"a": 10.0, "b": 20.0, **truth})
    for s in segments:
        e = rng.normal(size=n)
        for i in range(1, n):
            e[i] = rho * e[i - 1] + np.sqrt(1 - rho**2) * e[i]
        y[s.rows] += sigma * e
    sample.y = y
    return sample


def judged(bench: Bench, effort: Effort | None = None) -> Answered:
    """The answer of the judgement, all recordings weighed."""
    whole = copy.copy(bench)
    whole.fitted, whole.held_out = (*bench.fitted, *bench.held_out), ()
    cut = blocks(whole)
    of = discrepancy(series(whole, cut, driven_states(whole)), cut.spread(whole.sigma))
    return answer(bench, whole, cut, of, Setup(effort=effort or Effort()))

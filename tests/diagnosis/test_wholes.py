"""Parts of one whole (Prony weights) stay below it in a diagnosis too: in its fits, and in the evidence of its sets."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import norm
from spring_bench import FREE, START, TIME, Spring, spring
from test_unread import recorded

from tissuejax.diagnosis.bench import Candidate, Free
from tissuejax.diagnosis.judgement.marginal import Blocked, Linear
from tissuejax.diagnosis.judgement.ranges import on_bounds
from tissuejax.diagnosis.material import MaterialBench
from tissuejax.diagnosis.misfit import white
from tissuejax.diagnosis.refit import Resting, refit
from tissuejax.energies.catalogue import energy
from tissuejax.estimation.discrepancy import Part
from tissuejax.estimation.reach import Reach, Whole

PARTS = Candidate("parts", ("g.1", "g.2"))
BASIS = (np.exp(-TIME / 2.0), np.sin(TIME))


class Shared(Spring):
    """The spring beside two series of known course whose weights are parts of one whole."""

    def predict(self, values, recordings=None):
        v = {**self.start, **dict(values)}
        more = sum(v[f"g.{i}"] * b for i, b in enumerate(BASIS, 1))
        return super().predict(values) + np.tile(more, len(self.segments))


def shared(weights, *, whole="g", upper=1.0):
    """A sample whose weights may be more than there is, with noise of 0.05."""
    made = spring({}, held_out=(), names=("r1", "r2"))
    add = sum(w * b for w, b in zip(weights, BASIS, strict=True))
    parts = {p: Free(0.0, upper, 0.1, whole=whole) for p in ("g.1", "g.2")}
    return Shared(
        [replace(s, drive_name="shear") for s in made.segments],
        made.y + np.tile(add, len(made.segments)),
        made.sigma,
        made.fitted,
        (),
        made.base,
        FREE | parts,
        START | {"g.1": 0.0, "g.2": 0.0},
        {"parts": PARTS},
    )


def test_a_step_to_more_than_there_is_leads_to_the_best_that_there_is():
    rng = np.random.default_rng(4)
    y = np.array([0.2, 0.3, 0.1, 0.0])
    for t, aim in ((rng.normal(size=(6, 4)), 3 * rng.normal(size=6)) for _ in range(20)):
        reach = Reach(np.zeros(4), np.ones(4), np.ones(4), wholes=(Whole((0, 1, 2), 1.0),))
        found = reach.trial(t, aim, np.zeros(4), y, 0)
        enough = {"type": "ineq", "fun": lambda z: 1 - np.sum(z[:3])}
        best = minimize(
            lambda z, t=t, aim=aim: np.sum((t @ (z - y) - aim) ** 2), y,
            method="SLSQP", bounds=[(0, 1)] * 4, constraints=enough, options={"ftol": 1e-14, "maxiter": 500},
        )  # fmt: skip
        assert np.sum(found[:3]) <= 1 + 1e-12
        assert np.sum((t @ (found - y) - aim) ** 2) == pytest.approx(best.fun, rel=1e-5)


def test_a_fit_keeps_to_the_whole_where_the_data_would_have_more():
    bench = shared((0.9, 0.4))
    found = refit(bench, white(bench), ("parts",), {})
    weights = np.array([found.values["g.1"], found.values["g.2"]])
    enough = {"type": "ineq", "fun": lambda z: 1 - z[2] - z[3]}

    def chi2(z):
        values = dict(zip((*bench.base, "g.1", "g.2"), z, strict=True))
        return float(np.sum(((bench.y - bench.predict(values)) / bench.sigma) ** 2))

    first = [START[p] for p in bench.base] + [0.5, 0.4]
    bounds = [(None, None)] * len(bench.base) + [(0, 1)] * 2
    best = minimize(chi2, first, method="SLSQP", bounds=bounds, constraints=enough, options={"ftol": 1e-12})
    assert np.sum(weights) == pytest.approx(1.0, abs=1e-9)
    # and without the whole they are what they were made with
    free = refit(shared((0.9, 0.4), whole=""), white(bench), ("parts",), {})
    assert [free.values["g.1"], free.values["g.2"]] == pytest.approx([0.9, 0.4], abs=0.02)
    assert found.chi2 == pytest.approx(best.fun, rel=1e-4)
    np.testing.assert_allclose(weights, best.x[-2:], atol=2e-3)


def test_a_known_part_leaves_less_for_the_others():
    bench = shared((0.3, 0.4))
    bench.candidates["parts"] = replace(PARTS, amplitudes=("g.2",))
    bench.known = {"g.1": 0.8}
    assert refit(bench, white(bench), ("parts",), {}).values["g.2"] == pytest.approx(0.2, abs=1e-9)


def test_the_evidence_at_the_whole_is_the_mass_inside_it():
    """A linear model of three parameters, the last two parts of a whole that the data would have more of: the mass of
    a normal density on this side of the end is Phi(-d/s) of all of it, d the peak beyond, s the spread of the sum."""
    rng = np.random.default_rng(7)
    n, sigma, end = 12, 0.3, 1.0
    jac = rng.normal(size=(n, 3))
    y = jac @ [2.0, 0.9, 0.4] + sigma * rng.normal(size=n)
    information = jac.T @ jac / sigma**2
    peak = np.linalg.solve(information, jac.T @ y / sigma**2)
    spread = np.sqrt(np.array([0, 1, 1]) @ np.linalg.inv(information) @ [0, 1, 1])
    left = y - jac @ peak
    whole = 1.5 * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(information)[1] - 0.5 * left @ left / sigma**2
    inside = whole + norm.logcdf((end - peak[1] - peak[2]) / spread)

    ends = np.full(3, np.inf)
    resting = Resting(np.array([False, True, False]), np.array([1.0, -1.0, 1.0]), ends, ends, ((1, np.array([2])),))
    slopes = resting.along(jac)
    free = ~resting.on
    rest = y - end * jac[:, 1]  # the largest stands for the sum
    precision = slopes[:, free].T @ slopes[:, free] / sigma**2
    r = rest - slopes[:, free] @ np.linalg.solve(precision, slopes[:, free].T @ rest / sigma**2)
    stub = SimpleNamespace(blocked=Blocked((slice(0, n),), np.full(n, sigma)))
    none = [Part("none", "none", factor=np.zeros((n, 1)))]
    every = Linear(r, slopes, np.zeros(3), np.zeros(3))
    beside = on_bounds(stub.blocked, none, np.zeros(1), every, resting, free, precision)
    along = np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(precision)[1] - 0.5 * r @ r / sigma**2
    assert along + beside == pytest.approx(inside, abs=1e-9)
    assert inside < whole - 1.0  # it says something


def test_weights_of_a_relaxation_are_parts_of_a_whole():
    made = MaterialBench.of(
        recorded("pull"), energy("neo-hookean"), ("pull",), (), {"pull": 2.0}, ["viscoelasticity", "drift"]
    )
    weights = {p: f.whole for p, f in made.free.items() if p.startswith("effects.viscoelasticity.g")}
    assert len(weights) == 3
    assert set(weights.values()) == {"effects.viscoelasticity"}
    assert {f.whole for p, f in made.free.items() if p not in weights} == {""}

"""What a fit does with noise, held-out recordings and idle terms: against dense matrices and rounds by hand."""

import math
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from toy import TRUE, problem, toy_sample

from tissuejax.estimation.descent import Ended
from tissuejax.estimation.ending import Ending
from tissuejax.estimation.noise import Noise
from tissuejax.estimation.weights import Weights
from tissuejax.fitting import least_squares as room
from tissuejax.fitting.least_squares import curvature, fit
from tissuejax.fitting.options import Search
from tissuejax.fitting.serial import Serial
from tissuejax.recordings.recording import Channel, Recording

EXACT = Ended(np.zeros(1), 1.0, Ending.CONVERGED, np.zeros(0), np.zeros((0, 1)), 1, 1)


def level(estimated: bool) -> Any:
    """A problem whose noise was recorded or not."""
    return SimpleNamespace(noise=SimpleNamespace(estimated=estimated))


def carried(n: int) -> tuple[Serial, np.ndarray]:
    """Rows 5 to 24 of n are correlated; the dense matrix."""
    time, noise, rows = np.linspace(0, 4, 20), Noise(0.6, 0.8, 0.9), np.arange(5, 25)
    whole = np.eye(n)
    whole[np.ix_(rows, rows)] += 0.64 * (np.exp(-np.abs(time[:, None] - time) / 0.9) - np.eye(20))
    return Serial(((rows, time, noise),)), whole


def satterthwaite(r: np.ndarray, jacobian: np.ndarray, V: np.ndarray) -> tuple[float, float, float]:
    """Widening, degrees of freedom and the deviation of chi-square under the matrix V, dense."""
    q = np.linalg.qr(jacobian[:, jacobian.any(axis=0)])[0]
    left = max(len(r) - np.trace(q.T @ V @ q), 1.0)
    squares = np.trace(V @ V) * left / len(r)
    return math.sqrt(r @ r / left), max(1.0, left**2 / squares), math.sqrt(2 * squares)


@pytest.mark.parametrize("by", [-3.6, -3.4, 3.4, 3.6])
def test_correlated_residuals_have_fewer_degrees_of_freedom_and_scatter_more(rng, by):
    memory, V = carried(120)
    J, r = rng.standard_normal((120, 3)), rng.standard_normal(120)
    J = J @ np.diag([1e3, 1e-13, 0.0])  # the last does nothing: takes nothing up
    estimated, known = level(True), level(False)
    wide, dof, spread = satterthwaite(r, J, V)
    assert room._scatter(estimated, r, J, memory) == pytest.approx((wide, dof), rel=1e-9)
    r *= math.sqrt(1 + by * spread / (r @ r / wide**2)) / wide
    expected = (1.0, np.inf) if abs(by) < 3.5 else satterthwaite(r, J, V)[:2]
    assert room._scatter(known, r, J, memory) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("apart", "left"), [(0.9e-10, 8), (1.2e-10, 7)])
def test_a_column_counts_from_a_ten_thousand_millionth_of_the_largest_on(apart, left):
    """Two columns that differ along one entry: singular values sqrt(2) and apart / sqrt(2)."""
    J = np.zeros((9, 2))
    J[0], J[1, 1] = 1.0, 2 * apart
    r = np.full(9, 2.0)
    assert room._scatter(level(True), r, J, Serial()) == pytest.approx((math.sqrt(36 / left), left))


def test_as_many_parameters_as_samples_leave_one_degree_of_freedom(rng):
    r = rng.standard_normal(4)
    assert room._scatter(level(True), r, rng.standard_normal((4, 4)), Serial()) == pytest.approx(
        (np.linalg.norm(r), 1.0)
    )


@pytest.mark.parametrize("correlated", [True, False])
def test_uncertainty_is_that_of_least_squares_under_the_noise_s_covariance(rng, monkeypatch, correlated):
    """(J'J)^-1 J'VJ (J'J)^-1 widened by the residuals' scatter, with names as a reader knows them."""
    p = problem(toy_sample(rng, TRUE, n=20, noise=3.0), ("energy.a", "energy.rate"))
    p = p.with_noise(Weights({key: 1.0 for key in p.noise.std}))  # stated a third of what it is
    memory, V = carried(40) if correlated else (Serial(), np.eye(40))
    asked = []
    monkeypatch.setattr(room, "serial", lambda posed, r: asked.append((posed, r)) or memory)
    found = curvature(p, TRUE)
    r, J = p.linearised(TRUE)
    assert asked[0][0] is p
    np.testing.assert_array_equal(asked[0][1], r)
    inverse = np.linalg.inv(J.T @ J)
    wide, dof, _ = satterthwaite(r, J, V)
    np.testing.assert_allclose(found.covariance, wide**2 * inverse @ J.T @ V @ J @ inverse, rtol=1e-8)
    assert (found.widening, found.dof, found.serial) == (pytest.approx(wide), pytest.approx(dof), correlated)
    blind = problem(toy_sample(rng, TRUE, n=20, noise=3e5), ("energy.a", "energy.rate"))
    said = " ".join(curvature(blind, TRUE).sentences)
    assert "energy." not in said
    assert "rate" in said


@dataclass(frozen=True)
class Straight:
    """(X x - data) / std in channels of a recording r, x the two free parameters."""

    X: np.ndarray
    data: np.ndarray
    rows: dict
    noise: Weights
    free = ("a", "b")
    moduli = ()
    priors: dict = field(default_factory=dict)
    loss: str = "squares"

    @property
    def n_samples(self):
        return len(self.data)

    @property
    def std(self):
        out = np.ones(len(self.data))
        for key, rows in self.rows.items():
            out[rows] = self.noise.std["/".join(key)]
        return out

    def values(self, x):
        return dict(zip(self.free, x, strict=True))

    def residuals(self, values):
        return (self.X @ list(values.values()) - self.data) / self.std

    def with_noise(self, noise):
        return replace(self, noise=noise)

    def solved(self):
        x = np.linalg.lstsq(self.X / self.std[:, None], self.data / self.std, rcond=None)[0]
        cost = 0.5 * float(np.sum(self.residuals(self.values(x)) ** 2))
        return replace(EXACT, y=x, cost=cost, runs=3, trace=[(8 * cost, x), (cost, x)])


def straight(rng, groups, **options) -> Any:
    """Three channels of 12, 7 and 5 samples, with noise of 1, 5 and 0.2."""
    X = rng.normal(size=(24, 2))
    data = X @ [2.0, -1.0] + np.repeat([1.0, 5.0, 0.2], [12, 7, 5]) * rng.normal(size=24)
    rows = {("r", "x"): slice(0, 12), ("r", "y"): slice(12, 19), ("r", "z"): slice(19, 24)}
    return Straight(X, data, rows, Weights({"r/x": 2.0, "r/y": 1.0, "r/z": 3.0}, groups), **options)


@pytest.fixture
def descents(monkeypatch):
    """Every descent is solved for at once."""
    calls = []
    monkeypatch.setattr(room, "descend", lambda p, start, **options: calls.append((start, options)) or p.solved())
    return calls


@pytest.mark.parametrize("groups", [{"r/x": "Pa", "r/y": "N", "r/z": "Pa"}, {"r/x": "Pa", "r/y": "Pa"}])
def test_several_unknown_levels_are_estimated_in_three_rounds(rng, descents, groups):
    """Reweighted least squares: squares of a group over its samples less its part of the parameters."""
    p = straight(rng, groups)
    first = p.solved()
    found, best, n = room._with_estimated_noise(p, first, {"max_steps": 44})
    std, x = {"r/x": 2.0, "r/y": 1.0, "r/z": 3.0}, first.y
    for _ in range(3):
        left = p.X @ x - p.data
        for group in set(groups.values()):
            mine = [(key, left[p.rows["r", key[-1]]] / std[key]) for key, g in groups.items() if g == group]
            m = sum(len(r) for _, r in mine)
            level = math.sqrt(sum(r @ r for _, r in mine) / (m - 2 * m / 24))
            for key, _ in mine:
                std[key] *= level
        weights = 1 / np.repeat([std["r/x"], std["r/y"], std["r/z"]], [12, 7, 5])
        x = np.linalg.lstsq(p.X * weights[:, None], p.data * weights, rcond=None)[0]
    assert found.noise.std == pytest.approx(std, rel=1e-9)
    assert found.noise.groups == groups
    np.testing.assert_allclose(best.y, x, rtol=1e-9)
    assert n == 9
    assert [options for _, options in descents] == [{"max_steps": 44}] * 3


ONE = dict.fromkeys(("r/x", "r/y", "r/z"), "Pa")


def test_one_unknown_level_moves_nothing_but_the_scale_of_the_misfit(rng, descents):
    p = straight(rng, ONE)
    first = p.solved()
    found, best, n = room._with_estimated_noise(p, first, {})
    level = math.sqrt(2 * first.cost / 22)
    assert found.noise.std == pytest.approx({"r/x": 2 * level, "r/y": level, "r/z": 3 * level})
    assert (n, descents) == (0, [])
    assert best.cost == pytest.approx(11)  # chi-square is the degrees of freedom
    assert [cost for cost, _ in best.trace] == pytest.approx([88.0, 11.0])
    assert all(x is first.y for _, x in best.trace)


@pytest.mark.parametrize("options", [{"priors": {"a": (0.0, 1.0)}}, {"loss": "cauchy"}])
def test_beside_priors_or_under_a_robust_loss_one_level_is_followed_by_one_fit(rng, descents, options):
    p = straight(rng, ONE, **options)
    first = p.solved()
    found, best, n = room._with_estimated_noise(p, first, {})
    level = math.sqrt(2 * first.cost / 22)
    assert (n, len(descents)) == (3, 1)
    assert found.noise.std["r/y"] == pytest.approx(level)
    assert best.cost == pytest.approx(11)
    assert descents[0][0] == p.values(first.y)


def test_a_fit_under_new_levels_that_comes_to_nothing_is_not_taken(rng, monkeypatch):
    p = straight(rng, ONE, loss="cauchy")
    first = p.solved()
    monkeypatch.setattr(room, "descend", lambda *given, **options: replace(first, cost=np.inf, runs=7))
    _, best, n = room._with_estimated_noise(p, first, {})
    assert (best, n) == (first, 7)


def test_levels_stay_numbers_with_few_samples_and_with_none_left_over(rng, descents):
    """As many parameters as samples: one degree; what is met exactly keeps a thousand-millionth of its level."""
    X = np.eye(2)
    few: Any = Straight(X, np.zeros(2), {("r", "x"): slice(0, 2)}, Weights({"r/x": 0.5}, {"r/x": "Pa"}))
    at = replace(EXACT, y=np.array([3.0, 4.0]), cost=50.0)
    assert room._with_estimated_noise(few, at, {})[0].noise.std["r/x"] == pytest.approx(5.0)
    at = replace(EXACT, y=np.zeros(2), cost=0.0)
    assert room._with_estimated_noise(few, at, {})[0].noise.std["r/x"] == pytest.approx(0.5e-9)


def recording(name, inputs=("stretch",), **channels) -> Recording:
    t = np.arange(9.0)
    made = {c: Channel(t, np.ones(9), "Pa", std) for c, std in channels.items()}
    return Recording(name, "uniaxial", {kind: 1 + t for kind in inputs}, made, {})


def posed(recordings, std, groups=None) -> Any:
    sample = SimpleNamespace(recordings={r.name: r for r in recordings})
    return SimpleNamespace(predictor=SimpleNamespace(sample=sample), noise=Weights(std, groups or {}))


def test_held_out_channels_have_their_own_noise_else_that_of_a_fitted_one_of_the_name():
    held = [recording("h", force=3.0, stress=None, strain=None), recording("g", force=None, stress=0.0)]
    p = posed([recording("r", force=2.0), *held], {"r/force": 2.0, "q/stress": 0.25})
    found = room._holdout_noise(p, ("h", "g"))
    assert found == {"h/force": 3.0, "h/stress": 0.25, "h/strain": 1.0, "g/force": 2.0, "g/stress": 0.25}


def test_of_material_tests_whose_noise_was_not_recorded_the_recordings_tell():
    """Not of those that go by what was stated, nor of other experiments; recorded numbers are what sigmas gives."""
    some = [
        recording("held", nominal_stress=3.0),
        recording("sheared", ("time", "shear"), nominal_stress=4.0),
        recording("guessed", nominal_stress=5.0),
        recording("stated", nominal_stress=6.0),
        recording("pressed", ("depth",), nominal_stress=7.0),
        recording("other", force=8.0),
        recording("out", nominal_stress=9.0),
    ]
    std = {f"{n}/nominal_stress": 1.0 for n in ("sheared", "guessed", "stated", "pressed")}
    p = posed(some, std, {f"{n}/nominal_stress": "Pa" for n in ("sheared", "guessed", "pressed")})
    names = ("held", "sheared", "guessed", "stated", "pressed", "other")
    expected = {"held/nominal_stress": 3.0, "sheared/nominal_stress": 4.0, "guessed/nominal_stress": 5.0}
    assert room._own_noise(p, names) == expected
    assert room._own_noise(p, ("stated", "pressed", "other")) == {}


def test_a_fit_tells_of_its_level_its_bounds_and_what_was_held_out(rng):
    """Of linear constants: the residuals' own level, chi-square that of the degrees of freedom, errors by hand."""
    p = problem(
        toy_sample(rng, TRUE, n=40, noise=2.0, recorded=False),
        ("energy.a", "energy.offset"),
        bounds={"energy.offset": (-100.0, 2.0)},
        start={"energy.offset": 1.0},
    )
    p = replace(p, predictor=p.predictor.of(("r1",)))
    found = fit(p, search=Search(multistart=1), holdout=("r2",))
    one, two = (r.channels["nominal_stress"] for r in p.predictor.sample.recordings.values())
    a, c = found.values["energy.a"], found.values["energy.offset"]
    one, two = (a * np.exp(-0.7 * r.time) + 40 * np.exp(-2.1 * r.time) + c - r.values for r in (one, two))
    assert found.at_bound == {"energy.offset": "upper"}
    assert c == pytest.approx(2.0, abs=1e-6)
    assert found.problem.noise.std["r1/nominal_stress"] == pytest.approx(math.sqrt(one @ one / 38), rel=1e-6)
    assert found.chi2 == pytest.approx(38.0, rel=1e-6)
    assert (set(found.channels), set(found.holdout)) == ({"r1/nominal_stress"}, {"r2/nominal_stress"})
    assert found.channels["r1/nominal_stress"].rmse == pytest.approx(math.sqrt(np.mean(one**2)), rel=1e-6)
    assert found.holdout["r2/nominal_stress"].chi2_per_sample == pytest.approx(np.mean(two**2) / (one @ one / 38))
    assert set(found.predictions) == {"r1", "r2"}
    assert found.n_evaluations == 2


def waking(monkeypatch, costs, series, moduli, woken, modulus=lambda p, v: None):
    """`_awake` from a cost of 1 where descents end at these costs."""
    ends = iter(costs)
    starts = []

    def descend(p, start, **options):
        starts.append(start)
        return replace(EXACT, y=np.array([float(len(starts))]), cost=next(ends), runs=len(starts))

    for name, made in (("descend", descend), ("woken", woken), ("woken_modulus", modulus)):
        monkeypatch.setattr(room, name, made)
    monkeypatch.setattr(room, "terms", lambda p: [[("g", "tau")] * k for k in series])
    p: Any = SimpleNamespace(values=lambda x: {"x": float(x[0])}, moduli=moduli)
    best, n = room._awake(p, EXACT, {})
    return best.cost, n, starts


def test_idle_terms_are_woken_as_long_as_that_gains_a_ten_thousandth(monkeypatch):
    wake = lambda p, values: values | {"g": 0.1}  # noqa: E731
    few = waking(monkeypatch, [0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3], (2, 1), ("m",), wake)
    assert few == (0.6, 1 + 2 + 3 + 4, [{"x": float(i), "g": 0.1} for i in range(4)])  # one for each term and modulus
    assert waking(monkeypatch, [0.9], (), (), wake) == (1.0, 0, [])
    gained = waking(monkeypatch, [0.5, 0.5 * 0.99985, 0.5 * 0.99985 * 0.99995, 0.0], (9,), (), wake)
    assert gained[:2] == (0.5 * 0.99985, 6)  # the third gains too little and is not taken
    assert waking(monkeypatch, [np.nan, 0.1], (9,), (), wake)[:2] == (1.0, 1)


def test_a_modulus_is_woken_where_no_term_is_idle_and_nothing_is_done_where_none_is(monkeypatch):
    told = iter([{"g": 0.1}, None, None])
    found = waking(
        monkeypatch,
        [0.9, 0.8],
        (5,),
        ("m",),
        lambda p, values: next(told),
        lambda p, values: {"m": 1.0} if values["x"] < 2 else None,
    )
    assert found == (0.8, 3, [{"g": 0.1}, {"m": 1.0}])

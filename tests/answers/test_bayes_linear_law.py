"""Posterior density and profiles of a law that is linear in all it has, against dense matrices and closed forms."""

import math
from dataclasses import FrozenInstanceError, replace
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import expit

from tissuejax.errors import InputError
from tissuejax.estimation.covariance import Uncertainty
from tissuejax.estimation.problem import Problem
from tissuejax.estimation.weights import Weights
from tissuejax.fitting.profile import crossing, profile
from tissuejax.fitting.target import Target
from tissuejax.parameters import Parameter
from tissuejax.recordings.recording import Channel, Recording, Sample

INF = math.inf
RNG = np.random.default_rng(12)
DECLARED = {
    "energy.m": Parameter("m", "Pa", 3.0),  # a modulus without bounds
    "energy.low": Parameter("low", "1", 2.5, lower=1.0),
    "energy.held": Parameter("held", "1", 0.5),
    "energy.high": Parameter("high", "1", -4.0, upper=5.0),
    "energy.both": Parameter("both", "1", 0.5, lower=-1.0, upper=2.0),
}
FREE = ("energy.both", "energy.m", "energy.low", "energy.high")
ORDER = [list(DECLARED).index(p) for p in FREE]
SHAPES = {("one", "force"): (5,), ("two", "pair"): (4, 2), ("two", "flow"): (3,)}
SIGMA = {("one", "force"): 0.5, ("two", "pair"): 2.0, ("two", "flow"): 0.1}
SLOPES = {key: RNG.normal(size=(*shape, 5)) for key, shape in SHAPES.items()}
LEFT = {key: RNG.normal(size=shape) for key, shape in SHAPES.items()}  # with all parameters zero
PRIORS = {"energy.low": (2.0, 0.4), "energy.held": (0.1, 0.2)}
START = {path: d.default for path, d in DECLARED.items()}


class Linear:
    """Every channel is a constant and a share of every parameter."""

    def __init__(self, sample, declared=None, slopes=None, left=None, name="homogeneous"):
        self.sample, self.names, self.name = sample, tuple(sample.recordings), name
        self.model = SimpleNamespace(parameters=declared or DECLARED, effects=(), volumetric=None)
        self.slopes, self.left = slopes or SLOPES, left or LEFT

    def predict(self, values):
        x = jnp.stack([jnp.asarray(values[p], float) for p in self.model.parameters])
        return {
            r.name: replace_channels(r, {c: self.left[r.name, c] + self.slopes[r.name, c] @ x for c in r.channels})
            for r in self.sample.recordings.values()
        }

    def jacobian(self, values, paths):
        places = {p: list(self.model.parameters).index(p) for p in paths}
        return self.predict(values), {
            p: {
                r.name: {c: self.slopes[r.name, c][..., i] for c in r.channels} for r in self.sample.recordings.values()
            }
            for p, i in places.items()
        }


def replace_channels(recording, values):
    channels = {c: Channel(recording.channels[c].time, v, "Pa") for c, v in values.items()}
    return Recording(recording.name, recording.experiment, recording.inputs, channels, {})


def measured(seed=3):
    """Three channels, one of them of two components, with lost samples."""
    rng = np.random.default_rng(seed)
    values = {key: rng.normal(size=shape) for key, shape in SHAPES.items()}
    values["one", "force"][2] = np.nan
    values["two", "pair"][1, 1] = np.nan
    recordings = {}
    for name in ("one", "two"):
        channels = {c: Channel(np.arange(len(v) * 1.0), v, "Pa", 1.0) for (r, c), v in values.items() if r == name}
        recordings[name] = Recording(name, "linear", {}, channels, {})
    return Sample("made", recordings)


def posed(seed=3, predictor: Any = Linear, priors: Any = PRIORS, loss="squares") -> Any:
    """The problem of these data with priors on a free and on a held parameter."""
    noise = Weights({"/".join(key): s for key, s in SIGMA.items()})
    return Problem(predictor(measured(seed)), FREE, START, noise, {}, priors, loss)


def dense(sample):
    """Slopes to all five parameters over the noise and what the data ask of them, the priors' rows last."""
    rows, asked = [], []
    for (r, c), slope in SLOPES.items():
        data = np.asarray(sample.recordings[r].channels[c].values).ravel()
        seen = np.isfinite(data)
        rows.append(slope.reshape(-1, 5)[seen] / SIGMA[r, c])
        asked.append((data - LEFT[r, c].ravel())[seen] / SIGMA[r, c])
    rows.append(np.array([[0.0, 1 / 0.4, 0.0, 0.0, 0.0], [0.0, 0.0, 1 / 0.2, 0.0, 0.0]]))
    asked.append(np.array([2.0 / 0.4, 0.1 / 0.2]))
    return np.concatenate(rows), np.concatenate(asked)


def chi_square(x, sample):
    """At free parameters x, the held one at its start."""
    rows, asked = dense(sample)
    whole = np.array(list(START.values()))
    whole[ORDER] = x
    return float(np.sum((rows @ whole - asked) ** 2))


def by_formula(y):
    """x(y) and dx/dy as the table of transforms has them; scales are 0.5, 3, 2.5 and 4."""
    both, m, low, high = np.asarray(y)
    x = [-1 + 3 * expit(both), 3 * m, 1 + 2.5 * np.logaddexp(0, low), 5 - 4 * np.logaddexp(0, -high)]
    return np.array(x), [3 * expit(both) * expit(-both), 3.0, 2.5 * expit(low), 4 * expit(-high)]


PLACES = np.concatenate([np.random.default_rng(0).normal(size=(6, 4)), 40 * np.eye(4), -40 * np.eye(4)])


@pytest.mark.parametrize("c", [1.0, 2.5])
def test_the_density_is_the_tempered_normal_one_times_the_change_of_variable(c):
    """Also forty off zero, where a parameter lies within e^-40 of its bound; and for other data."""
    problem = posed()
    of = Target(problem, c) if c != 1.0 else Target(problem)
    assert (of.tempering, of.problem is problem) == (c, True)
    other = Target(posed(8)).data
    assert of.data.shape == other.shape == (14,)
    for sample, data in ((measured(), of.data), (measured(8), other)):
        expected, chi2 = [], []
        for y in PLACES:
            x, slope = by_formula(y)
            chi2.append(chi_square(x, sample))
            expected.append(-0.5 * chi2[-1] / c + np.sum(np.log(slope)))
            assert of.density(y, data) == pytest.approx(expected[-1], rel=1e-12)
        np.testing.assert_allclose(of.many(PLACES, data), expected, rtol=1e-12)
        x = np.array([by_formula(y)[0] for y in PLACES])
        np.testing.assert_allclose(of.likelihoods(x, data), -0.5 * np.array(chi2), rtol=1e-12)
        np.testing.assert_allclose(of.log_likelihood(jnp.asarray(x[0]), jnp.asarray(data)), -0.5 * chi2[0], rtol=1e-12)


def test_the_density_has_the_slope_of_its_differences():
    of = Target(posed(), 1.5)
    slope = jax.grad(of.density)
    for y in PLACES[:6]:
        steps = 1e-4 * np.eye(4)
        told = [(of.density(y + h, of.data) - of.density(y - h, of.data)) / 2e-4 for h in steps]
        np.testing.assert_allclose(slope(jnp.asarray(y), of.data), told, rtol=1e-5, atol=1e-5)
    assert np.isfinite(slope(40 * jnp.ones(4), of.data)).all()


def test_coordinates_go_there_and_back_and_many_at_once():
    of = Target(posed())
    x = np.array([by_formula(y)[0] for y in PLACES[:6]])
    np.testing.assert_allclose(of.parameters(PLACES[:6]), x, rtol=1e-12)
    np.testing.assert_allclose(of.parameters(PLACES[0]), x[:1], rtol=1e-12)
    np.testing.assert_allclose([of.start(row) for row in x], PLACES[:6], rtol=1e-9, atol=1e-9)


def test_other_data_take_over_what_is_compiled_and_how_it_is_tempered():
    of = Target(posed(), 3.0)
    other = of.with_data_of(posed(8))
    assert (other.density, other.many, other.likelihoods) == (of.density, of.many, of.likelihoods)
    assert other.tempering == 3.0
    assert other.problem is not of.problem
    np.testing.assert_array_equal(other.data, Target(posed(8)).data)
    x, slope = by_formula(PLACES[0])
    told = other.density(PLACES[0], other.data)
    assert told == pytest.approx(-chi_square(x, measured(8)) / 6 + np.sum(np.log(slope)), rel=1e-12)


@pytest.mark.parametrize("c", [1.0, 4.0])
def test_the_covariance_of_the_coordinates_is_the_inverse_of_the_information(c):
    y = PLACES[1]
    x, slope = by_formula(y)
    jacobian = dense(measured())[0][:, ORDER] * slope
    np.testing.assert_allclose(Target(posed(), c).covariance(x), c * np.linalg.inv(jacobian.T @ jacobian), rtol=1e-8)


def test_what_is_not_seen_has_a_covariance_all_the_same():
    """Two equal columns: their difference is as little seen as 1e-8 of what is seen best."""
    slopes = {key: s[..., [0, 0, 2, 2, 4]] * [1, 1, 1, 0, 0] for key, s in SLOPES.items()}
    declared = {path: replace(d, lower=-INF, upper=INF, scale=1.0) for path, d in DECLARED.items()}
    problem = posed(predictor=lambda sample: Linear(sample, declared, slopes), priors={})
    problem = replace(problem, free=("energy.m", "energy.low"), start=dict.fromkeys(DECLARED, 1.0))
    column = np.concatenate(
        [
            s[..., 0].ravel()[np.isfinite(np.asarray(measured().recordings[r].channels[c].values)).ravel()]
            / SIGMA[r, c]
            for (r, c), s in slopes.items()
        ]
    )
    least = 1e-16 * 2 * column @ column
    found = Target(problem).covariance(np.ones(2))
    np.testing.assert_allclose(found, 0.5 / least * np.array([[1, -1], [-1, 1]]), rtol=1e-6)


def test_probings_and_robust_losses_have_no_posterior():
    with pytest.raises(InputError, match="posteriors are for material tests"):
        Target(posed(predictor=lambda sample: Linear(sample, name="probing")))
    with pytest.raises(InputError, match="loss 'cauchy' is none: use squares"):
        Target(posed(loss="cauchy"))


def found_of(problem, std=None, inflation=None, q=1.96) -> Any:
    """The least squares of a problem, by the normal equations; standard errors are those unless told."""
    rows, asked = dense(problem.predictor.sample)
    held = [i for i in range(5) if i not in ORDER]
    left = asked - rows[:, held] @ np.array(list(START.values()))[held]
    J = rows[:, ORDER]
    x = np.linalg.lstsq(J, left, rcond=None)[0]
    exact = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    return SimpleNamespace(
        problem=problem,
        free=problem.free,
        values=START | dict(zip(FREE, map(float, x))),
        std=dict(zip(FREE, exact if std is None else std * exact)),
        uncertainty=SimpleNamespace(inflation=inflation, quantile=lambda: q),
        chi2=float(np.sum((J @ x - left) ** 2)),
    ), exact


def unbounded():
    """The problem above with no bound anywhere, and nothing in Pa."""
    declared = {p: replace(d, unit="1", lower=-INF, upper=INF) for p, d in DECLARED.items()}
    return posed(predictor=lambda sample: Linear(sample, declared))


@pytest.mark.parametrize(("share", "reached"), [(1.0, 6), (0.5, 8), (0.1, 18)])
@pytest.mark.parametrize("inflation", [None, np.array([0.5, 4.0, 1.0, 2.25])])
def test_a_profile_is_a_parabola_and_is_walked_until_it_has_risen_enough(share, reached, inflation):
    """Others solved for anew at each place, chi-square rises by the square of steps in exact standard errors, over the
    widening. Six points a side to three standard errors, as many as three times that where these are too small."""
    q = 1.96 / (1.0 if inflation is None else np.sqrt(inflation[1]))  # the same reach in exact standard errors
    found, exact = found_of(unbounded(), share, inflation, q)
    i, path = 1, FREE[1]
    told = profile(found, path)
    steps = 0.5 * share * exact[i] * np.arange(-reached, reached + 1)
    assert told.path == path
    np.testing.assert_allclose(told.values, found.values[path] + steps, rtol=1e-12, atol=1e-12)
    rise = (steps / exact[i]) ** 2 / (1.0 if inflation is None else inflation[i])
    np.testing.assert_allclose(told.rise, rise, rtol=1e-5, atol=1e-7)
    half = 1.96 * exact[i] if share > 0.1 else INF
    assert told.interval == pytest.approx((found.values[path] - half, found.values[path] + half), rel=1e-6)


@pytest.mark.parametrize("path", FREE)
def test_a_profile_in_steps_of_ones_own_crosses_at_the_quantile(path):
    found, exact = found_of(unbounded(), q=2.3)
    told = profile(found, path, reach=4.0, points=5)
    i = FREE.index(path)
    np.testing.assert_allclose(told.values, found.values[path] + 0.8 * exact[i] * np.arange(-5, 6), rtol=1e-11)
    half = 2.3 * exact[i]
    assert told.interval == pytest.approx((found.values[path] - half, found.values[path] + half), rel=1e-6)


def test_only_what_was_free_has_a_profile():
    found, _ = found_of(unbounded())
    with pytest.raises(InputError, match=r"energy\.held"):
        profile(found, "energy.held")


def single(std, q=2.0, at=0.0, typical=1.0, bounds=(-INF, INF), chi2=0.0, unit="1") -> Any:
    """A fit of y = x with unit noise to one datum, and a parameter by itself: chi-square is (x - at)^2."""
    declared = {"energy.x": Parameter("x", unit, 0.0, scale=typical)}
    channel = Channel(np.zeros(1), np.array([at]), "Pa", 1.0)
    sample = Sample("s", {"r": Recording("r", "linear", {}, {"y": channel}, {})})
    predictor: Any = Linear(sample, declared, {("r", "y"): np.ones((1, 1))}, {("r", "y"): np.zeros(1)})
    problem = Problem(predictor, ("energy.x",), {"energy.x": at}, Weights({"r/y": 1.0}), {"energy.x": bounds})
    spread = Uncertainty(np.array([std]), np.eye(1), np.eye(1), 1.0, ())
    said = SimpleNamespace(inflation=spread.inflation, quantile=(lambda: q) if q else spread.quantile)
    return SimpleNamespace(
        problem=problem, free=problem.free, values={"energy.x": at}, std={"energy.x": std}, uncertainty=said, chi2=chi2
    )


def test_a_rise_that_just_meets_the_threshold_is_walked_past():
    """(x - 0)^2 at steps of one; 4 is not above 4, and the crossing lies there to the digit."""
    told = profile(single(1.0), "energy.x", reach=2.0, points=2)
    np.testing.assert_array_equal(told.values, [-3, -2, -1, 0, 1, 2, 3])
    np.testing.assert_array_equal(told.rise, [9, 4, 1, 0, 1, 4, 9])
    assert told.interval == (-2.0, 2.0)
    with pytest.raises(FrozenInstanceError):
        told.path = "energy.y"  # pyright: ignore[reportAttributeAccessIssue]
    lower = profile(single(1.0, 1.9999, chi2=-1.0), "energy.x", reach=2.0, points=2)
    np.testing.assert_array_equal(lower.values, [-2, -1, 0, 1, 2])
    np.testing.assert_array_equal(lower.rise, [5, 2, 0, 2, 5])  # over the best fit's own


def test_the_quantile_is_that_of_the_standard_error():
    assert profile(single(1.0, 0.0), "energy.x", points=30).interval == pytest.approx((-1.959964, 1.959964), rel=1e-6)


def test_a_profile_ends_before_a_bound():
    """Not on it either; each side by itself."""
    told = profile(single(1.0, bounds=(-2.0, 2.5)), "energy.x", reach=2.0, points=2)
    np.testing.assert_array_equal(told.values, [-1, 0, 1, 2])
    assert told.interval == (-INF, INF)
    told = profile(single(1.0, 1.5, bounds=(-9.0, 2.0)), "energy.x", reach=3.0, points=3)
    np.testing.assert_array_equal(told.values, [-3, -2, -1, 0, 1])
    assert told.interval == (-1.5, INF)


@pytest.mark.parametrize(("std", "at", "typical", "step"), [
    (INF, 7.0, 4.0, 7.0),
    (INF, -7.0, 4.0, 7.0),
    (INF, 3.0, 4.0, 4.0),
    (math.nan, 3.0, 4.0, 4.0),
    (70.0, 3.0, 4.0, 70.0),  # ten times both together: taken as it is
    (70.1, 3.0, 4.0, 4.0),
    (110.0, -7.0, 4.0, 110.0),
    (110.1, -7.0, 4.0, 7.0),
])  # fmt: skip
def test_a_standard_error_beyond_all_measure_gives_way_to_the_parameters_size(std, at, typical, step):
    told = profile(single(std, at=at, typical=typical), "energy.x", reach=1.0, points=1)
    assert np.diff(told.values) == pytest.approx(np.full(len(told.values) - 1, step), rel=1e-12)


def test_a_crossing_lies_between_places_and_counts_from_nothing_below_the_best_fit():
    assert crossing(np.array([-3.0, 0.0, 3.0]), np.array([9.0, 0.0, 9.0]), 0.0, 4.0) == pytest.approx((-2.0, 2.0))
    mixed = crossing(np.array([2.0, -3.0, 0.0, 1.0]), np.array([9.0, 9.0, 0.0, -1.0]), 0.0, 4.0)
    assert mixed == pytest.approx((-2.0, 1 + 2 / 3))
    last = crossing(np.array([0.0, 1.0, 2.0]), np.array([-0.5, 2.25, 4.0]), 0.0, 4.0)
    assert last == (-INF, INF)  # meets it and no more
    assert crossing(np.array([0.0, 2.0]), np.array([-0.5, 16.0]), 0.0, 4.0) == pytest.approx((-INF, 1.0))

"""Draws of a posterior against normal laws by matrices; what is said of them, on both sides of each edge."""

import json
import math
import sys
from dataclasses import FrozenInstanceError
from importlib.util import find_spec
from types import SimpleNamespace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.errors import InputError
from tissuejax.fitting import posterior
from tissuejax.fitting.posterior import Posterior, _positive, laplace, nuts, nuts_draws, nuts_runner, target_of

BAYES = pytest.mark.skipif(
    find_spec("arviz") is None or find_spec("blackjax") is None, reason="the extra `bayes` is not installed"
)
COVARIANCE = np.array([[2.0, -1.2], [-1.2, 1.0]])
PRECISION = np.linalg.inv(COVARIANCE)
CENTRE = np.array([3.0, -1.0])  # of y = x - 10


class Bell:
    """A target that is normal in y = x - 10, up to a constant."""

    problem = SimpleNamespace(free=("energy.a", "energy.b"))
    data = np.array([4.0, 5.0])

    def start(self, x):
        return np.asarray(x) - 10

    def parameters(self, y):
        return np.atleast_2d(y) + 10

    def covariance(self, x):
        assert tuple(x) == tuple(CENTRE + 10)
        return COVARIANCE

    def density(self, y, data):
        return -0.5 * (y - CENTRE) @ PRECISION @ (y - CENTRE) + data[1]

    def many(self, y, data):
        self.asked = np.array(y)
        return jax.vmap(self.density, in_axes=(0, None))(jnp.asarray(y), data)


def bell() -> Any:
    return Bell()


def smoothed(monkeypatch, log_w, khat=0.1):
    """An arviz whose Pareto smoothing gives these; what it was asked for is kept in the list returned."""
    asked = []

    def psislw(given):
        asked.append(np.asarray(given))
        return np.asarray(log_w, float), np.float64(khat)

    monkeypatch.setattr(posterior, "_arviz", lambda: SimpleNamespace(psislw=psislw))
    return asked


def alike(n, of):
    """Log weights of which n count alike and the rest not at all."""
    return np.where(np.arange(of) < n, 0.0, -np.inf)


def draws_of(x, **checks):
    return Posterior("laplace", ("a", "b"), np.asarray(x, float), checks, ("Look.",))


def test_intervals_cut_the_same_share_off_either_end_of_all_chains():
    x = np.random.default_rng(0).permutation(1001) / 1000
    two = draws_of(np.stack([x[:1000], x[:1000]])[..., None] * [1.0, 4.0])
    assert two.flat.shape == (2000, 2)
    whole = draws_of(np.stack([x, 4 * x], -1)[None])
    for level, low, high in ((0.95, 0.025, 0.975), (0.5, 0.25, 0.75), (0.9, 0.05, 0.95)):
        ends = whole.interval(level)
        assert list(ends) == ["a", "b"]
        assert ends["a"] == pytest.approx((low, high), abs=1e-12)
        assert ends["b"] == pytest.approx((4 * low, 4 * high), abs=1e-12)
    assert whole.interval() == whole.interval(0.95)


def test_the_record_has_mean_and_spread_of_every_parameter_over_all_chains():
    x = np.array([[[0.0, 10.0], [2.0, 10.0]], [[4.0, 20.0], [6.0, 40.0]]])
    told = draws_of(x, khat=0.3).record()
    assert json.loads(json.dumps(told)) == told
    a, b = (told["parameters"][p] for p in ("a", "b"))
    assert (a["mean"], b["mean"]) == (3.0, 20.0)
    assert a["std"] == pytest.approx(math.sqrt(5))  # (9 + 1 + 1 + 9) / 4
    assert b["std"] == pytest.approx(math.sqrt(150))
    assert a["95 %"] == pytest.approx([0.15, 5.85])  # of 0, 2, 4, 6 at 0.075 and 2.925 places
    assert (told["method"], told["checks"], told["warnings"]) == ("laplace", {"khat": 0.3}, ["Look."])
    with pytest.raises(FrozenInstanceError):
        draws_of(x).method = "nuts"  # pyright: ignore[reportAttributeAccessIssue]


@BAYES
def test_arviz_is_given_every_parameter_by_chain():
    x = np.arange(12.0).reshape(2, 3, 2)
    told: Any = draws_of(x).arviz()
    np.testing.assert_array_equal(told.posterior["a"].values, x[:, :, 0])
    np.testing.assert_array_equal(told.posterior["b"].values, x[:, :, 1])
    assert told.attrs["method"] == "laplace"


@pytest.mark.parametrize(
    ("inflation", "c"), [(None, 1.0), ([0.2, 0.6], 1.0), ([0.5, 2.5], 1.5), ([4.0, 9.0], 6.5), ([0.5, 1.5], 1.0)]
)
def test_a_posterior_is_tempered_by_the_mean_widening_and_never_sharpened(monkeypatch, inflation, c):
    monkeypatch.setattr(posterior, "Target", lambda problem, tempering: (problem, tempering))
    spread = SimpleNamespace(inflation=None if inflation is None else np.array(inflation))
    found: Any = SimpleNamespace(problem="p", uncertainty=spread)
    assert target_of(found) == ("p", pytest.approx(c))


@pytest.mark.parametrize(("name", "ask"), [
    ("arviz", lambda: draws_of(np.zeros((1, 2, 2))).arviz()),
    ("arviz", lambda: laplace(bell(), CENTRE + 10)),
    ("blackjax", lambda: nuts_runner(bell(), 2, 1, 1)),
])  # fmt: skip
def test_a_missing_package_is_named_with_what_to_install(monkeypatch, name, ask):
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(InputError, match=r"needs the extra `bayes`: pip install 'tissuejax\[bayes\]'"):
        ask()


def test_draws_of_a_normal_law_weigh_the_same_and_have_its_moments(monkeypatch):
    """Density over that of the draws is a constant, whatever the correlation."""
    made = bell()
    asked = smoothed(monkeypatch, np.zeros(20000), 0.2)
    found = laplace(made, CENTRE + 10, 20000, 3)
    np.testing.assert_allclose(asked[0], np.full(20000, made.data[1]), atol=1e-8)
    np.testing.assert_allclose(made.asked.mean(0), CENTRE, atol=0.03)
    np.testing.assert_allclose(np.cov(made.asked.T), COVARIANCE, atol=0.05)
    assert (found.method, found.paths, found.warnings) == ("laplace", ("energy.a", "energy.b"), ())
    assert found.checks == {"khat": 0.2, "ess_share": pytest.approx(1.0)}
    assert found.draws.shape == (1, 20000, 2)
    assert {tuple(x) for x in found.flat} <= {tuple(x) for x in made.asked + 10}
    np.testing.assert_allclose(found.flat.mean(0), CENTRE + 10, atol=0.04)
    np.testing.assert_allclose(np.cov(found.flat.T), COVARIANCE, atol=0.06)


@BAYES
def test_two_thousand_draws_are_taken_from_seed_nought_and_a_normal_law_gives_no_warning():
    found = laplace(bell(), CENTRE + 10)
    assert found.draws.shape == (1, 2000, 2)
    assert found.checks["ess_share"] == pytest.approx(1.0, abs=1e-9)
    assert found.warnings == ()
    np.testing.assert_array_equal(found.draws, laplace(bell(), CENTRE + 10, 2000, 0).draws)
    assert not np.array_equal(found.draws, laplace(bell(), CENTRE + 10, 2000, 1).draws)


@pytest.mark.parametrize("shift", [-800.0, 0.0, 800.0])
def test_draws_are_kept_by_their_weights(monkeypatch, shift):
    """A quarter weigh 3, a quarter 1, the others nothing: (4 / 4)^2 / (10 / 4) of them count."""
    made, n = bell(), 20000
    weights = np.tile([3.0, 0.0, 1.0, 0.0], n // 4)
    with np.errstate(divide="ignore"):
        smoothed(monkeypatch, np.log(weights) + shift)
    found = laplace(made, CENTRE + 10, n)
    assert found.checks["ess_share"] == pytest.approx(1 / 2.5)
    place = {tuple(x): i for i, x in enumerate(made.asked + 10)}
    kept = np.bincount([place[tuple(x)] % 4 for x in found.flat], minlength=4) / n
    assert kept[[1, 3]].tolist() == [0.0, 0.0]
    assert kept[0] == pytest.approx(0.75, abs=0.01)
    repeats = np.unique([place[tuple(x)] for x in found.flat], return_counts=True)[1]
    assert repeats.max() > 5  # with replacement: three on average


TAIL = "Pareto k-hat is {}, above 0.7: the posterior is far from normal; use NUTS"
FEW = "only {} of {} draws count: intervals are coarse; use NUTS, or more --draws"


@pytest.mark.parametrize(("khat", "count", "of", "said"), [
    (0.7, 1899, 2000, (TAIL.format("0.70"),)),
    (0.7, 1900, 2000, ()),  # 95 % count: nearly alike
    (math.nextafter(0.7, 0), 1899, 2000, ()),
    (math.nan, 1000, 2000, (TAIL.format("nan"),)),
    (1.234, 100, 200, (TAIL.format("1.23"),)),
    (0.1, 100, 200, ()),
    (0.1, 99, 200, (FEW.format(99, 200),)),
    (0.1, 60, 60, (FEW.format(60, 60),)),
    (0.9, 60, 200, (TAIL.format("0.90"), FEW.format(60, 200))),
])  # fmt: skip
def test_a_heavy_tail_and_few_draws_are_said(monkeypatch, khat, count, of, said):
    smoothed(monkeypatch, alike(count, of), khat)
    found = laplace(bell(), CENTRE + 10, of)
    assert found.warnings == said
    assert found.checks["ess_share"] == pytest.approx(count / of)


def chained(monkeypatch, y, divergent, rhat, ess):
    """Chains that are given, and an arviz that finds these in them; what both were asked for."""
    asked = {}

    def drawn(target, x, data, *numbers):
        asked.update(x=x, data=data, numbers=numbers)
        return np.asarray(y), divergent

    def dataset(named):
        asked["named"] = named
        return "set"

    def found(values):
        return lambda data: SimpleNamespace(data_vars=dict(zip("ab", map(np.array, values))) if data == "set" else {})

    az = SimpleNamespace(convert_to_dataset=dataset, rhat=found(rhat), ess=found(ess))
    monkeypatch.setattr(posterior, "nuts_draws", drawn)
    monkeypatch.setattr(posterior, "_arviz", lambda: az)
    return asked


APART = "R-hat is {}, above 1.01: the chains do not agree; draw more"


@pytest.mark.parametrize(("rhat", "divergent", "said"), [
    ((1.0, 1.004), 0, ()),
    ((math.nextafter(1.01, 0), 1.0), 0, ()),
    ((1.01, 1.0), 0, (APART.format("1.010"),)),
    ((1.0, 1.2345), 0, (APART.format("1.234"),)),
    ((1.0, math.inf), 0, (APART.format("inf"),)),
    ((1.0, 1.0), 1, ("1 divergent transitions: some corner of the posterior was not explored",)),
    ((1.5, 1.0), 3, (APART.format("1.500"), "3 divergent transitions: some corner of the posterior was not explored")),
])  # fmt: skip
def test_chains_are_told_by_the_worst_of_their_parameters(monkeypatch, rhat, divergent, said):
    y = np.arange(12.0).reshape(2, 3, 2)
    asked = chained(monkeypatch, y, divergent, rhat, (350.0, 200.0))
    found = nuts(bell(), CENTRE, 3, 2, 7, 5)
    assert (asked["x"] is CENTRE, asked["data"] is Bell.data, asked["numbers"]) == (True, True, (3, 2, 7, 5))
    np.testing.assert_array_equal(found.draws, y + 10)
    assert list(asked["named"]) == ["energy.a", "energy.b"]
    for i, given in enumerate(asked["named"].values()):
        np.testing.assert_array_equal(given, y[:, :, i] + 10)
    assert found.checks == {"rhat": max(rhat), "ess": 200.0, "divergences": float(divergent)}
    assert (found.method, found.paths, found.warnings) == ("nuts", ("energy.a", "energy.b"), said)


def test_one_chain_agrees_with_none_and_four_are_drawn_unless_told(monkeypatch):
    asked = chained(monkeypatch, np.zeros((1, 3, 2)), 0, (7.0, 7.0), (3.0, 4.0))
    alone = nuts(bell(), CENTRE, chains=1)
    assert math.isnan(alone.checks["rhat"])
    assert (alone.checks["ess"], alone.warnings) == (3.0, ())
    assert asked["numbers"] == (500, 1, 300, 0)
    nuts(bell(), CENTRE)
    assert asked["numbers"] == (500, 4, 300, 0)


def test_whitened_draws_are_turned_by_the_root_of_the_covariance(monkeypatch):
    """Of draws of unit vectors the outer products about the centre sum to the covariance."""
    asked = []

    def run(centre, root, data, key):
        asked.append((np.asarray(centre), np.asarray(root), np.asarray(data), jax.random.key_data(key).tolist()))
        return jnp.stack([jnp.eye(2), 2 * jnp.eye(2), jnp.zeros((2, 2))]), jnp.array([[True, False], [True, True]])

    y, divergent = nuts_draws(bell(), CENTRE + 10, Bell.data + 1, 2, 3, 9, 77, run)
    assert (y.shape, divergent) == ((3, 2, 2), 3)
    for k, (chain, times) in enumerate(zip(y, (1, 4, 0), strict=True)):
        out = chain - CENTRE
        np.testing.assert_allclose(out.T @ out, times * COVARIANCE, atol=1e-10, err_msg=str(k))
    centre, root, data, key = asked[0]
    np.testing.assert_array_equal(centre, CENTRE)
    np.testing.assert_allclose(root @ root.T, COVARIANCE, atol=1e-10)
    assert (data.tolist(), key) == ([5.0, 6.0], jax.random.key_data(jax.random.key(77)).tolist())
    made = []
    monkeypatch.setattr(posterior, "nuts_runner", lambda *given: made.append(given[1:]) or run)
    again, _ = nuts_draws(bell(), CENTRE + 10, Bell.data, 2, 3, 9, 77)
    assert made == [(2, 3, 9)]
    np.testing.assert_array_equal(again, y)


class State(NamedTuple):
    position: jax.Array


def test_chains_start_three_tenths_of_a_standard_deviation_off_and_walk_in_whitened_coordinates(monkeypatch):
    """The sampler here adds a fifth of the inverse masses and calls a point divergent where the density is low."""
    told = {}

    def adaptation(algorithm, density, is_mass_matrix_diagonal):
        told.update(algorithm=algorithm, diagonal=is_mass_matrix_diagonal)

        def run(key, start, num_steps):
            told["warmup"] = num_steps
            return (State(start), {"step_size": 0.2, "inverse_mass_matrix": jnp.array([1.0, 3.0])}), None

        return SimpleNamespace(run=run)

    def sampler(density, step_size, inverse_mass_matrix):
        def step(key, state):
            onward = step_size * inverse_mass_matrix + 1e-3 * jax.random.uniform(key, (2,))
            new = State(state.position + onward)
            return new, SimpleNamespace(is_divergent=density(new.position) < 0.0)

        return SimpleNamespace(step=step)

    fake = SimpleNamespace(window_adaptation=adaptation, nuts=sampler)
    monkeypatch.setitem(sys.modules, "blackjax", fake)
    made, chains = bell(), 2000
    root = np.linalg.cholesky(COVARIANCE)
    z, divergent = nuts_runner(made, 3, chains, 11)(CENTRE + 1, root, made.data, jax.random.key(1))
    z = np.asarray(z)
    assert z.shape == (chains, 3, 2)
    assert (told["algorithm"] is sampler, told["diagonal"], told["warmup"]) == (True, True, 11)
    onward = np.diff(z, axis=1)
    assert ((onward >= [0.2, 0.6]) & (onward <= [0.201, 0.601])).all()
    assert len(np.unique(onward)) > 0.99 * onward.size  # every step of every chain with luck of its own
    start = z[:, 0] - [0.2005, 0.6005]
    np.testing.assert_allclose(start.mean(0), 0.0, atol=0.02)
    np.testing.assert_allclose(np.cov(start.T), 0.09 * np.eye(2), atol=0.01)
    off = 1 + z @ root.T
    density = -0.5 * np.einsum("cki,ij,ckj->ck", off, PRECISION, off) + made.data[1]
    np.testing.assert_array_equal(np.asarray(divergent), density < 0.0)
    assert 0 < np.mean(divergent) < 1


def test_a_covariance_is_made_symmetric_and_lifted_by_a_trillionth_of_its_mean_variance():
    told = _positive(np.array([[4.0, 1.0, 0.0], [3.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    np.testing.assert_array_equal(told - np.diag(np.diag(told)), [[0, 2, 0], [2, 0, 0], [0, 0, 0]])
    lifted = _positive(np.diag([0.0, 0.0, 0.0, 2.0]))
    np.testing.assert_allclose(1e12 * np.diag(lifted)[:3], 0.5, rtol=1e-12)
    v = np.array([1.0, 2.0, 3.0])
    np.linalg.cholesky(_positive(np.outer(v, v)))

"""Tempered sampling against integrals that are known: flat and normal likelihoods, and the ladder that they ask for."""

import math
import statistics
import warnings
from dataclasses import FrozenInstanceError
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import kstest, norm, truncnorm, uniform

from tissuejax.errors import InputError
from tissuejax.fitting.evidence import _draw, _next, _run, _systematic, evidence, refuse_improper

INF = math.inf
SIGMA = np.array([0.5, 2.0, 3.0])
CONSTANT = -math.log(3.0) - 1.5 * math.log(2 * math.pi)  # of three normal densities


def problem(bounds, priors=None) -> Any:
    """Parameters a, b, ... with these bounds."""
    names = tuple("abcdefghijkl"[: len(bounds)])
    return SimpleNamespace(free=names, bound=dict(zip(names, bounds)).get, priors=priors or {})


def target(of, likelihood) -> Any:
    """What evidence asks of a target: the priors stand in its likelihood, as the density of a fit has them."""

    def with_priors(x, data):
        assert data == "data"
        columns = {path: x[:, of.free.index(path)] for path in of.priors}
        return likelihood(x) - sum(0.5 * ((columns[p] - m) / s) ** 2 for p, (m, s) in of.priors.items())

    return SimpleNamespace(problem=of, _sigma=SIGMA, data="data", likelihoods=with_priors)


class Script:
    """Random numbers that are written down: `at` the particles, then the steps and the thresholds of their taking."""

    def __init__(self, at, steps, thresholds):
        self.columns, self.steps, self.thresholds = list(np.transpose(at)), iter(steps), iter(thresholds)

    def uniform(self, *ends, size=None):
        if size is not None:
            return np.broadcast_to(next(self.thresholds), size)
        return self.columns.pop(0) if ends else 0.5  # particles stay as they are where all weigh the same

    def normal(self, size):
        return np.broadcast_to(next(self.steps), size)


def scripted(of, at, steps, thresholds, likelihood):
    """Log evidence, and the points at which the likelihood was asked for, the particles themselves first."""
    asked = []

    def recorded(x):
        asked.append(np.array(x))
        return likelihood(x)

    lower, upper = np.transpose([of.bound(p) for p in of.free])
    found = _run(Script(at, steps, thresholds), of, lower, upper, recorded, lambda x: np.zeros(len(x)), len(at))
    return found, asked


@pytest.mark.parametrize("ends", [(-INF, INF), (0.0, INF), (-INF, 3.0)])
def test_a_flat_prior_without_an_end_is_refused_by_name(ends):
    of = problem([(0.0, 1.0), ends, ends, (0.0, INF)], {"c": (1.0, 2.0)})
    with pytest.raises(InputError, match="give b, d a --prior, or both --bounds"):
        refuse_improper(of)
    with pytest.raises(InputError, match="evidence needs proper priors"):
        evidence(target(of, lambda x: np.zeros(len(x))))
    refuse_improper(problem([(0.0, 1.0), ends], {"b": (1.0, 2.0)}))


def test_ten_parameters_have_an_evidence_and_eleven_have_none():
    refuse_improper(problem([(0.0, 1.0)] * 10))
    with pytest.raises(InputError, match="11 free parameters; evidence is computed for at most 10"):
        refuse_improper(problem([(0.0, 1.0)] * 11))


@pytest.mark.parametrize("level", [-900.0, 0.0, 3.25, 900.0])
@pytest.mark.parametrize("priors", [{}, {"b": (0.3, 0.8)}, {"a": (-1.0, 2.0), "b": (0.3, 0.8)}])
def test_a_flat_likelihood_is_its_own_evidence_and_leaves_the_prior(level, priors):
    """All particles weigh the same, in one step and without scatter; normal priors are cut at the bounds."""
    of = problem([(-2.0, 3.0), (0.0, 1.0)], priors)
    told = evidence(target(of, lambda x: np.full(len(x), level)), 4000, 3, 5)
    assert told.log_evidence == pytest.approx(level + CONSTANT, abs=1e-9)
    assert told.std == pytest.approx(0.0, abs=1e-9)
    assert told.rungs == 1
    assert told.draws.shape == (3, 4000, 2)
    with pytest.raises(FrozenInstanceError):
        told.std = 1.0  # pyright: ignore[reportAttributeAccessIssue]
    for i, path in enumerate(of.free):
        a, b = of.bound(path)
        mean, std = priors.get(path, (0.0, 1.0))
        law = truncnorm((a - mean) / std, (b - mean) / std, mean, std) if path in priors else uniform(a, b - a)
        anew = _draw(np.random.default_rng(i), of, np.array([-2.0, 0.0]), np.array([3.0, 1.0]), 4000)
        for draws in (told.draws[0, :, i], anew[:, i]):
            assert kstest(draws, law.cdf).pvalue > 0.01


def test_bounds_belong_to_what_a_normal_prior_may_draw():
    """Values on either bound are kept, one beyond is drawn again until it lies inside."""
    drawn = iter([[1.0, 2.0, 0.9, 2.1, 1.5], [2.5, 1.7], [1.2]])
    rng = SimpleNamespace(normal=lambda mean, std, n: np.array(next(drawn))[: int(n)] * (mean == 1.4) * (std == 3.0))
    x = _draw(rng, problem([(1.0, 2.0)], {"a": (1.4, 3.0)}), np.array([1.0]), np.array([2.0]), 5)
    assert x[:, 0].tolist() == [1.0, 2.0, 1.2, 1.7, 1.5]


def test_evidence_is_the_mean_of_runs_and_its_spread_is_theirs():
    """Runs are seeded one after the other; four of 500 particles from seed 0 unless told."""
    of = problem([(-4.0, 9.0)])
    made = target(of, lambda x: -0.5 * x[:, 0] ** 2)
    with warnings.catch_warnings(action="error"):  # one run has no spread
        alone = [evidence(made, 100, 1, 3 + k) for k in range(3)]
    together = evidence(made, 100, 3, 3)
    values = [a.log_evidence for a in alone]
    assert len(set(values)) == 3
    assert together.log_evidence == pytest.approx(statistics.mean(values), rel=1e-12)
    assert together.std == pytest.approx(statistics.stdev(values), rel=1e-9)
    np.testing.assert_array_equal(together.draws, np.concatenate([a.draws for a in alone]))
    assert all(math.isnan(a.std) for a in alone)
    assert evidence(made, 100, 2, 3).std == pytest.approx(abs(values[0] - values[1]) / math.sqrt(2))
    usual = evidence(made)
    assert usual.draws.shape == (4, 500, 1)
    np.testing.assert_array_equal(usual.draws, evidence(made, 500, 4, 0).draws)


def test_rungs_are_those_of_the_first_run():
    """The first run has all particles alike, the second a rare one that stands out."""
    calls = []

    def likelihood(x):
        calls.append(len(x))
        return np.zeros(len(x)) if len(calls) <= 13 else -0.5 * (50 * x[:, 0]) ** 2

    told = evidence(target(problem([(-1.0, 1.0)]), likelihood), 200, 2)
    assert told.rungs == 1
    assert len(calls) > 2 * 13


def test_a_normal_likelihood_far_narrower_than_its_prior_takes_the_rungs_that_algebra_asks_for():
    """Of L wide flat prior half the particles stay effective to p = 16 pi s^2 / L^2, then by 4 + 2 sqrt(3) a rung:
    0.00126, 0.0094, 0.070, 0.52, 1. ln Z = ln(s sqrt(2 pi) / L)."""
    of = problem([(-90.0, 110.0)])
    told = evidence(target(of, lambda x: -0.5 * x[:, 0] ** 2), 20000, 2, 1)
    assert told.rungs == 5
    assert told.log_evidence - CONSTANT == pytest.approx(math.log(math.sqrt(2 * math.pi) / 200), abs=0.03)
    assert told.std < 0.05
    for run in told.draws[..., 0]:
        assert run.mean() == pytest.approx(0.0, abs=0.03)
        assert run.std() == pytest.approx(1.0, rel=0.02)
        assert len(np.unique(run)) > 0.99 * len(run)


def test_the_posterior_of_normal_prior_and_likelihood_is_their_product():
    """Precisions add; ln Z by the determinant, the flat parameter's prior 1 / 40 and the other's without its constant,
    which is divided out by drawing from it."""
    precision = np.array([[2.0, -1.2], [-1.2, 1.5]])
    at, mean, std = np.array([1.0, -2.0]), 0.5, 0.7
    of = problem([(-20.0, 20.0), (-INF, INF)], {"b": (mean, std)})
    bell = target(of, lambda x: -0.5 * np.einsum("ni,ij,nj->n", x - at, precision, x - at))
    told = evidence(bell, particles=20000, runs=1, seed=4)
    whole = precision + np.diag([0.0, std**-2])
    centre = np.linalg.solve(whole, precision @ at + [0.0, mean / std**2])
    least = 0.5 * (at @ precision @ at + (mean / std) ** 2 - centre @ whole @ centre)
    log_z = -least + math.log(math.sqrt(2 * math.pi) / (40 * std * math.sqrt(np.linalg.det(whole))))
    assert told.log_evidence - CONSTANT == pytest.approx(log_z, abs=0.03)
    draws = told.draws[0]
    spread = np.linalg.inv(whole)
    np.testing.assert_allclose(draws.mean(0), centre, atol=0.03)
    np.testing.assert_allclose(np.cov(draws.T), spread, atol=0.03)
    for i in (0, 1):
        assert kstest(draws[::10, i], norm(centre[i], math.sqrt(spread[i, i])).cdf).pvalue > 0.01


def test_a_posterior_that_leans_on_its_bound_never_leaves_it():
    """Half of a normal law: the likelihood is asked for nowhere else."""
    seen = []

    def likelihood(x):
        seen.append((x.min(), x.max()))
        return -0.5 * x[:, 0] ** 2

    draws = evidence(target(problem([(0.0, 30.0)]), likelihood), 20000, 1).draws.ravel()
    assert min(low for low, _ in seen) >= 0.0
    assert max(high for _, high in seen) <= 30.0
    assert draws.mean() == pytest.approx(math.sqrt(2 / math.pi), abs=0.02)
    assert kstest(draws[::10], lambda x: 2 * norm.cdf(x) - 1).pvalue > 0.01


PLACES = np.array([[1.0, 2.0], [1.5, 4.0], [3.0, 3.0]])
AXES = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])  # two particles step, the third stays


def test_steps_have_the_covariance_of_the_particles_times_the_square_of_2p38_over_the_dimension():
    """Roberts, Gelman and Gilks 1997; a step of each unit vector makes the covariance from its outer products. The
    size then goes by how many were taken: e^(0.5 (share - 0.3)) a step, and there are twelve."""
    of = problem([(-50.0, 50.0)] * 2)
    takes = np.array([[1, 1, 1], [0, 0, 0], [1, 0, 1], [0, 1, 0], [1, 1, 1]] + [[0, 0, 0]] * 7)
    thresholds = np.where(takes, 0.5, 1.5)
    (log_z, rungs, x), asked = scripted(of, PLACES, [AXES] * 12, thresholds, lambda x: np.full(len(x), 2.0))
    assert (log_z, rungs, len(asked)) == (pytest.approx(2.0, abs=1e-12), 1, 2 + 12)
    here, scale = PLACES, 2.38 / math.sqrt(2)
    np.testing.assert_array_equal(asked[0], here)
    np.testing.assert_array_equal(asked[1], here)
    for take, there in zip(takes, asked[2:], strict=True):
        step = there - here
        np.testing.assert_allclose(step.T @ step, scale**2 * np.cov(PLACES.T), rtol=1e-9)
        here = np.where(take[:, None], there, here)
        scale *= math.exp(0.5 * (take.mean() - 0.3))
    np.testing.assert_array_equal(x, here)


def test_a_step_onto_a_bound_is_taken_and_one_beyond_is_not_even_tried():
    """Particles on either bound, and one that steps outside: the share taken shows in the next step's size."""
    of = problem([(1.0, 3.0), (2.0, 4.0)])
    still, out = np.zeros((3, 2)), np.array([[0.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
    _, asked = scripted(of, PLACES, [still, out, still] + [out] * 9, [0.5] * 12, lambda x: np.zeros(len(x)))
    for there in asked:
        np.testing.assert_array_equal(there, PLACES)  # the second stands at the end of b: it stays
    shares = []
    of = problem([(1.0, 3.0), (2.0, 40.0)])
    for first in (still, out):  # all taken, or all but the one that would step outside of the first bounds
        of.bound = {"a": (1.0, 3.0), "b": (2.0, 4.0 if first is out else 40.0)}.get
        inward = np.array([[0.0, 0.0], [0.0, -0.1], [0.0, 0.0]])
        _, asked = scripted(of, PLACES, [first, inward] + [still] * 10, [0.5] * 12, lambda x: np.zeros(len(x)))
        shares.append(4.0 - asked[3][1, 1])
    assert shares[1] / shares[0] == pytest.approx(math.exp(0.5 * (2 / 3 - 1)))


@pytest.mark.parametrize("rise", [-0.5, -1.0])
def test_a_step_to_less_is_taken_where_the_threshold_lies_below_its_ratio(rise):
    """The likelihood is less by `rise` wherever the second and third stand: e^rise is the chance of going there."""
    of = problem([(-50.0, 50.0)] * 2)

    def likelihood(x):
        return np.where((x == PLACES).all(1), 0.0, rise)

    for share, taken in ((0.99, True), (1.01, False)):
        (_, rungs, x), _ = scripted(of, PLACES, [AXES] * 12, [share * math.exp(rise)] + [9.0] * 11, likelihood)
        assert rungs == 1
        assert (x[:2] != PLACES[:2]).any() == taken


def test_particles_that_are_one_or_lie_on_a_line_still_have_a_root_of_their_covariance():
    """All at zero: what is added is 1e-18 of 1e-30. On a line: 1e-12 of the variances, so a step across is small."""
    of = problem([(-50.0, 50.0)] * 2)
    zeros = np.zeros((3, 2))
    _, asked = scripted(of, zeros, [AXES] * 12, [9.0] * 12, lambda x: np.zeros(len(x)))
    np.testing.assert_allclose(asked[2], 2.38 / math.sqrt(2) * 1e-24 * AXES, rtol=1e-9)
    line = np.array([[1.0, 2.0], [2.0, 4.0], [4.0, 8.0]])
    _, asked = scripted(of, line, [AXES] * 12, [9.0] * 12, lambda x: np.zeros(len(x)))
    along, across = (asked[2] - line)[:2]
    assert along[1] / along[0] == pytest.approx(2.0, rel=1e-9)
    assert 0 < across[1] < 3e-6 * along[1]


@pytest.mark.parametrize("shift", [0.0, 1e4, -1e4])
def test_the_first_and_the_next_power_of_a_normal_likelihood(shift):
    """On quantiles in place of draws. From a flat prior p = 4 t^2 / L^2 with sqrt(pi) erf(t / sqrt(2))^2 = t erf(t) / 2
    (near 16 pi / L^2), from a power on 4 + 2 sqrt(3) times it."""
    share = (np.arange(200000) + 0.5) / 200000
    flat = 300 * (share - 0.5)
    t: Any = brentq(lambda t: math.sqrt(math.pi) * math.erf(t / math.sqrt(2)) ** 2 - 0.5 * t * math.erf(t), 1, 9)
    assert _next(shift - 0.5 * flat**2, 0.0) == pytest.approx(4 * t**2 / 300**2, rel=1e-6)
    for power in (0.01, 0.1):
        x = norm.ppf(share) / math.sqrt(power)
        assert _next(shift - 0.5 * x**2, power) == pytest.approx((4 + 2 * math.sqrt(3)) * power, rel=1e-4)
    assert _next(shift - 0.5 * (norm.ppf(share) / math.sqrt(0.14)) ** 2, 0.14) == 1.0


def test_half_of_the_particles_is_enough_and_where_one_of_three_counts_the_power_still_rises():
    assert _next(np.array([0.0, -1e9]), 0.3) == 1.0  # one of two
    assert _next(np.array([0.0, 0.0, -1e9]), 0.3) == 1.0
    step = _next(np.array([0.0, -1e40, -1e40]), 0.25) - 0.25  # one of three: the last of fifty halvings is taken
    assert 2**50 * step == pytest.approx(0.75, rel=0.1)


@pytest.mark.parametrize("u", [0.05, 0.5, 0.95])
def test_particles_are_drawn_at_even_places_of_the_summed_weights(u):
    weights = np.array([0.37, 0.0, 0.03, 0.2, 0.4])
    edges = np.concatenate([[0.0], np.cumsum(weights)])
    drawn = _systematic(SimpleNamespace(uniform=lambda: u), weights)
    for k, place in zip(drawn, [(u + i) / 5 for i in range(5)], strict=True):
        assert edges[k] < place < edges[k + 1]

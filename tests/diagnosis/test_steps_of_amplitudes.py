"""The climb to the likeliest amplitudes: on made-up log evidence whose steps are known, and against scipy's optimum."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import halfnorm

from tissuejax.diagnosis.judgement import marginal as module
from tissuejax.diagnosis.judgement.marginal import Blocked, Linear, Widths, amplitudes, marginal
from tissuejax.estimation.discrepancy import Part

PLAIN = Widths(np.ones(1), np.zeros(1))  # log p(a) goes down by half of a squared amplitude


class Landscape:
    """Log evidence that is made up: `worth` of the squared amplitudes, prior and all, with these slopes."""

    def __init__(self, monkeypatch, worth, slope, fisher, widths: Widths = PLAIN):
        self.at, self.slopes, self.widths = [], 0, widths

        def evidence(linear, parts, v, blocked):
            u = np.array(v) / widths.width**2
            self.at.append(u.tolist())
            own = np.asarray(fisher(u)) / np.outer(widths.width**2, widths.width**2)
            return Given(self, worth(u) - float(np.sum(widths.log_shape(u))), u, slope(u), own)

        monkeypatch.setattr(module, "marginal", evidence)

    def climb(self, start: list[float], **how) -> tuple[np.ndarray, Any]:
        climb: Any = amplitudes
        v, m = climb(None, (), self.widths, None, np.array(start), **how)
        return v, m


class Given:
    """Its density at one place."""

    def __init__(self, owner: Landscape, value: float, u: np.ndarray, slope, fisher: np.ndarray):
        self.owner, self.value, self.u, self.fisher = owner, value, u, fisher
        self._slope = (np.asarray(slope) - owner.widths.slope(u)) / owner.widths.width**2

    @property
    def slope(self) -> np.ndarray:
        self.owner.slopes += 1
        return self._slope


def endless(monkeypatch, gain: float = 1.0, promised: float = 1.0) -> Landscape:
    """Steps of one that gain alike for ever."""
    return Landscape(monkeypatch, lambda u: gain * u[0], lambda u: [promised], lambda u: [[promised]])


@pytest.mark.parametrize(("how", "steps"), [({}, 15), ({"most": 3}, 3), ({"most": 1}, 1), ({"most": 0}, 0)])
def test_so_many_steps_are_made_at_most(monkeypatch, how, steps):
    made = endless(monkeypatch)
    v, _ = made.climb([2.0], **how)
    assert v[0] == pytest.approx(2.0 + steps)
    assert np.ravel(made.at) == pytest.approx(2.0 + np.arange(steps + 1))


@pytest.mark.parametrize(("how", "least"), [({}, 0.02), ({"tolerance": 0.3}, 0.3)])
def test_a_step_that_promises_less_is_not_made(monkeypatch, how, least):
    less = endless(monkeypatch, promised=0.99 * least)
    v, m = less.climb([2.0], **how)
    assert (v.tolist(), m.u.tolist(), len(less.at), less.slopes) == ([2.0], [2.0], 1, 1)
    more = endless(monkeypatch, promised=1.01 * least)
    assert more.climb([2.0], **how)[0][0] == pytest.approx(17.0)


@pytest.mark.parametrize(("how", "least"), [({}, 0.02), ({"tolerance": 0.3}, 0.3)])
def test_a_step_that_gained_less_is_the_last(monkeypatch, how, least):
    less = endless(monkeypatch, gain=0.99 * least)
    v, m = less.climb([2.0], **how)
    assert v[0] == m.u[0] == pytest.approx(3.0)
    assert (len(less.at), less.slopes) == (2, 1)
    more = endless(monkeypatch, gain=1.01 * least)
    assert more.climb([2.0], **how)[0][0] == pytest.approx(17.0)


@pytest.mark.parametrize("quarters", range(7))
def test_a_step_is_quartered_till_it_gains_and_five_times_at_most(monkeypatch, quarters):
    """From 2 a step of 1 is promised, and everything loses but what is within reach."""
    reach = 1.01 * 4.0**-quarters
    made = Landscape(
        monkeypatch, lambda u: -1.0 if u[0] > 2 + reach else 0.5 * (u[0] - 2), lambda u: [0.5], lambda u: [[0.5]]
    )
    v, m = made.climb([2.0], most=1)
    tried = 2 + 4.0 ** -np.arange(min(quarters, 5) + 1.0)
    assert np.ravel(made.at) == pytest.approx([2.0, *tried])
    assert v[0] == m.u[0] == pytest.approx(tried[-1] if quarters < 6 else 2.0)


def test_where_no_part_of_a_step_gains_the_climb_ends(monkeypatch):
    made = Landscape(monkeypatch, lambda u: -u[0], lambda u: [1.0], lambda u: [[1.0]])
    v, m = made.climb([2.0])
    assert (v.tolist(), m.u.tolist(), len(made.at), made.slopes) == ([2.0], [2.0], 7, 1)


def test_a_step_that_gains_nothing_is_shortened(monkeypatch):
    """From 2 to 3 the worth is the same, and in between it is more."""
    made = Landscape(monkeypatch, lambda u: float(2 + 1e-9 < u[0] < 3 - 1e-9), lambda u: [1.0], lambda u: [[1.0]])
    v, _ = made.climb([2.0], most=1)
    assert v[0] == pytest.approx(2.25)


@pytest.mark.parametrize(
    ("start", "begun"), [([-3.0, 5.0], [0.0, 5.0]), ([1e9, 1e9], [1e4, 1600.0]), ([9999.0, 1599.0], [9999.0, 1599.0])]
)
def test_a_climb_begins_within_ten_times_the_wide_width(monkeypatch, start, begun):
    widths = Widths(np.array([0.5, 3.0]), np.zeros(2), np.array([10.0, 4.0]))
    made = Landscape(monkeypatch, lambda u: 0.0, lambda u: [0.0, 0.0], lambda u: np.eye(2), widths)
    v, _ = made.climb(list(np.array(start) * widths.width**2))
    np.testing.assert_allclose(v, np.array(begun) * widths.width**2)
    assert made.at == [pytest.approx(begun)]


def quadratic(u: np.ndarray, g: np.ndarray, f: np.ndarray) -> np.ndarray:
    """The step s >= -u that makes the most of g s - s'fs / 2, by trying what may rest on the bound."""
    ends = []
    for held in itertools.product([False, True], repeat=len(u)):
        h = np.array(held)
        s = np.where(h, -u, 0.0)
        if not h.all():
            s[~h] = np.linalg.solve(f[np.ix_(~h, ~h)], (g - f @ s)[~h])
        if np.all(s >= -u - 1e-12):
            ends.append((g @ s - 0.5 * s @ f @ s, s))
    return max(ends, key=lambda e: e[0])[1]


@pytest.mark.parametrize("seed", range(12))
def test_a_step_is_the_best_of_the_quadratic_inside_the_bound(monkeypatch, seed):
    """Three amplitudes of different widths; some steps end on nothing, some begin there."""
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((3, 3))
    size = np.diag(10.0 ** rng.uniform(-2, 2, 3))
    f, u = size @ (a @ a.T + 0.5 * np.eye(3)) @ size, rng.uniform(0, 0.4, 3) / np.diag(size) * [1, 1, seed % 2]
    g = size @ rng.normal(0, 1.5, 3)
    widths = Widths(np.array([0.1, 3.0, 1.0]), np.array([0.0, 0.1, 0.2]))
    corner = quadratic(u, g, f)

    def worth(x: np.ndarray) -> float:
        return float(g @ (x - u) - 0.5 * (x - u) @ f @ (x - u))

    made = Landscape(monkeypatch, worth, lambda x: g - f @ (x - u), lambda x: f, widths)
    v, _ = made.climb(list(u * widths.width**2), most=1, tolerance=1e-9)
    np.testing.assert_allclose(v / widths.width**2, u + corner, rtol=1e-8, atol=1e-9 * np.max(u))
    assert np.all(v >= 0)


def test_parts_that_are_one_move_alike_and_no_further_than_a_fiftieth_of_their_correlation_allows(monkeypatch):
    """Correlated by one they say nothing of their difference: it is taken to say 0.02 of what one of them says."""
    g, f = np.array([1.0, 0.9]), np.array([[1.0, 1.0], [1.0, 1.0]])
    made = Landscape(monkeypatch, lambda u: float(np.sum(u)), lambda u: g, lambda u: f, Widths(np.ones(2), np.zeros(2)))
    v, _ = made.climb([50.0, 50.0], most=1)
    both, apart = (g[0] + g[1]) / 2, (g[0] - g[1]) / 0.02
    np.testing.assert_allclose(v - 50.0, [(both + apart) / 2, (both - apart) / 2], rtol=1e-9)


def test_a_part_of_which_nothing_is_known_stays(monkeypatch):
    f = np.diag([0.0, 4.0])
    made = Landscape(
        monkeypatch, lambda u: float(u[1]), lambda u: [0.0, 2.0], lambda u: f, Widths(np.ones(2), np.zeros(2))
    )
    v, _ = made.climb([3.0, 1.0], most=1)
    np.testing.assert_allclose(v, [3.0, 1.5], rtol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_the_likeliest_amplitudes_are_those_that_scipy_finds(seed):
    """Of noise and two smooth parts, one of which acts in every other sample."""
    rng = np.random.default_rng(seed)
    n, sigma = 60, 0.2
    parts: Any = [Part(name, "law", rng.standard_normal((n, 6))) for name in ("one", "two")]
    residual = parts[0].factor @ rng.normal(0, 0.5, 6) * (seed % 2) + sigma * rng.standard_normal(n)
    linear = Linear(residual, np.ones((n, 1)), np.zeros(1), np.zeros(1))
    widths, blocked = Widths(np.array([0.3, 0.1]), np.array([0.1, 0.0])), Blocked((slice(0, n),), np.full(n, sigma))
    v, m = amplitudes(linear, parts, widths, blocked, widths.width**2, most=50, tolerance=1e-10)

    def loss(a: np.ndarray) -> float:
        wide = 0.1 * halfnorm.pdf(a[0], scale=3.0)
        priors = np.log(0.9 * halfnorm.pdf(a[0], scale=0.3) + wide) + halfnorm.logpdf(a[1], scale=0.1)
        return -marginal(linear, parts, a**2, blocked).value - float(priors)

    ends = [
        minimize(loss, x, method="L-BFGS-B", bounds=[(0, None)] * 2) for x in ([0.5, 0.1], [0.5, 1e-3], [0.01, 0.01])
    ]
    ends.append(minimize(loss, np.sqrt(v) + 1e-3, method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-9}))
    best = min(e.fun for e in ends)
    assert loss(np.sqrt(v)) == pytest.approx(best, abs=1e-5)
    assert m.value == pytest.approx(marginal(linear, parts, v, blocked).value, abs=1e-12)


@pytest.mark.parametrize("factor", [4.0, np.array([4.0, 25.0, 7.0])], ids=["of all", "by part"])
def test_a_prior_of_amplitudes_is_two_half_normals_of_its_own_factor(factor):
    widths = Widths(np.array([0.5, 0.02, 3.0]), np.array([0.2, 0.05, 0.0]), factor)
    a = np.array([[0.1, 0.01, 2.0], [1.7, 0.3, 11.0]])
    usual, wide = halfnorm.pdf(a, scale=widths.width), halfnorm.pdf(a, scale=factor * widths.width)
    whole = (1 - widths.chance) * usual + widths.chance * wide
    np.testing.assert_allclose(widths.log_density(a**2), np.log(whole), rtol=1e-12)
    share = widths.chance * wide / whole
    slopes = -0.5 * ((1 - share) + share / np.asarray(factor) ** 2)
    np.testing.assert_allclose([widths.slope(u) for u in (a / widths.width) ** 2], slopes, rtol=1e-12)
    nothing = np.log((1 - widths.chance) + widths.chance / factor)
    np.testing.assert_allclose(widths.log_shape(np.zeros(3)), nothing, rtol=1e-12, atol=1e-15)
    own = [widths.part(k).log_density(a[:, [k]] ** 2)[:, 0] for k in range(3)]
    np.testing.assert_allclose(np.transpose(own), np.log(whole), rtol=1e-12)
    chances = [widths.wider(x) for x in a**2]
    np.testing.assert_array_equal(chances, widths.chance * wide > (1 - widths.chance) * usual)


def test_ten_times_as_wide_where_nothing_else_is_said():
    usual: Any = Widths(np.ones(1), np.array([0.5]))
    assert usual.log_density(np.array([400.0]))[0] == pytest.approx(math.log(0.5) + halfnorm.logpdf(20.0, scale=10.0))
    assert np.asarray(usual.part(0).factor).tolist() == [10.0]


def test_all_are_as_wide_as_they_may_be():
    widest = Widths(np.array([0.5, 0.02, 3.0]), np.array([0.2, 1e-9, 0.0]), np.array([4.0, 25.0, 7.0])).widest
    np.testing.assert_allclose(widest.width, [2.0, 0.5, 3.0])
    a = np.array([1.0, 0.3, 7.0])
    np.testing.assert_allclose(widest.log_density(a**2), halfnorm.logpdf(a, scale=[2.0, 0.5, 3.0]), rtol=1e-12)


def test_the_record_of_a_density_is_worked_out_when_it_is_asked_for():
    asked = []

    def derivatives():
        asked.append(1)
        return np.array([7.0]), np.array([[3.0]]), {}

    m = module.Marginal(0.0, np.eye(1), np.zeros(1), derivatives)
    assert not asked
    assert (m.slope.tolist(), m.fisher.tolist(), asked) == ([7.0], [[3.0]], [1])

"""The mass over the amplitudes of the discrepancy: scipy's quadrature of normal densities, part by part."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import block_diag
from straight_bench import half_normal

from tissuejax.diagnosis.judgement import mass
from tissuejax.diagnosis.judgement.marginal import Blocked, Linear, Widths, marginal
from tissuejax.diagnosis.judgement.mass import _change, _within, amplitude_mass
from tissuejax.estimation.discrepancy import Part

N, SIGMA = 24, 0.4
diagonal: Any = block_diag
ROWS = (slice(0, 10), slice(10, N))
LAW = np.stack([np.linspace(-1, 1, N), np.sin(np.arange(N))], axis=1)
SLOW = tuple(np.exp(-np.abs(np.subtract.outer(t, t)) / 6) for t in (np.arange(10.0), np.arange(14.0)))
SMOOTH, WITHIN = Part("law", "law", LAW), Part("slow", "slow", within=SLOW)
BLOCKED = Blocked(ROWS, np.full(N, SIGMA))
COLUMN = np.cos(np.arange(N) / 3)[:, None]


def drawn(seed: int, size: float = 0.0) -> np.ndarray:
    """White noise, and both parts of an amplitude."""
    rng = np.random.default_rng(seed)
    wander = np.linalg.cholesky(diagonal(*SLOW)) @ rng.standard_normal(N)
    return SIGMA * rng.standard_normal(N) + size * (LAW @ rng.standard_normal(2) + wander)


def linear(residual: np.ndarray, weak: float = 4.0) -> Linear:
    return Linear(residual, COLUMN, np.zeros(1), np.array([weak]))


def each(parts) -> list[np.ndarray]:
    return [p.factor @ p.factor.T if p.factor is not None else diagonal(*p.within) for p in parts]


def density(residual: np.ndarray, parts, v, weak: float = 4.0) -> float:
    """Of the residual, the column's size being normal of the precision `weak`, but for that prior's own factor."""
    k = SIGMA**2 * np.eye(N) + COLUMN @ COLUMN.T / weak + sum(x * b for x, b in zip(v, each(parts), strict=True))
    return -0.5 * float(residual @ np.linalg.solve(k, residual) + np.linalg.slogdet(k)[1] + N * math.log(2 * math.pi))


def along(residual: np.ndarray, parts, widths: Widths, v: np.ndarray, k: int) -> float:
    """log of int p(y | a) p(a) da over p(y | v), over the amplitude k alone: from a ten-thousandth of its width to ten
    times what it may be."""
    here, w, c = density(residual, parts, v), float(widths.width[k]), float(widths.chance[k])
    wide = w * float(np.broadcast_to(widths.factor, widths.width.shape)[k])

    def weight(log_a: float) -> float:
        a = math.exp(log_a)
        prior = (1 - c) * half_normal(a, w) + c * half_normal(a, wide)
        other = np.where(np.arange(len(v)) == k, a**2, v)
        return a * prior * math.exp(density(residual, parts, other) - here)

    ends = np.log([1e-4 * w, 1e-2 * w, 0.1 * w, 0.3 * w, w, 0.5 * (wide + w), 10 * wide])
    return math.log(sum(quad(weight, a, b, epsabs=0, epsrel=1e-6)[0] for a, b in zip(ends, ends[1:], strict=False)))


PRIORS = [(0.3, 0.0, 10.0), (0.3, 0.2, 10.0), (0.05, 0.3, 40.0), (2.0, 0.1, 3.0)]


@pytest.mark.parametrize("v", [0.0, 0.04])
@pytest.mark.parametrize(("width", "chance", "factor"), PRIORS)
@pytest.mark.parametrize("size", [0.0, 0.5])
def test_the_mass_over_the_amplitude_of_a_smooth_part_is_its_integral(v, width, chance, factor, size):
    residual = drawn(1, size)
    widths = Widths(np.array([width]), np.array([chance]), np.array([factor]))
    m = marginal(linear(residual), (SMOOTH,), np.array([v]), BLOCKED)
    found = amplitude_mass(linear(residual), (SMOOTH,), widths, BLOCKED, np.array([v]), m)
    assert found == pytest.approx(along(residual, (SMOOTH,), widths, np.array([v]), 0), abs=3e-5)


@pytest.mark.parametrize("size", [0.0, 0.5, 1.5])
@pytest.mark.parametrize(("width", "chance", "factor"), PRIORS)
def test_the_mass_over_the_amplitude_of_a_part_within_blocks_is_nearly_its_integral(size, width, chance, factor):
    """About the likeliest amplitude."""
    residual = drawn(2, size)
    widths = Widths(np.array([width]), np.array([chance]), factor)
    squares = np.append(0.0, np.geomspace(1e-3 * width, 10 * width * factor, 200)) ** 2
    worth = [density(residual, (WITHIN,), [x]) + widths.log_shape(x / widths.width**2)[0] for x in squares]
    v = float(squares[np.argmax(worth)])
    m = marginal(linear(residual), (WITHIN,), np.array([v]), BLOCKED)
    found = amplitude_mass(linear(residual), (WITHIN,), widths, BLOCKED, np.array([v]), m)
    assert found == pytest.approx(along(residual, (WITHIN,), widths, np.array([v]), 0), abs=0.06)


MORE = 0.95 * LAW[:, :1] + 0.05 * LAW[:, 1:]
THREE = (SMOOTH, Part("like", "law", MORE), Part("other", "gain", np.cos(np.arange(N) * 2.0)[:, None]))
EMPTY = Part("empty", "effect", np.zeros((N, 1)))


@pytest.mark.parametrize(
    ("at", "moving"),
    [
        ((1.1e-3, 0.5, 0.0), (0, 1)),
        ((0.9e-3, 0.5, 0.0), (1,)),
        ((0.9e-3, 0.0, 0.0), ()),
        ((0.3, 0.2, 0.4), (0, 1, 2)),
        ((0.3, 0.0, 0.4), (0, 2)),
    ],
)
@pytest.mark.parametrize("empty", [False, True])
def test_amplitudes_that_moved_are_not_taken_one_by_one(at, moving, empty):
    """Beside the masses of each one their correlations' determinant, with a thousandth for those that are one; what
    is empty is never among them, and its mass is that of its prior."""
    parts, widths = (
        (*THREE, EMPTY)[: 3 + empty],
        Widths(np.array([0.3, 0.5, 2.0, 1.0])[: 3 + empty], np.zeros(3 + empty)),
    )
    residual, v = drawn(3, 0.5), np.array([*at, 1.0])[: 3 + empty] * widths.width**2
    m = marginal(linear(residual), parts, v, BLOCKED)
    found = amplitude_mass(linear(residual), parts, widths, BLOCKED, v, m)
    k = SIGMA**2 * np.eye(N) + COLUMN @ COLUMN.T / 4 + sum(x * b for x, b in zip(v, each(parts), strict=True))
    b = [np.linalg.solve(k, x) for x in each(parts)]
    information = np.array([[0.5 * np.trace(x @ y) for y in b] for x in b])
    expected = sum(along(residual, parts, widths, v, i) for i in range(3))
    if len(moving) > 1:
        own = information[np.ix_(moving, moving)]
        alike = own / np.sqrt(np.outer(np.diag(own), np.diag(own)))
        expected -= 0.5 * float(np.linalg.slogdet(alike + 1e-3 * np.eye(len(moving)))[1])
    assert found == pytest.approx(expected, abs=2e-4)


def test_what_changes_with_one_amplitude_is_the_difference_of_two_densities():
    residual, parts, v = drawn(4, 0.5), (SMOOTH, WITHIN), np.array([0.2, 0.1])
    m = marginal(linear(residual), parts, v, BLOCKED)
    for k, x in ((0, 0.0), (1, 0.0), (0, 0.9), (1, 3.0)):
        expected = density(residual, parts, [x, 0.1] if k == 0 else [0.2, x]) - density(residual, parts, v)
        assert _change(linear(residual), parts, BLOCKED, v, m, k, x) == pytest.approx(expected, abs=1e-9)


def taken(residual: np.ndarray, v: float, width: float, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What is said of the evidence at amplitudes of the part within blocks, and what it is."""
    widths, parts, at = Widths(np.ones(2) * width, np.zeros(2)), (SMOOTH, WITHIN), np.array([0.05, v])
    m = marginal(linear(residual), parts, at, BLOCKED)
    said = _within(linear(residual), parts, widths, BLOCKED, at, m, 1)(a**2)
    return said, np.array([density(residual, parts, [0.05, x**2]) - density(residual, parts, at) for x in a])


@pytest.mark.parametrize("v", [0.0, 0.99e-3])
def test_of_a_part_at_rest_the_evidence_is_exact_from_a_thirtieth_to_a_hundred_of_its_width(v):
    """At nothing and at half-decades."""
    a = 0.3 * np.array([0.0, 0.03, 0.1, 0.3, 1.0, 3.0])
    said, exact = taken(drawn(5), v * 0.09, 0.3, a)
    np.testing.assert_allclose(said, exact, atol=1e-8)
    # of an amplitude whose width is little it is exact at ten and at a hundred of it too
    said, exact = taken(drawn(5), v * 1e-4, 0.01, 0.01 * np.array([0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0]))
    np.testing.assert_allclose(said, exact, atol=1e-8)


def error_of_its_logarithm(residual: np.ndarray, v: float) -> float:
    """1 / (2 v sqrt(information by v)), information within blocks."""
    k = SIGMA**2 * np.eye(N) + COLUMN @ COLUMN.T / 4 + 0.05 * LAW @ LAW.T + v * diagonal(*SLOW)
    p = np.linalg.inv(k)
    information = sum(0.5 * np.trace(p[r, r] @ s @ p[r, r] @ s) for r, s in zip(ROWS, SLOW, strict=True))
    return 0.5 / (v * math.sqrt(information))


@pytest.mark.parametrize("v", [0.05, 0.6])
def test_of_a_part_that_moved_the_evidence_is_exact_about_where_it_is(v):
    """In standard errors of the amplitude's logarithm, which the information on its square gives."""
    residual = drawn(6, 0.6)
    error = error_of_its_logarithm(residual, v)
    assert 0.02 < error < 1.5
    knots = np.array([-16, -8, -4, -2, -1, -0.5, 0, 0.5, 1, 2])
    said, exact = taken(residual, v, 0.3, np.append(0.0, math.sqrt(v) * np.exp(error * knots)))
    np.testing.assert_allclose(said, exact, atol=1e-8)
    assert np.max(np.abs(said)) > 0.3


@pytest.mark.parametrize(
    ("n", "sigma", "error", "knots"),
    [
        (
            2,
            1e-3,
            0.5 * (1 + 1e-6),
            [-16, -8, -4, 0.5, 4, 8, 16],
        ),  # two samples that are known well: 1 / (2 sqrt(2 / 2))
        (2, 30.0, 1.5, [-2, -1, 0.5, 1, 2, 4, 8]),  # in so much noise next to nothing: no more than that
        (4000, 1e-3, 0.02, [-8, -4, -2, 0.5, 1, 2]),  # 1 / (2 sqrt(4000 / 2)): no less than that
    ],
)
def test_steps_about_where_a_part_is_are_neither_longer_nor_shorter(n, sigma, error, knots):
    """Of samples of variance sigma^2 + a^2 each, taken in pairs; the part is at one."""
    residual = np.random.default_rng(n).normal(0, 1.2, n)
    rows = tuple(slice(2 * i, 2 * i + 2) for i in range(n // 2))
    part, blocked = Part("slow", "slow", within=(np.eye(2),) * len(rows)), Blocked(rows, np.full(n, sigma))
    one = Linear(residual, np.zeros((n, 1)), np.zeros(1), np.ones(1))
    m = marginal(one, (part,), np.ones(1), blocked)
    a = np.exp(error * np.array(knots))
    said = _within(one, (part,), Widths(np.ones(1), np.zeros(1)), blocked, np.ones(1), m, 0)(a**2)

    def whole(square: np.ndarray) -> np.ndarray:
        return -0.5 * (n * np.log(sigma**2 + square) + np.sum(residual**2) / (sigma**2 + square))

    np.testing.assert_allclose(said, whole(a**2) - whole(np.array(1.0)), rtol=1e-9, atol=1e-7)


@pytest.mark.parametrize(("v", "moved"), [(0.9e-3, False), (1.1e-3, True)])
def test_a_part_moved_from_a_thousandth_of_its_squared_width(v, moved):
    """Exact at its width where it is at rest."""
    said, exact = taken(drawn(7), v * 4.0, 2.0, np.array([2.0]))
    assert (abs(said[0] - exact[0]) < 1e-9) == (not moved)


def test_beyond_what_is_taken_the_evidence_never_rises():
    """It goes on down in a straight line of the amplitude's inverse hyperbolic sine, as it came."""
    unit = 0.03 * 0.3
    a = np.array(
        [0.3 * 100, unit * math.sinh(math.asinh(100 / 0.03) + 1), unit * math.sinh(math.asinh(100 / 0.03) + 3)]
    )
    said, _ = taken(drawn(8), 0.0, 0.3, a)
    assert said[1] <= said[0]
    assert said[2] - said[1] == pytest.approx(2 * (said[1] - said[0]), abs=1e-9)


def test_where_the_evidence_still_rises_at_the_last_amplitude_it_stays_as_it_is_there():
    said, exact = taken(drawn(8, 4.0), 0.0, 1e-3, np.array([0.05, 0.1, 0.2, 3.0]))
    assert exact[0] + 1 < exact[1] < exact[2] - 1
    assert said[1] == pytest.approx(exact[1], abs=1e-8)
    assert said[2] == said[3] == pytest.approx(said[1], abs=1e-12)


def test_what_has_fallen_by_fifteen_nats_is_followed_no_further(monkeypatch):
    """Noise is so well known that the first amplitudes are out of question."""
    asked = []
    usual = mass._change

    def change(*given):
        asked.append((given[-1], usual(*given)))
        return asked[-1][1]

    monkeypatch.setattr(mass, "_change", change)
    taken(drawn(9) * 0.1, 0.0, 30.0, np.array([1.0]))
    assert len(asked) < 8
    falls = [fall for _, fall in asked]
    assert min(falls[:-1]) > -15.0 > falls[-1]

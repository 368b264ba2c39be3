"""The filters behind the shape of noise against dense covariance matrices, kinks, gaps and padding included; the level
against a root of its equation."""

import math
from typing import Any

import jax
import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar
from scipy.stats import multivariate_normal, norm

from tissuejax.estimation import correlation
from tissuejax.estimation.correlation import Series

TIME = np.array([0.0, 0.2, 0.25, 0.9, 1.0, 1.7, 1.7, 2.2, 3.1, 3.2, 3.9, 4.4])
SHARES, TAUS, WALKS = np.array([0.3, 0.9]), np.array([0.2, 1.5]), np.array([0.0, 0.05, 2.0])


def wandering(time: np.ndarray, kinks: tuple[int, ...], walk: float, diffuse: float, span: float) -> np.ndarray:
    """Covariance of a level and, from each kink to the next, a slope of its own and an integrated Wiener process:
    min^2 max / 2 - min^3 / 6 (Wahba 1978); what a slope has done stays where it ends."""
    out = np.full((len(time), len(time)), diffuse)
    edges = [time[0], *(time[k] for k in kinks), math.inf]
    for begin, end in zip(edges, edges[1:], strict=False):
        path = np.clip(time, begin, end) - begin
        less, more = np.minimum.outer(path, path), np.maximum.outer(path, path)
        out += diffuse / span**2 * np.outer(path, path) + walk * (less**2 * more / 2 - less**3 / 6)
    return out


def whole(time, share, tau, walk, order, diffuse, span, kinks=()) -> Any:
    d = np.abs(np.subtract.outer(time, time)) / tau
    shape = np.exp(-d) * (1.0 if order == 1 else 1 + d)
    return share * shape + (1 - share) * np.eye(len(time)) + wandering(time, kinks, walk, diffuse, span)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("kinks", [(), (4, 8), (1, 11)], ids=str)
def test_a_filter_gives_determinant_and_squares_of_the_dense_matrix(order, kinks, rng):
    trials = np.array([
        (0.0, 1.0, 0.0), (0.4, 0.3, 0.0), (0.4, 0.3, 0.7), (0.95, 5.0, 3.0), (0.7, 0.05, 0.1), (0.0, 1.0, 0.5),
    ])  # fmt: skip
    y = 2.0 * rng.normal(size=12) + TIME
    seen = np.append(np.arange(12) != 7, [False] * 3)
    turns = np.isin(np.arange(15), kinks)
    steps = np.append(np.diff(TIME), [0.0] * 4)
    run = correlation._filter if order == 1 else correlation._filter_twice
    with jax.enable_x64(True):
        shares, taus, walks = trials.T
        padded = np.append(y, [9.0] * 3)
        found = run(steps, padded, seen, turns, shares, taus, walks, np.float64(20.0), np.float64(4.0))
    logs, squares = (np.asarray(x) for x in found)
    for k, (share, tau, walk) in enumerate(trials):
        c = whole(TIME, share, tau, walk, order, 20.0, 4.0, kinks)[np.ix_(seen[:12], seen[:12])]
        assert logs[k] == pytest.approx(np.linalg.slogdet(c)[1], abs=1e-9)
        assert squares[k] == pytest.approx(y[seen[:12]] @ np.linalg.solve(c, y[seen[:12]]), rel=1e-9)


def surface_of(rng, n=30, size=1.0, **what) -> tuple[correlation._Surface, np.ndarray, np.ndarray]:
    time = 5.0 + np.sort(rng.uniform(0, 6, n))
    values = size * (rng.normal(size=(n, 2)) + 2.0 * np.sin(time)[:, None]) + 3.0 - time[:, None]
    surface = correlation._Surface(Series(time, values, (4, 20)), **what)
    return surface, time - time[0], values


def test_a_surface_takes_a_straight_line_out_and_knows_its_scales(rng):
    surface, time, values = surface_of(rng, size=3.0)
    span, step = time[-1], np.median(np.diff(time))
    assert (surface.n, surface.span, surface.step) == (30, span, pytest.approx(step, rel=1e-12))
    line = np.stack([np.ones(30), time], 1)
    rest = values - line @ np.linalg.solve(line.T @ line, line.T @ values)
    np.testing.assert_allclose(surface.columns, rest.T, atol=1e-11)
    assert np.mean(rest**2) > 2
    assert surface.prior == pytest.approx((1e4 * np.mean(rest**2), span), rel=1e-10)
    assert (surface.least, surface.most) == pytest.approx(
        (-6 - 3 * math.log10(span), 3 - 3 * math.log10(step)), rel=1e-12
    )
    np.testing.assert_array_equal(np.flatnonzero(surface.turns), [4, 20])
    np.testing.assert_array_equal(np.flatnonzero(surface.seen), np.arange(30))
    np.testing.assert_allclose(surface.steps[:29], np.diff(time))
    assert not np.any(surface.steps[29:])
    for padded, column in zip(surface.padded, surface.columns, strict=True):
        np.testing.assert_array_equal(padded[:30], column)
        assert not np.any(padded[30:])
    assert surface_of(rng, size=0.01)[0].prior[0] == 1e4
    still = correlation._Surface(Series(time, np.zeros((30, 1))))
    assert still.prior[0] == 1e4
    assert surface.capped
    assert not surface_of(rng, capped=False)[0].capped


@pytest.mark.parametrize(("n", "length"), [
    (2, 192), (192, 192), (193, 256), (256, 256), (257, 384), (384, 384), (385, 512), (512, 512), (513, 768),
    (769, 1024),
])  # fmt: skip
def test_lengths_are_powers_of_two_and_three_quarters_of_them(n, length):
    surface = correlation._Surface(Series(np.arange(float(n)), np.ones((n, 1))))
    assert [len(x) for x in (surface.steps, surface.seen, surface.turns, *surface.padded)] == [length] * 4
    assert np.sum(surface.seen) == n


def test_no_walk_is_tried_beside_walks_evenly_in_powers_of_ten(rng):
    surface = surface_of(rng)[0]
    np.testing.assert_allclose(surface.walks(-2.0, 5.0), [0.0, *(10.0**k for k in range(-2, 6))], rtol=1e-12)
    three = surface.walks(-2.0, 5.0, 3)
    assert len(three) == 27
    assert (three[0], three[1], three[26]) == pytest.approx((0.0, 1e-2, 1e5))
    np.testing.assert_allclose(np.diff(np.log10(three[1:])), 7 / 25, rtol=1e-9)
    alone = surface_of(rng, mismatch=False)[0]
    np.testing.assert_array_equal(alone.walks(-2.0, 5.0), [0.0])
    np.testing.assert_array_equal(alone.walks(-2.0, 5.0, 3), np.zeros(3))


def likeliest(surface, time, share, tau, walk, order, free, capped) -> tuple[float, float]:
    """Log-likelihood but for 2 pi, and the variance: by search, of a lognormal prior about the recorded level that is
    one at its mode."""
    c = whole(time, share, tau, walk, order, surface.prior[0], surface.prior[1], (4, 20))
    n = len(time)

    def cost(log):
        covariance: Any = math.exp(log) * c
        law = multivariate_normal(np.zeros(n), covariance, allow_singular=True)
        told = sum(float(law.logpdf(x)) + 0.5 * n * math.log(2 * math.pi) for x in surface.columns)
        scale = math.log(2.0)
        return -told - float(norm.logpdf(0.5 * log, scale=scale) - norm.logpdf(0.0, scale=scale) if capped else 0.0)

    if not free:
        return -float(cost(0.0)), 1.0
    most = 0.0 if capped and share > 0 else 8.0
    found = minimize_scalar(cost, bounds=(-8.0, most), method="bounded", options={"xatol": 1e-9})
    return -float(found.fun), math.exp(found.x)


@pytest.mark.parametrize(("order", "free", "capped", "size"), [
    (1, True, True, 0.3), (1, True, True, 2.0), (1, True, False, 2.0), (1, False, True, 1.0), (2, True, False, 0.5),
])  # fmt: skip
def test_the_best_walk_and_level_of_every_share_and_time(order, free, capped, size, rng):
    surface, time, _ = surface_of(rng, size=size, capped=capped)
    found, walk, variance = surface(SHARES, TAUS, WALKS, free, order)
    assert found.shape == walk.shape == variance.shape == (2, 2)
    for i, share in enumerate(SHARES):
        for j, tau in enumerate(TAUS):
            each = [likeliest(surface, time, share, tau, w, order, free, capped) for w in WALKS]
            best = int(np.argmax([x[0] for x in each]))
            assert walk[i, j] == WALKS[best]
            assert found[i, j] == pytest.approx(each[best][0], abs=2e-5)
            assert variance[i, j] == pytest.approx(each[best][1], rel=1e-3)
            if capped and free:
                assert (variance[i, j] == 1.0) == (size == 2.0)


def test_white_noise_alone_may_exceed_what_was_recorded(rng):
    surface, time, _ = surface_of(rng, size=3.0)
    found, walk, variance = surface(np.zeros(1), np.ones(1), WALKS[[0]], True)
    told, level = likeliest(surface, time, 0.0, 1.0, 0.0, 1, True, True)
    assert (found[0, 0], walk[0, 0]) == pytest.approx((told, 0.0), abs=2e-5)
    assert variance[0, 0] == pytest.approx(level, rel=1e-4)
    assert level > 2


@pytest.mark.parametrize("n", [3, 64, 2000])
@pytest.mark.parametrize("ratio", [1e-2, 0.3, 1.0, 7.0, 400.0])
def test_the_likeliest_variance_is_the_root_of_its_equation(n, ratio):
    """d/dx of n x + s exp(-x) + (x / 2 / ln 2)^2, x the logarithm of the variance."""
    squares = n * ratio
    root = brentq(lambda x: n - squares * math.exp(-x) + x / (2 * math.log(2.0) ** 2), -30, 30, xtol=1e-13)
    (found,) = correlation._levels(np.array([squares]), n, True)
    assert math.log(found) == pytest.approx(root, abs=2e-2 if n == 3 else 2e-8)
    (plain,) = correlation._levels(np.array([squares]), n, False)
    assert plain == pytest.approx(ratio, rel=1e-12)


def test_of_nothing_at_all_the_prior_alone_gives_the_level():
    (found,) = correlation._levels(np.zeros(1), 3, True)
    assert found == pytest.approx(math.exp(-6 * math.log(2.0) ** 2), rel=1e-9)
    assert 0 < correlation._levels(np.zeros(1), 3, False)[0] <= 1e-299


def test_half_the_level_is_as_unlikely_as_twice_of_it():
    """Of the logarithm of the level, normal about nothing with ln 2."""
    variance = np.array([1 / 16, 0.25, 1.0, 4.0, 9.0])
    scale = math.log(2.0)
    expected = -2 * (norm.logpdf(np.log(np.sqrt(variance)), scale=scale) - norm.logpdf(0.0, scale=scale))
    np.testing.assert_allclose(correlation._unlikely(variance, True), expected, atol=1e-12)
    np.testing.assert_array_equal(correlation._unlikely(variance, False), np.zeros(5))


@pytest.mark.parametrize(("time", "step"), [
    ([0.0, 1.0, 3.0, 3.0, 4.0], 1.0), ([0.0, 0.5], 0.5), ([2.0, 2.0], 1.0), ([2.0], 1.0), ([], 1.0),
    ([0.0, 0.0, 0.0, 0.0, 0.25, 0.75], 0.375),
])  # fmt: skip
def test_the_typical_step_counts_samples_that_are_apart(time, step):
    assert correlation._step(np.array(time)) == step


def test_spacing_narrows_to_the_neighbours_of_the_best():
    np.testing.assert_allclose(correlation._around(np.array([1.0, 3.0, 5.0, 7.0]), 2), [3.0, 13 / 3, 17 / 3, 7.0])
    np.testing.assert_allclose(correlation._around(np.array([1.0, 3.0, 5.0]), 0), [-1.0, 1.0, 3.0])
    assert correlation._narrowed((-6.0, 8.0), 0.01) == pytest.approx((-5.0, 1.0))  # 1.5 of a seventh to either side
    assert correlation._narrowed((-6.0, 8.0), 0.0) == pytest.approx((-9.0, -3.0))
    assert correlation._narrowed((-6.0, 1.0), 1.0) == pytest.approx((-1.5, 1.5))
